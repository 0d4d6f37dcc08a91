"""Stiffness of stresses: a bar under axial load, turned bodies, CalculiX, and a model file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from calculix import AXES, CCX, ragged, run
from component_meshes import LINING, STEEL, box
from own_blocks import write_blocks
from study_runs import command, load_plan, solved

from squealstudy.errors import StudyFileError
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.models.components.stress_stiffness import stress_stiffness
from squealstudy.study.components import read_model

CELLS = {"C3D20R": (10, 2, 2), "C3D8_BBAR": (30, 2, 2)}
LENGTH, SIDE, STRAIN = 100.0, 2.0, 2e-4
KINDS = ("C3D20", "C3D20R", "C3D8I", "C3D10", "C3D15", "C3D8_BBAR")


def bar(kind, cells=(24, 1, 1)):
    return box(kind, cells, (LENGTH, SIDE, SIDE))


def pulled(mesh, strain):
    """Uniform tension along x."""
    nu = STEEL.poisson_ratio
    return strain * mesh.nodes * np.array([1.0, -nu, -nu])


def guided(mesh, matrices):
    """Modes of a bar whose ends stay in their plane: (omega^2, shapes), all of z and x."""
    held = np.zeros(mesh.nodes.shape, dtype=bool)
    ends = np.isclose(mesh.nodes[:, 0], 0) | np.isclose(mesh.nodes[:, 0], LENGTH)
    held[ends, 0] = True
    kept = np.flatnonzero(~held.ravel())
    return la.eigh(*(A[kept][:, kept].toarray() for A in matrices), subset_by_index=(0, 11))[0]


@pytest.mark.parametrize("kind", KINDS)
def test_tension_raises_the_frequencies_of_a_bar(kind):
    """A string in addition: omega^2 grows by sigma / rho (n pi / L)^2, in compression it falls."""
    mesh = bar(kind, CELLS.get(kind, (16, 1, 1)))
    K, M = stiffness_matrix(mesh), mass_matrix(mesh)
    free = guided(mesh, (K, M))
    beam = STEEL.young_modulus * SIDE**2 / (12 * STEEL.density) * (np.pi / LENGTH) ** 4
    bent = free > 0.5 * beam  # below are translations and a turn
    for strain in (STRAIN, -STRAIN):
        loaded = guided(mesh, (K + stress_stiffness(mesh, pulled(mesh, strain)), M))
        n = np.array([1, 1, 2, 2])  # two directions each
        found = (loaded - free)[bent][:4]
        string = strain * STEEL.young_modulus / STEEL.density * (n * np.pi / LENGTH) ** 2
        np.testing.assert_allclose(found, string, rtol=1.5e-2)
        assert np.abs(string / free[bent][:4]).max() > 0.1


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("axes", ["global", "turned", "cylindrical"])
def test_it_turns_with_the_body_and_is_of_rotation_what_loads_do(kind, axes):
    rng = np.random.default_rng(1)
    mesh = ragged(kind, LINING, AXES[axes])
    u = 1e-3 * rng.standard_normal(mesh.nodes.shape)
    K = stress_stiffness(mesh, u).toarray()
    np.testing.assert_allclose(K, K.T, atol=1e-12 * np.abs(K).max())
    turn = la.expm(np.cross(np.eye(3), [0.3, -0.5, 0.9]))
    orientations = {n: o.moved(turn, np.zeros(3)) for n, o in mesh.orientations.items()}
    if axes == "global":
        orientations = {"O": AXES["turned"].moved(np.eye(3), np.zeros(3))}
        return_axes = {"O": AXES["turned"].moved(turn, np.zeros(3))}
        which = np.full(mesh.n_elements, "O", dtype=object)
        mesh = replace(mesh, orientations=orientations, orientation=which)
        K, orientations = stress_stiffness(mesh, u).toarray(), return_axes
    other = replace(mesh, nodes=mesh.nodes @ turn.T, orientations=orientations)
    R = np.kron(np.eye(len(mesh.nodes)), turn)
    moved = stress_stiffness(other, u @ turn.T).toarray()
    np.testing.assert_allclose(moved, R @ K @ R.T, atol=1e-9 * np.abs(K).max())
    shift = np.kron(np.ones((len(mesh.nodes), 1)), np.eye(3))
    assert np.abs(K @ shift).max() < 1e-12 * np.abs(K).max() * len(K)


def test_energy_of_a_rotation_is_that_of_the_mean_stress():
    """Of a bar in tension sigma V theta^2 about axes across it, nothing about its own."""
    mesh = bar("C3D20", (4, 1, 1))
    K = stress_stiffness(mesh, pulled(mesh, STRAIN))
    force = STRAIN * STEEL.young_modulus * SIDE * SIDE * LENGTH
    for axis, expected in ((0, 0.0), (1, force), (2, force)):
        turned = np.cross(np.eye(3)[axis], mesh.nodes).ravel()
        assert turned @ (K @ turned) == pytest.approx(expected, rel=1e-9, abs=1e-9 * force)


@pytest.mark.skipif(CCX is None, reason="STRESS STIFFENING IS NOT CHECKED BY CALCULIX: no ccx")
@pytest.mark.parametrize("kind", ["C3D20", "C3D10", "C3D15"])
def test_calculix_has_the_same_frequencies_under_load(tmp_path, kind):
    """A cantilever pulled by its end: *STATIC, NLGEOM, then *FREQUENCY as a perturbation."""
    mesh = bar(kind, (12, 1, 1))
    root, tip = (np.flatnonzero(np.isclose(mesh.nodes[:, 0], x)) for x in (0.0, LENGTH))
    fixed = [f"{mesh.numbers[i]}, 1, 3" for i in root]
    share = 400.0 / len(tip)  # N; a strain of 5e-4
    load = np.zeros(mesh.nodes.shape)
    load[tip, 0] = share
    steps = ["*BOUNDARY", *fixed, "*STEP, NLGEOM", "*STATIC", "*CLOAD"]
    steps += [f"{mesh.numbers[i]}, 1, {share:.12e}" for i in tip]
    steps += ["*END STEP", "*STEP, PERTURBATION", "*FREQUENCY", "6", "*END STEP"]
    said = run(tmp_path, mesh, *steps)
    rows = [r.split() for r in (tmp_path / "job.dat").read_text().split("\n")]
    told = np.array([float(r[3]) for r in rows if len(r) == 5 and r[0].isdigit()][:6])
    assert len(told) == 6, said
    kept = np.setdiff1d(np.arange(3 * len(mesh.nodes)), (3 * root[:, None] + np.arange(3)).ravel())
    K, M = stiffness_matrix(mesh), mass_matrix(mesh, "as_stiffness")
    K_kept, M_kept = (A[kept][:, kept].toarray() for A in (K, M))
    u = np.zeros(mesh.nodes.size)
    u[kept] = np.linalg.solve(K_kept, load.ravel()[kept])
    stressed = K_kept + stress_stiffness(mesh, u.reshape(-1, 3))[kept][:, kept].toarray()
    hz, plain = (
        np.sqrt(la.eigh(A, M_kept, subset_by_index=(0, 5))[0]) / (2 * np.pi)
        for A in (stressed, K_kept)
    )
    assert np.abs(plain / told - 1).max() > 0.2
    np.testing.assert_allclose(hz, told, rtol=2e-3)  # strains of 5e-4 lengthen the bar, too


# -- model files ---------------------------------------------------------------------------------
TABLE = ("friction = {default = 0.4}", "friction = {default = 0.4}\n\n[stress_stiffening]\n%s")
TAKEN = "pressure = 1.2\nfriction = 0.4"


def built(folder, table=""):
    changes = [(TABLE[0], TABLE[1] % table)] if table else []
    model = read_model(write_blocks(folder, *changes).parent / "blocks.toml")
    options = {o.name: o.choices[0] for o in model.options}
    return model, model.build(options, model.defaults())


def test_a_model_file_adds_it_to_vibration_alone(tmp_path):
    _, plain = built(tmp_path / "plain")
    model, stiff = built(tmp_path / "stiff", TAKEN)
    added = stiff.K_springs() - plain.K_springs()
    size = abs(added).max() / abs(stiff.K_el).max()
    assert 1e-6 < size < 1e-3
    assert abs(stiff.K_springs(static=True) - plain.K_springs(static=True)).nnz == 0
    _, double = built(tmp_path / "double", "pressure = 2.4\nfriction = 0.4")
    both = double.K_springs() - plain.K_springs()
    assert abs(both - 2 * added).max() < 0.15 * abs(both).max()  # contact shifts
    rules = {a.rule.partition(":")[0]: a for a in model.assumptions}
    pressure = rules["stresses are those of 1.2e+06 Pa"]
    friction = rules["stresses are those of friction 0.4"]
    values = model.defaults() | {"pressure": 1.5e6}
    assert pressure.values(values, 1)[0] == pytest.approx(0.25)
    assert friction.values(values, 1)[0] == 0.0
    assert friction.values(values | {"sliding_speed": -1.0}, 1)[0] == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ("pressure = 0.0\nfriction = 0.4", "pressure"),
        ("pressure = 1.2", "friction"),
        ("pressure = 1.2\nfriction = 60.0", "no steady sliding to take stresses from"),
    ],
)
def test_stresses_that_there_are_not(tmp_path, table, text):
    with pytest.raises(StudyFileError, match=text):
        built(tmp_path, table)


def test_reduced_modes_are_those_of_full_order(tmp_path):
    """With stresses as without: 5 MPa in lining and steel move the modes, and growth adds up."""
    found = {}
    for name, table in (("plain", ""), ("stiff", "pressure = 5.0\nfriction = 0.4")):
        changes = [(TABLE[0], TABLE[1] % table)] if table else []
        study = write_blocks(tmp_path / name, *changes)
        results = solved(load_plan(study), tmp_path / name / "results")
        check = results.manifest["reference"][0]
        assert check["status"] == "ok"
        assert check["frequency_error"] < 1e-4
        found[name] = results
    rows = {name: r.modes[~r.modes["overdamped"]]["frequency_hz"] for name, r in found.items()}
    moved = np.abs(rows["stiff"].to_numpy() / rows["plain"].to_numpy() - 1)
    assert 1e-4 < moved.max() < 0.05
    stiff = found["stiff"]
    assert not stiff.points["valid"].any()  # 12 bar, not 5 MPa
    shape = stiff.shape(0, int(stiff.modes["mode"].iloc[0]))
    assert ("layer", "stress_stiffening") in shape.interfaces
    assert sum(shape.interfaces.values()) == pytest.approx(shape.energies["interfaces"], abs=1e-9)
    assert sum(s.growth_rate for s in shape.sources) == pytest.approx(shape.growth_rate, rel=1e-6)
    assert command("inspect", str(tmp_path / "stiff" / "blocks.toml")) in (0, 1)
