"""Errors of the reduction: a finer model against full order, carried between points, enriched."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
import scipy.sparse as sp
from chunk_rows import drifting_modes, grid, random_modes, write_chunks
from conftest import full_order
from study_runs import plan_of
from study_texts import study_text, sweep_text

from squealstudy.engine.cache import load_prepared, save_prepared
from squealstudy.engine.store import Store
from squealstudy.engine.workers import Workers
from squealstudy.kinds.complex_modes import reduction_errors as reduction
from squealstudy.kinds.complex_modes.error_text import full_order_error_text, percent_or_times
from squealstudy.kinds.complex_modes.errors import mode_errors, widening
from squealstudy.kinds.complex_modes.kind import ComplexModes
from squealstudy.kinds.complex_modes.reduction_errors import (
    CARRIED_SAFETY_FACTOR,
    ReductionErrors,
    carried,
)
from squealstudy.kinds.complex_modes.rows import read_columns
from squealstudy.kinds.complex_modes.tables import build_tables
from squealstudy.laws import contact_law, friction_curve
from squealstudy.linalg import factor as factors
from squealstudy.linalg.factor import solve_threads
from squealstudy.models.assembly import Assembly, Component, ContactInterface
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.modes import point as point_module
from squealstudy.modes.full_order import finer_model
from squealstudy.modes.full_order.finer_model import (
    FINER_MODEL_SAFETY_FACTOR,
    ReductionRecord,
    reduction_errors,
    with_finer_model,
)
from squealstudy.modes.full_order.modes import full_order_system
from squealstudy.modes.judged_roots import uncertain_roots
from squealstudy.modes.point import solve_point, state_working_point, working_point_error
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.prepared import prepare_with_basis
from squealstudy.reduction.working_point import working_point_result
from squealstudy.root_pairs import partner_distances
from squealstudy.system.contact_weights import contact_weights
from squealstudy.system.linearise import component_frequencies

NODES = 40
BAND = (50.0, 600.0)
TOP = BAND[1]
CUTOFF = 1.2 * TOP
NOMINAL = OperatingPoint(0.4, 1e5, 0.5, contact_law())


def bar(name: str, stiffness: tuple[float, float, float], mass: float) -> Component:
    """A chain of nodes in three directions; its shear turns motion across into motion along."""
    line = sp.diags([-np.ones(NODES - 1), np.ones(NODES - 1)], [0, 1], (NODES - 1, NODES))
    D = np.diag(stiffness)
    D[0, 2] = D[2, 0] = 0.3 * np.sqrt(stiffness[0] * stiffness[2])
    K = sp.kron(line.T @ line, D).tocsr()
    M = (mass / NODES) * sp.identity(3 * NODES, format="csr")
    return Component(name, M, K)


def two_bars() -> Assembly:
    """Two bars pressed on each other, each on springs to ground."""
    disc, pad = bar("disc", (4e6, 6e6, 3e6), 2.0), bar("pad", (2e6, 3e6, 1e6), 0.7)
    n = 3 * NODES

    def relative(direction: int) -> sp.csr_matrix:
        chosen = np.arange(direction, n, 3)
        rows = sp.csr_matrix((np.ones(NODES), (np.arange(NODES), chosen)), shape=(NODES, n))
        return sp.hstack([-rows, rows]).tocsr()

    T, T_perp, N = (relative(d) for d in range(3))
    contact = ContactInterface(
        N,
        T,
        T_perp,
        np.full(NODES, 2e-5),
        np.zeros(NODES),
        np.full(NODES, 0.1),
        contact_law(),
        np.ones(NODES),
    )
    held = np.concatenate([np.arange(0, 6), np.arange(2 * n - 12, 2 * n)])
    B = sp.csr_matrix((np.ones(len(held)), (np.arange(len(held)), held)), shape=(len(held), 2 * n))
    load = np.zeros(2 * n)
    load[n + 2 :: 3] = -2e-5 * np.linspace(0.5, 1.5, NODES)
    springs = (SpringInterface("ground", B, np.full(len(held), 2e5)),)
    return Assembly((disc, pad), contact, springs, load, np.zeros(2 * n))


@pytest.fixture(scope="module")
def bars():
    """The assembly, a coarse reduction of it with its finer model, and that enriched."""
    assembly = two_bars()
    settings = ReductionSettings(CUTOFF, CUTOFF, 0.0, 1e-3)
    prepared, modes, basis = prepare_with_basis(assembly, NOMINAL, settings)
    made = ReductionRecord(assembly, modes, (NOMINAL,), TOP, CUTOFF)
    plain, once, twice = (with_finer_model(prepared, basis, made, n)[0] for n in range(3))
    assert plain.model.n < once.model.n < plain.finer.n < twice.model.n
    return assembly, modes, plain, once


@pytest.mark.parametrize("left", [False, True])
def test_residual_loads_are_those_of_the_unreduced_matrices(left):
    """Sums in reduced coordinates, against each load by the full-order matrices."""
    assembly = two_bars()
    prepared, modes, basis = prepare_with_basis(
        assembly, NOMINAL, ReductionSettings(CUTOFF, CUTOFF, 0.0, 1e-3)
    )
    state = DesignState(replace(NOMINAL, curve=friction_curve(static_ratio=1.4)), {("pad", 9): 0.8})
    point = state_working_point(prepared, state)
    rng = np.random.default_rng(1)
    x = rng.standard_normal((prepared.model.n, 4, 2)) @ np.array([1.0, 1.0j])
    lam = 1e4 * rng.standard_normal((4, 2)) @ np.array([0.1, 1.0j])
    mixed = rng.standard_normal((8, finer_model.DIRECTIONS))
    sums = finer_model._ResidualSums(prepared.model)
    contact = contact_weights(prepared.model, point, state.operating)
    assert contact.along.any()
    sums.add([finer_model._mixed(x * lam**k, mixed) for k in range(3)], contact, left)
    changes = state.stiffness_changes(component_frequencies(prepared.model))
    sums.add_changes(finer_model._mixed(x, mixed), changes)
    full = full_order_system(assembly, modes, point, state, CUTOFF)
    C, K = (full.C.T, full.K.T) if left else (full.C, full.K)
    psi = basis.expand(x)
    load = assembly.M @ (psi * lam**2) + C @ (psi * lam) + K @ psi
    twin = load.real @ mixed[:4] + load.imag @ mixed[4:]
    made = ReductionRecord(assembly, modes, (NOMINAL,), TOP, CUTOFF)
    np.testing.assert_allclose(sums.loads(basis, made), twin, atol=1e-9 * np.abs(twin).max())


def test_residual_loads_of_states_side_by_side_are_the_same_to_the_last_bit(monkeypatch):
    assembly = two_bars()
    prepared, modes, basis = prepare_with_basis(
        assembly, NOMINAL, ReductionSettings(CUTOFF, CUTOFF, 0.0, 1e-3)
    )
    others = [replace(NOMINAL, brake_pressure=f * NOMINAL.brake_pressure) for f in (0.5, 2.0, 4.0)]
    made = ReductionRecord(assembly, modes, (NOMINAL, *others), TOP, CUTOFF)
    loads, threads = [], set()
    solve = finer_model.dense_roots

    def recorded(*matrices):
        threads.add(threading.get_ident())
        return solve(*matrices)

    monkeypatch.setattr(finer_model, "dense_roots", recorded)
    monkeypatch.setattr(factors, "FEW_ROWS", 1)
    for count in (1, 2):
        threads.clear()
        with solve_threads(count):
            loads.append(finer_model.residual_loads(prepared, basis, made))
        assert len(threads) == count
    np.testing.assert_array_equal(*loads)


UNTRAINED = [
    DesignState(replace(NOMINAL, friction=0.25, brake_pressure=6e4)),
    DesignState(replace(NOMINAL, friction=0.6, brake_pressure=2e5)),
    DesignState(replace(NOMINAL, friction=0.5, law=contact_law(lam=1e6), sliding_speed=0.2)),
    DesignState(NOMINAL, {("pad", 9): 0.8}, {("disc", 8): 0.02}, stiffness_damping=1e-7),
    DesignState(replace(NOMINAL, friction=0.6), damping_ratio=0.02),
]


def true_errors(assembly, modes, prepared, state):
    """Roots of the reduced model and their distances to full-order ones; the latter's errors."""
    found = solve_point(prepared, state, BAND)
    wide = (0.98 * BAND[0], 1.02 * BAND[1])
    full = full_order(assembly, modes, found.working_point, state, wide, CUTOFF)
    return found.lam, partner_distances(found.lam, full.lam), full.error.max()


@pytest.mark.parametrize("state", UNTRAINED)
def test_the_finer_model_tells_the_error_against_full_order(bars, state):
    assembly, modes, prepared, _ = bars
    lam, true, round_off = true_errors(assembly, modes, prepared, state)
    same, error = reduction_errors(prepared, state, BAND)
    assert np.array_equal(lam, same)
    told = true > 100 * round_off
    assert told.sum() >= 20
    assert (true / np.abs(lam)).max() > 1e-6  # the basis is coarse: there is something to tell
    ratio = error[told] / true[told]
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1)
    assert (ratio > 1 / FINER_MODEL_SAFETY_FACTOR).mean() >= 0.95
    assert np.quantile(ratio, 0.9) < 2.0


def test_an_enriched_basis_is_within_a_tolerance_that_its_own_is_not(bars):
    assembly, modes, prepared, better = bars
    states = UNTRAINED[1:3]
    before, after = (
        max(
            (e / np.abs(lam)).max()
            for lam, e, _ in (true_errors(assembly, modes, model, s) for s in states)
        )
        for model in (prepared, better)
    )
    tolerance = 3e-5
    assert after < tolerance < before
    told = []
    for state in states:
        lam, error = reduction_errors(better, state, BAND)
        told.append((error / np.abs(lam)).max())
    assert 0.5 * after < max(told) < tolerance
    assert better.model.mode_counts == prepared.model.mode_counts
    for key in (("disc", 8), ("pad", 9)):  # parameters of component modes keep their coordinates
        first = prepared.model.k_el[prepared.model.mode_coordinate(*key)]
        assert better.model.k_el[better.model.mode_coordinate(*key)] == pytest.approx(first)


def test_a_basis_is_extended_up_to_completeness_and_no_further(monkeypatch):
    """Directions of round-off are none: the last steps find one or two left, or nothing."""
    monkeypatch.setattr(finer_model, "ENRICHING", 1e-12)
    assembly = two_bars()
    prepared, modes, basis = prepare_with_basis(
        assembly, NOMINAL, ReductionSettings(4 * CUTOFF, 4 * CUTOFF, 0.0, 1e-3)
    )
    made, sizes = ReductionRecord(assembly, modes, (NOMINAL,), TOP, np.inf), [0]
    while prepared.model.n > sizes[-1]:
        sizes.append(prepared.model.n)
        prepared, basis = with_finer_model(prepared, basis, made, 1)
        assert prepared.model.n <= assembly.n_dof
    lam, error = reduction_errors(prepared, UNTRAINED[1], BAND)
    assert (error < 1e-9 * np.abs(lam)).all()


def test_modes_beyond_the_cutoff_are_damped_alike_in_reduced_and_full_order_models():
    """A complete basis has the roots of the full order, whatever the cutoff of modal damping."""
    assembly = two_bars()
    settings = ReductionSettings(np.inf, np.inf, 0.0, 1e-3)
    prepared, modes, _ = prepare_with_basis(assembly, NOMINAL, settings)
    assert prepared.model.n == assembly.n_dof
    state = DesignState(replace(NOMINAL, friction=0.6), damping_ratio=0.05)
    roots = {}
    for cutoff in (0.5 * TOP, 1.5 * TOP, np.inf):
        damped = replace(prepared, model=replace(prepared.model, damped_to=2 * np.pi * cutoff))
        found = solve_point(damped, state, BAND)
        full = full_order(assembly, modes, found.working_point, state, BAND, cutoff)
        assert (partner_distances(found.lam, full.lam) < 1e-8 * np.abs(found.lam)).all()
        roots[cutoff] = full.lam
    far = partner_distances(roots[0.5 * TOP], roots[np.inf]) / np.abs(roots[0.5 * TOP])
    near = partner_distances(roots[1.5 * TOP], roots[np.inf]) / np.abs(roots[1.5 * TOP])
    assert far.max() > 1e-2 > 1e-3 > near.max()  # the coefficient of the band's own modes shows


def test_changed_component_modes_have_the_modal_damping_of_a_complete_basis():
    """Real modes with changed component modes are not sums of those without: they bend locally."""
    assembly = two_bars()
    settings = ReductionSettings(np.inf, np.inf, 0.0, 1e-3)
    prepared, modes, _ = prepare_with_basis(assembly, NOMINAL, settings)
    cutoff = 1.5 * TOP
    damped = replace(prepared, model=replace(prepared.model, damped_to=2 * np.pi * cutoff))
    scales = {("pad", 9): 0.7, ("disc", 8): 1.4}
    state = DesignState(replace(NOMINAL, friction=0.6), scales, damping_ratio=0.05)
    found = solve_point(damped, state, BAND)
    full = full_order(assembly, modes, found.working_point, state, BAND, cutoff)
    assert (partner_distances(found.lam, full.lam) / np.abs(found.lam)).max() < 1e-5


def test_a_prepared_model_is_read_back_with_its_finer_model(bars, tmp_path, monkeypatch):
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path))
    _, _, prepared, _ = bars
    save_prepared("with", prepared)
    save_prepared("without", replace(prepared, finer=None))
    assert load_prepared("without").finer is None
    for mine, theirs in zip(
        reduction_errors(prepared, UNTRAINED[0], BAND),
        reduction_errors(load_prepared("with"), UNTRAINED[0], BAND),
        strict=True,
    ):
        assert np.array_equal(mine, theirs)


# -- the working point


@pytest.mark.parametrize("state", UNTRAINED)
def test_the_contact_compliance_neglects_nothing_of_the_full_order_equilibrium(bars, state):
    """Displacements that the contact forces alone make balance the unreduced equations."""
    assembly, modes, prepared, _ = bars
    point = state_working_point(prepared, state)
    c, operating = assembly.contact, state.operating
    K = assembly.K_el + assembly.K_springs(static=True)
    for (name, j), scale in state.frequency_scale.items():
        span, mode = assembly.slices[name], modes[name]
        U = np.zeros(assembly.n_dof)
        U[span] = assembly.components[list(assembly.slices).index(name)].M @ mode.phi[:, j - 1]
        K = K + sp.csr_matrix(np.outer(U, U) * (scale**2 - 1) * mode.omega[j - 1] ** 2)
    normal = c.area * point.contact_pressure
    load = assembly.load * operating.brake_pressure + c.N.T @ normal
    load -= c.T.T @ (operating.friction * c.frictional * normal)
    q = sp.linalg.spsolve(K.tocsc(), load)
    gap = c.gap0 + c.N @ q
    assert np.abs(gap - point.gap).max() < 1e-9 * np.abs(point.gap).max()


def test_the_imbalance_of_a_working_point_bounds_what_it_moves_roots_by(bars):
    """Gaps that are off by far more than Newton leaves: the estimate is above the shift."""
    _, _, prepared, _ = bars
    state = DesignState(NOMINAL)
    exact = solve_point(prepared, state, BAND)
    point = exact.working_point
    rng = np.random.default_rng(2)
    off = 1e-10 * rng.standard_normal(len(point.gap))
    p, kappa = NOMINAL.law.evaluate(point.gap + off)
    moved = working_point_result(prepared.space.area, point.gap + off, p, kappa, 1, 1e-5, off)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(point_module, "state_working_point", lambda *_: moved)
        lam = solve_point(prepared, state, BAND).lam
    shift = partner_distances(exact.lam, lam)
    bound = working_point_error(moved, exact.lam)
    assert shift.max() > 1e-8 * np.abs(exact.lam).max()
    assert (shift <= bound).all()
    assert (working_point_error(point, exact.lam) < 1e-8 * np.abs(exact.lam)).all()


# -- carried between points


def test_a_sample_point_has_its_own_errors_and_others_lie_between():
    lam = np.array([1.0, 2.0, 3.0]) * 1j
    samples = [ReductionErrors(lam, np.array(e)) for e in ([1e-6, 1e-4, 1e-5], [1e-4, 1e-6, 1e-5])]
    distance = np.array([[0.0, 1.0], [0.5, 0.5], [0.9, 0.1]])
    point = np.repeat(np.arange(3), 3)
    found = carried(np.tile(lam, 3) * 1.001, point, distance, samples).reshape(3, 3)
    assert found[0] == pytest.approx([1e-6, 1e-4, 1e-5])
    assert found[1] == pytest.approx(CARRIED_SAFETY_FACTOR * np.array([1e-5, 1e-5, 1e-5]))
    assert (found[2, :2] > CARRIED_SAFETY_FACTOR * np.array([1e-5, 1e-6])).all()
    assert (found[2, :2] < CARRIED_SAFETY_FACTOR * np.array([1e-4, 1e-5])).all()


def test_missing_and_zero_errors_of_a_reduction(tmp_path, monkeypatch):
    """A complete basis has none: zero; a reduced one without any sample: not known."""
    plan = grid(3, 1)
    write_chunks(tmp_path, plan, drifting_modes(plan, 4))
    table = _tables(plan, tmp_path)
    assert (table["error_reduction"] == 0).all()
    monkeypatch.setattr(reduction, "has_mesh", lambda study: True)
    table = _tables(plan, tmp_path)
    assert table["error_reduction"].isna().all()
    assert table["error_estimate"].isna().all()


def _tables(plan, directory, samples=()):
    build_tables(plan, Store(directory), Workers(), samples)
    return pq.read_table(directory / "modes.parquet").to_pandas()


def test_errors_add_up_and_only_the_rungs_decides_on_status_and_sign(tmp_path, monkeypatch):
    """A reduction far beyond the tolerance: points stay ok, no mode is turned stable by it."""
    plan = grid(3, 1)
    modes = {i: random_modes(np.random.default_rng(i), 5) for i in range(3)}
    for one in modes.values():
        object.__setattr__(one, "error_rung", np.full(5, 0.01))
        one.lam.real[:] = [5.0, 1e5, -5.0, -1e5, 0.005]
    write_chunks(tmp_path, plan, modes)
    samples = [
        (i, ReductionErrors(m.lam, np.full(5, 10.0) / np.abs(m.lam))) for i, m in modes.items()
    ]
    monkeypatch.setattr(reduction, "has_mesh", lambda study: True)
    points, facts = build_tables(plan, Store(tmp_path), Workers(), samples)
    table = pq.read_table(tmp_path / "modes.parquet").to_pandas()
    assert table["error_reduction"].to_numpy() == pytest.approx(10.0)
    assert (table["error_estimate"] == table["error_rung"] + table["error_reduction"]).all()
    assert table["unstable"].tolist() == 3 * [True, True, False, False, False]
    names = ["uncertain", "unstable", "uncertain", "stable", "uncertain"]
    assert table["stability"].tolist() == 3 * names
    assert points["status"].tolist() == 3 * ["ok"]
    assert points["n_unstable"].tolist() == 3 * [2]
    assert points["n_unstable_low"].tolist() == 3 * [1]
    assert points["n_unstable_high"].tolist() == 3 * [4]
    assert facts["errors"]["largest_reduction"] > plan.method.tolerance / 100


def test_a_mode_is_uncertain_within_its_error_but_not_for_round_off():
    lam = np.array([1.0, -1.0, 1.0, 1e-9, -1.0]) + 1e3j
    error = np.array([1.0, 2.0, 0.5, 1e-8, np.nan])
    assert uncertain_roots(lam, error, 1e-7).tolist() == [True, True, False, False, True]
    assert uncertain_roots(lam, error, 0.0).tolist() == [True, True, False, True, True]


def reference_of(lam):
    return {"roots": [[x.real, x.imag] for x in lam], "root_errors": [1e-9] * len(lam)}


def test_full_order_solutions_widen_errors_and_never_narrow_them(tmp_path, monkeypatch):
    plan = grid(2, 1)
    modes = {i: random_modes(np.random.default_rng(i), 40) for i in range(2)}
    for one in modes.values():
        object.__setattr__(one, "error_rung", np.full(40, 1e-9))
    write_chunks(tmp_path, plan, modes)
    monkeypatch.setattr(reduction, "has_mesh", lambda study: True)
    columns = read_columns(Store(tmp_path), [t.point_id for t in plan.tasks], shapes=False)
    samples = [
        (i, ReductionErrors(m.lam, np.full(40, 1e-3) / np.abs(m.lam))) for i, m in modes.items()
    ]
    first = plan.tasks[0].point_id
    own = modes[0].lam
    for off, factor in ((1e-5, 1.0), (1e-3, 1.0), (7e-3, 7.0)):
        errors, facts = mode_errors(plan, columns, samples, {first: reference_of(own + off)})
        assert facts["reduction_widened"] == pytest.approx(factor, rel=1e-3)
        assert errors.reduction == pytest.approx(factor * 1e-3, rel=1e-3)
    below = {first: reference_of(own + 5e-8)}  # within 100 errors of the reference: no evidence
    assert widening(plan, columns, np.full(80, 1e-12), below) == 1.0


# -- enrichment

BRAKE = (
    study_text("b", "complex_modes", "disc_brake")
    + """\
mesh = "coarse"
"""
    + sweep_text("friction", 0.1, 0.5, 5)
    + """\
[modes]
band = [500.0, 4000.0]
"""
)


@pytest.mark.parametrize(("worst", "is_enriched"), [(2e-4, True), (5e-5, False)])
def test_a_study_enriches_its_basis_once_where_it_errs_by_more_than_the_tolerance(
    worst, is_enriched, monkeypatch
):
    plan = plan_of(BRAKE)
    heavy = ReductionErrors(np.array([-50.0 + 100.0j, 100.0j]), np.array([1.0, worst]))
    monkeypatch.setattr(reduction, "make_samples", lambda *_: [(0, heavy)])
    kind = ComplexModes()
    better = kind.accurate(plan, {}, Workers())
    assert better.enriched == is_enriched
    assert (better is plan) != is_enriched
    if is_enriched:
        ids = [{t.point_id for t in p.tasks} for p in (plan, better)]
        assert not ids[0] & ids[1]  # rows of the coarse basis are never taken for its own
        assert kind.accurate(better, {}, Workers()) is better


@pytest.mark.parametrize(
    ("section", "kind", "enriching"),
    [
        ("", "complex_modes", 1),
        ("[reduction]\ntolerance = 5e-5\n", "complex_modes", 1),  # smaller: not to lose others
        ("[reduction]\nresidual_responses = false\n", "complex_modes", 0),
        ("[reduction]\nenrichment = false\n", "complex_modes", 0),
        ("", "transient", 0),
        ("[reduction]\nresidual_responses = true\n", "transient", 1),
    ],
)
def test_which_bases_have_residual_responses(section, kind, enriching):
    text = BRAKE.replace("complex_modes", kind) + section
    plan = plan_of(text)
    assert plan.enriching == enriching
    assert (plan.judged_to_hz is None) == (kind == "transient" and not enriching)


def test_sample_points_are_spread_over_each_structure():
    text = BRAKE.replace("num = 5", "num = 41").replace(
        "[modes]", '[[sweep]]\nparameter = "disc.thickness"\nvalues = [0.011, 0.012]\n[modes]'
    )
    plan = plan_of(text)
    chosen = reduction.sample_points(plan)
    friction = plan.coordinates[chosen, 0].reshape(2, -1)
    assert friction.shape == (2, reduction.MIN_REDUCTION_SAMPLES)
    for own in friction:
        assert {0.1, 0.5} <= set(np.round(own, 9))
        assert np.diff(np.sort(own)).max() < 0.11


@pytest.mark.parametrize(
    ("factor", "text"),
    [
        (1.0, ""),
        (1.004, ""),
        (1.04, "by 4 %"),
        (1.9, "by 90 %"),
        (2.4, "to 2.4 times what that told"),
    ],
)
def test_what_full_order_adds_to_an_error_is_told_in_words(factor, text):
    assert percent_or_times(factor) == text


def test_what_an_audit_checked_is_not_called_unchecked():
    """Beside 'audit passed ... against full order' stood 'error not checked' against it."""
    audit = {"error": 1.9e-5, "against": "the full-order model", "points": [3, 5]}
    facts = {"model": "disc_brake", "reference": [], "fidelity": {"audit": audit}}
    told = "held against the full-order model by the audit alone ([modes] reference_points = 0)"
    assert full_order_error_text(facts) == told
    unaudited = facts | {"fidelity": {"audit": audit | {"error": None}}}
    assert full_order_error_text(unaudited).startswith("not checked against the full-order model")
