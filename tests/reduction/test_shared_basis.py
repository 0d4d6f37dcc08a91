"""One basis over a range of materials and springs: against reductions of each value."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from own_blocks import STUDY, write_blocks
from study_runs import load_plan, solved

from squealstudy.engine import reduced
from squealstudy.engine.mode_shapes import expansion
from squealstudy.engine.reduced import make_shared, reduced_with_basis, shared_facts
from squealstudy.engine.shared_range import SharedRange, shared_range
from squealstudy.engine.structures import build_task
from squealstudy.modes.full_order.finer_model import root_distances
from squealstudy.modes.point import solve_point
from squealstudy.reduction import shared_basis
from squealstudy.reduction.projected import projected
from squealstudy.study.definition import parse_study

VALUES = "[1.5e9, 1.6e9, 1.7e9, 1.9e9, 2.1e9, 2.2e9, 2.3e9, 2.5e9]"
SWEEP = '[[sweep]]\nparameter = "{}"\nvalues = {}\n\n[modes]'
BAND = (500.0, 40000.0)


def study(values=VALUES, *, name="lining.E3", more=""):
    text = STUDY.replace("60000.0", "40000.0").replace("[modes]", SWEEP.format(name, values))
    return text + more


@pytest.fixture(scope="module")
def blocks(tmp_path_factory):
    """The plan of eight linings at two frictions."""
    return load_plan(write_blocks(tmp_path_factory.mktemp("blocks"), study=study()))


def both(plan, key):
    """The task of a structure, its model by the shared basis and one of its own, with blocks."""
    task = build_task(plan, plan.structures[key], 1)
    return task, reduced_with_basis(task), reduced_with_basis(replace(task, shared=None))


def test_structures_are_those_of_their_own_reductions(blocks):
    key = list(blocks.structures)[2]
    task, (prepared, V), (own, _) = both(blocks, key)
    facts = shared_facts(blocks)["shared_basis"]
    assert facts["used"]
    assert 3 <= facts["reductions"] <= 7
    assert prepared.basis_error == facts["error"] <= shared_basis.TOLERANCE
    assert own.basis_error == 0.0
    state = task.point.state()
    assert root_distances(prepared, own, [state], BAND) < shared_basis.TOLERANCE
    both_modes = [solve_point(p, state, BAND) for p in (prepared, own)]
    one, other = (m.working_point for m in both_modes)
    size = other.contact_pressure.max()
    assert np.abs(one.contact_pressure - other.contact_pressure).max() < 1e-4 * size
    assert [len(m.lam) for m in both_modes] == [len(both_modes[0].lam)] * 2
    assembly = task.point.assembly()
    for block, part in zip(V, assembly.components, strict=True):  # coordinates of the same kind
        assert block.shape[0] == part.n_dof
        assert np.abs(block.T @ (part.M @ block) - np.eye(block.shape[1])).max() < 1e-8


def test_the_reason_of_the_method_denies_no_basis(tmp_path):
    """Nothing varies within a reduced model, and yet all of them are of one basis."""
    text = study().replace("values = [0.3, 0.6]", "values = [0.4]")
    plan = load_plan(write_blocks(tmp_path, study=text))
    assert plan.shared_range is not None
    assert plan.method.reason == "each reduced model has one point"


def test_the_error_is_told_and_covers_full_order(blocks, tmp_path):
    made = []
    with pytest.MonkeyPatch.context() as patch:
        original = reduced._reduced

        def counted(task, assembly, space):
            made.append(assembly.n_dof)
            return original(task, assembly, space)

        patch.setattr(reduced, "_reduced", counted)
        results = solved(blocks, tmp_path / "results")
    full = load_plan(blocks.study.source.path).tasks[0].assembly().n_dof
    assert made.count(full) < len(blocks.structures)
    modes = results.modes
    least = 2 * results.manifest["shared_basis"]["error"]
    size = 2 * np.pi * modes["frequency_hz"]
    assert (modes["error_reduction"] >= 0.99 * least * size).all()
    assert results.manifest["shared_basis"]["used"] is True


def test_a_range_that_no_basis_serves_is_reduced_value_by_value(tmp_path, monkeypatch):
    plan = load_plan(
        write_blocks(
            tmp_path, study=study("[1.51e9, 1.6e9, 1.7e9, 1.9e9, 2e9, 2.1e9, 2.3e9, 2.5e9]")
        )
    )
    monkeypatch.setattr(shared_basis, "TOLERANCE", 0.0)
    monkeypatch.setattr(SharedRange, "most", 3)
    _, (prepared, V), (_, own_V) = both(plan, list(plan.structures)[1])
    assert shared_facts(plan)["shared_basis"]["used"] is False
    assert prepared.basis_error == 0.0
    assert all(np.array_equal(a, b) for a, b in zip(V, own_V, strict=True))
    warnings = []
    monkeypatch.setattr(plan.kind, "make_missing_models", lambda plan, workers: {})
    monkeypatch.setattr(plan.kind, "accurate", lambda plan, failures, workers: plan)
    plan.kind.make_models(plan, None, warnings.append)
    assert "no basis of 3 reductions serves lining.E3 from 1.51 GPa to 2.5 GPa" in warnings[0]


@pytest.mark.parametrize(
    ("tests", "needed", "known"),
    [
        ([(5e-5, 9e-6)], 1, True),  # agrees with a reduction
        ([(1e-9, 2e-5)], 1, False),
        ([(1e-9, 2e-5)] * 2, 1, True),  # joins nothing twice, reductions are a little off
        ([(1e-9, 2e-5), (4e-5, 2e-5)], 1, False),
        ([(1e-9, 2e-4)] * 5, 1, False),  # far from reductions
        ([(4e-5, 9e-6), (4e-5, 2e-5)], 2, False),
        ([(4e-5, 2e-5), (4e-5, 9e-6), (4e-5, 9e-6)], 2, True),
        ([(4e-5, 2e-5)] + [(1e-9, 2e-5)] * 2, 2, False),
        ([(4e-5, 2e-5)] + [(1e-9, 2e-5)] * 3, 2, True),
    ],
)
def test_a_range_is_known_by_reductions_or_by_what_they_add(tests, needed, known):
    assert shared_basis.is_accurate(*reduced._worst(tests, needed)) is known


def test_the_range_is_part_of_the_identity(blocks, tmp_path):
    def keys(text):
        return set(load_plan(write_blocks(tmp_path, study=text)).structures)

    mine = set(blocks.structures)
    assert keys(study(VALUES.replace("1.9e9", "2.0e9"))) & mine  # in the same range
    assert not keys(study(VALUES.replace("1.5e9", "1.4e9"))) & mine
    alone = keys(study(more="\n[reduction]\nshared_basis = false\n"))
    assert not alone & mine
    assert keys(study("[1.7e9, 2.1e9]")) < alone  # too few for a basis of their own


def test_places_are_ends_first_and_positive_values_by_their_logarithms():
    found = SharedRange(("a",), (1.0,), (16.0,), ("",)).places()
    assert [place["a"] for place in found[:3]] == [16.0, 1.0, 4.0]
    both_ways = SharedRange(("a", "b"), (1.0, -1.0), (4.0, 1.0), ("", "m")).places()
    corners = {(p["a"], p["b"]) for p in both_ways[:4]}
    assert corners == {(4.0, 1.0), (1.0, -1.0), (4.0, -1.0), (1.0, 1.0)}
    many = SharedRange(tuple("abcdefghij"), (1.0,) * 10, (2.0,) * 10, ("",) * 10)
    assert len(many.places()) == many.most == 34
    assert all(many.holds(place) for place in many.places())
    assert not many.holds({**many.places()[0], "a": 2.5})


def test_a_spring_and_a_density_are_spanned_too(tmp_path):
    density = (
        "[parameters]",
        '[parameters]\n"rho" = {path = "slider.materials.LINING.rho", default = 2.5e-9}',
    )
    springs = study("[5e11, 1e12, 2e12, 3e12, 4e12, 5e12, 6e12, 8e12]", name="bed.normal")
    mass = '[[sweep]]\nparameter = "rho"\nvalues = [2000.0, 3000.0]\n\n[modes]'
    text = springs.replace("[modes]", mass)
    plan = load_plan(write_blocks(tmp_path, density, study=text))
    task, (prepared, _), (own, _) = both(plan, list(plan.structures)[5])
    assert prepared.basis_error > 0.0
    assert root_distances(prepared, own, [task.point.state()], BAND) < shared_basis.TOLERANCE


def test_shapes_lead_back_to_all_nodes(blocks):
    row = 5
    make_shared(build_task(blocks, blocks.tasks[row], 1))
    found = expansion(blocks, row, lambda *told: None)
    assembly = blocks.tasks[row].assembly()
    assert [len(b) for b in found.blocks] == [c.n_dof for c in assembly.components]
    rng = np.random.default_rng(0)
    x = rng.standard_normal(found.model.n)
    u = found.expand(x)
    assert u @ (assembly.M @ u) == pytest.approx(x @ x, rel=1e-8)
    assert u @ (assembly.K_el @ u) == pytest.approx(x @ (found.model.k_el * x), rel=1e-8)
    gaps = assembly.contact.N @ u
    assert np.abs(gaps - found.model.N @ x).max() < 1e-8 * np.abs(gaps).max()


def test_all_of_the_space_loses_nothing(blocks):
    assembly = blocks.tasks[0].assembly()
    small = projected(assembly, [np.eye(c.n_dof) for c in assembly.components])
    tangent = np.linspace(1.0, 2.0, assembly.contact.n_points)
    pairs = [
        (small.M, assembly.M),
        (small.K_el, assembly.K_el),
        (small.K_springs(), assembly.K_springs()),
        (small.K_springs(static=True), assembly.K_springs(static=True)),
        (small.K_contact(tangent), assembly.K_contact(tangent)),
        (small.contact.T, assembly.contact.T),
        (small.correspondence, assembly.correspondence),
    ]
    for A, B in pairs:
        assert np.abs(A - B).max() <= 1e-12 * np.abs(B).max()
    assert np.array_equal(small.load, assembly.load)


def test_assemblies_on_a_basis_are_kept_between_operating_points(monkeypatch):
    """Friction does not change them; of one more than there is room for the first is let go."""
    calls = []
    basis = SimpleNamespace(blocks=(), serves=lambda assembly: True)
    monkeypatch.setattr(reduced, "_loaded", lambda key: basis)
    monkeypatch.setattr(reduced, "_built", {})
    monkeypatch.setattr(reduced, "_entries", lambda assembly: reduced.MOST_ENTRIES // 2)
    monkeypatch.setattr(reduced, "projected", lambda a, blocks: SimpleNamespace(sparse=lambda: a))

    def made(values):
        calls.append(values["E"])
        return object()

    build = reduced.BuiltOnBasis(made, "key", ("E",))
    first = build({"E": 1.0, "friction": 0.1})
    assert build({"E": 1.0, "friction": 0.5}) is first
    assert reduced.BuiltOnBasis(made, "other", ("E",))({"E": 1.0}) is not first
    build({"E": 2.0, "friction": 0.5})
    build({"E": 1.0, "friction": 0.5})
    assert calls == [1.0, 1.0, 2.0, 1.0]


GENERATED = """\
[study]
name = "generated"
kind = "complex_modes"
[model]
name = "disc_brake"
mesh = "coarse"
contact_points = 2
"""


def swept(*names_and_ends):
    """The range of a study of the generated brake over such parameters, eight values each."""
    sweep = '[[sweep]]\nparameter = "{}"\nstart = {}\nstop = {}\nnum = 8\n'
    text = GENERATED + "".join(sweep.format(*one) for one in names_and_ends)
    return shared_range(parse_study(text, Path("generated.toml")), 8 ** len(names_and_ends))


def test_ranges_of_the_generated_brake_are_of_what_leaves_its_nodes():
    lining = ("pad.lining_young_modulus_z", 1.5e9, 2.5e9)
    thickness, angle = ("disc.thickness", 0.011, 0.013), ("pad.half_angle", 28.0, 32.0)
    assert swept(lining).names == (lining[0],)
    assert swept(lining).text == f"{lining[0]} from 1.5 GPa to 2.5 GPa"
    assert swept(lining, ("fingers.stiffness", 4e11, 6e11)).names[1] == "fingers.stiffness"
    assert swept(lining, ("friction", 0.3, 0.6)).names == (lining[0],)
    assert swept(lining, thickness) is swept(thickness) is swept(angle) is None
    assert swept(("friction", 0.3, 0.6)) is None


def test_a_basis_serves_no_other_contact_than_it_was_made_for(blocks):
    """Where one entry of a row of gaps is another, the rest equal."""
    key = next(iter(blocks.structures))
    task = build_task(blocks, blocks.structures[key], 1)
    reduced_with_basis(task)
    basis, assembly = reduced._shared_of(task, task.shared), task.point.assembly()
    assert basis.serves(assembly)
    N = assembly.contact.N.copy()
    N.data[0] *= 1.0 + 1e-9
    other = replace(assembly, contact=replace(assembly.contact, N=N))
    assert not basis.serves(other)
