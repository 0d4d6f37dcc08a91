"""The generated brake written as a model file and read again: the same matrices."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.io import loadmat
from study_runs import command, plan_of, solved

import squealstudy as sq
from squealstudy.engine.export import export_model, export_reduced
from squealstudy.models.components.inp import read_inp
from squealstudy.study.components import read_model
from squealstudy.study.definition import parse_study

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.usefixtures("tiny_brake", "assembled_once")
STUDY = """\
[study]
name = "generated"
kind = "complex_modes"

[model]
name = "disc_brake"
mesh = "coarse"
contact_points = 2
kinematics = "rotation"

[parameters]
"disc.young_modulus" = 1.1e11
friction = 0.4
"""


@pytest.fixture(scope="module")
def both(tmp_path_factory, tiny_brake, assembled_once):
    """The assembly of the generated brake, and of its export."""
    folder = tmp_path_factory.mktemp("export")
    study = parse_study(STUDY, Path("generated.toml"))
    export_model(study, folder)
    model = read_model(folder / "brake.toml")
    options = {o.name: o.choices[0] for o in model.options}
    values = {n: study.values[n] for n in study.model.defaults()}
    return study.model.build(study.options, values), model.build(options, model.defaults())


def same(A, B, tolerance):
    assert A.shape == B.shape
    assert abs(A - B).max() <= tolerance * abs(A).max()


def test_components_are_the_same(both):
    one, two = both
    assert one.component_names == two.component_names
    same(one.M, two.M, 1e-12)
    same(one.K_el, two.K_el, 1e-11)
    for a, b in zip(one.components, two.components, strict=True):
        np.testing.assert_allclose(a.coordinates, b.coordinates, atol=1e-14)


def test_sets_of_the_meshes_are_those_of_the_page_and_where_they_are_named(tmp_path):
    study = parse_study(STUDY, Path("generated.toml"))
    export_model(study, tmp_path)
    v = {n: study.values[n] for n in study.model.defaults()}
    page = (ROOT / "docs" / "reference" / "export.md").read_text(encoding="utf-8")
    told = set(re.findall(r"`((?:disc|inner_pad|outer_pad|caliper)\.[A-Z]+)`", page))
    meshes = {path.stem: read_inp(path) for path in tmp_path.glob("*.inp")}
    assert told == {f"{name}.{label}" for name, mesh in meshes.items() for label in mesh.surfaces}
    mesh = meshes["caliper"]
    (block,) = mesh.blocks
    faces = [block.nodes[e, block.kind.shape.faces[k - 1]] for e, k in mesh.surfaces["BRIDGE"]]
    nodes = mesh.nodes[np.unique(np.concatenate(faces))]
    np.testing.assert_allclose(np.hypot(*nodes.T[:2]), v["caliper.outer_radius"], rtol=1e-9)
    thickness = v["disc.thickness"] + 2 * (v["pad.lining_thickness"] + v["pad.plate_thickness"])
    half = np.deg2rad(v["caliper.bridge_half_angle"])
    assert np.ptp(nodes[:, 2]) == pytest.approx(thickness)
    assert np.ptp(np.arctan2(nodes[:, 1], nodes[:, 0])) == pytest.approx(2 * half)


def test_contact_layers_springs_and_load_are_the_same(both):
    """Springs may stand in another order: what they make of motions is compared.

    Points of the fingers lie on an edge of two cells of the pad, which its arc leaves by 1e-6.
    """
    one, two = both
    of_file = {s.name: s for s in two.springs}
    for spring in one.springs:
        other = of_file[spring.name]
        same(spring.matrix(), other.matrix(), 2e-6 if spring.name == "fingers" else 1e-12)
        assert spring.in_static == other.in_static
    for left, right in (("N", "N"), ("T", "N"), ("T", "T"), ("T_perp", "T_perp")):
        A, B = (
            getattr(x, left).T @ sp.diags(x.area * x.radius * x.speed_factor) @ getattr(x, right)
            for x in (one.contact, two.contact)
        )
        same(A, B, 1e-12)
    assert one.contact.n_points == two.contact.n_points
    same(one.load, two.load, 1e-12)


@pytest.mark.full_size  # by default the exported matrices: below
def test_the_command_writes_a_model_with_the_same_modes(tmp_path, capsys):
    few = """
[reduction]
enrichment = false

[modes]
band = [500.0, 2500.0]
reference_points = 0
"""
    (tmp_path / "generated.toml").write_text(STUDY + few)
    assert command("export", str(tmp_path / "generated.toml"), "-o", str(tmp_path / "out")) == 0
    assert "brake.toml" in capsys.readouterr().out
    here = str(tmp_path / "generated.toml")
    assert command("export", here, "-o", here) == 2
    assert "found a file" in capsys.readouterr().err
    study = STUDY[: STUDY.index("[model]")] + '[model]\nfile = "brake.toml"\n' + few
    (tmp_path / "out" / "study.toml").write_text(study)
    one, two = (
        sq.run(tmp_path / path, tmp_path / f"r{i}", jobs=1).modes
        for i, path in enumerate(("generated.toml", "out/study.toml"))
    )
    roots = []
    for m in (one, two):  # frequencies are those of |lambda|
        growth, size = m["growth_rate"], 2 * np.pi * m["frequency_hz"]
        roots.append(growth + 1j * np.sqrt(size**2 - growth**2))
    assert len(roots[0]) == len(roots[1]) > 5
    assert (np.abs(roots[0] - roots[1]) < 1e-8 * np.abs(roots[0])).all()
    with np.load(tmp_path / "out" / "reduced.npz") as archive:
        found = dict(archive)
    page = (ROOT / "docs" / "reference" / "export.md").read_text(encoding="utf-8")
    table = page[page.index("`reduced.mat`") :].split("## The generated")[0]
    told = [row.split("|")[1] for row in table.splitlines() if row.startswith("| `")]
    assert set(re.findall(r"`(\w+)`", " ".join(told))) == set(found)
    law = dict(zip(found["law_parameter_names"].tolist(), found["law_parameters"], strict=True))
    values = dict(zip(found["parameter_names"].tolist(), found["parameter_values"], strict=True))
    assert law
    assert values | law == values
    assert (values["friction"], values["disc.young_modulus"]) == (0.4, 1.1e11)
    coupling = found["T"].T * (found["friction_coefficient"] * found["area"] * found["tangent"])
    skew = found["K"] - found["K"].T  # of friction alone: the stiffness without it is symmetric
    K_friction = -coupling @ found["N"]
    np.testing.assert_allclose(skew, K_friction - K_friction.T, atol=1e-9 * np.abs(skew).max())
    n = len(found["M"])
    assert found["N"].shape == (len(found["area"]), n)
    lam = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-found["K"], -found["C"]]]))
    for root in roots[0]:
        assert np.abs(lam - root).min() < 1e-9 * abs(root)
    again = loadmat(tmp_path / "out" / "reduced.mat")
    np.testing.assert_array_equal(again["K"], found["K"])


CHANGED = """\
[study]
name = "changed"
kind = "complex_modes"
[model]
name = "disc_brake"
mesh = "coarse"
contact_points = 2
[parameters]
friction = 0.45
pressure = 8e5
CHANGE
[reduction]
enrichment = false
[modes]
band = [500.0, 2500.0]
method = "dense"
reference_points = 0
track = false
"""
CHANGES = {
    "stiffer and damped": '"caliper.modes[8].frequency_scale" = 1.05\n'
    '"caliper.modes[8].damping_ratio" = 0.03\n"modes[8].damping_ratio" = 0.02',
    "softer": '"disc.modes[7-18].frequency_scale" = 0.8',
}


@pytest.mark.parametrize(
    "change", ["stiffer and damped", pytest.param("softer", marks=pytest.mark.full_size)]
)
def test_eigenvalues_of_exported_matrices_are_those_of_a_run(change, tmp_path):
    """The working point is that of the changed structure, too: gaps move by its stiffness."""
    text = CHANGED.replace("CHANGE", CHANGES[change])
    modes = solved(text, tmp_path / "run").modes
    export_reduced(plan_of(text), tmp_path / "out")
    with np.load(tmp_path / "out" / "reduced.npz") as found:
        C, K = found["C"], found["K"]
    n = len(K)
    lam = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]]))
    told = modes["growth_rate"] + 2j * np.pi * np.sqrt(
        modes["frequency_hz"] ** 2 - (modes["growth_rate"] / (2 * np.pi)) ** 2
    )
    assert len(told) > 5
    for root in told[~modes["overdamped"]]:
        assert np.abs(lam - root).min() < 1e-6 * abs(root)
