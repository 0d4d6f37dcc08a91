"""The hybrid representation: its basis, and its time integration against modal runs and expm."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from blocks import NX, NZ, OPERATING, blocks
from conftest import CUTOFF, NOMINAL, TOP
from motions import run_one
from shared_kernels import OF_THE_HYBRID_MODEL

from squealstudy.errors import ModelError, ParameterError
from squealstudy.laws import FrictionLaw, contact_law
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.assembly import Assembly
from squealstudy.models.operating import DesignState
from squealstudy.motion.growing_modes import GrowingModes
from squealstudy.motion.hybrid_arrays import uniform_damping
from squealstudy.motion.hybrid_run import simulate_hybrid
from squealstudy.motion.integrators.newmark import Newmark, NewmarkNewton
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.shared_modes import shared_modes
from squealstudy.motion.system import ModalSystem, MotionPoint
from squealstudy.reduction.cmt import component_modes, momenta
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.hybrid import (
    HybridSettings,
    _cleaned,
    assembly_stiffness,
    explicit_dofs,
    hybrid_model,
    static_state,
)
from squealstudy.reduction.working_point import WorkingPoint, working_point

ZETA = 0.01


@dataclass(frozen=True)
class Case:
    """Two elastic blocks on each other: the brake's structure at 180 degrees of freedom."""

    assembly: Assembly
    point: WorkingPoint
    modes: tuple[np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def case():
    assembly = blocks()
    space = contact_space(assembly, 1e11, np.zeros((assembly.n_dof, 0)))
    point = working_point(space, OPERATING)
    modes = real_modes(assembly.M, assembly_stiffness(assembly, point), 1e9)
    return Case(assembly, point, modes)


def reduced_case(case, traces_hz, damping_hz=1e9, layers=1, **options):
    settings = HybridSettings(traces_hz, damping_hz, layers, **options)
    kept = case.modes[0] <= 2 * np.pi * traces_hz
    modes = (case.modes[0][kept], case.modes[1][:, kept])
    return hybrid_model(case.assembly, case.point, OPERATING, settings, modes=modes)


def friction_law(case, share=0.02):
    mu = OPERATING.friction
    k_t = mu * case.point.contact_pressure.max() / (share * OPERATING.sliding_speed)
    return FrictionLaw(mu, k_t)


def design_of(model, case, zeta=ZETA, **changes):
    c, beta = uniform_damping(model, zeta)
    speed = OPERATING.sliding_speed
    return replace(MotionPoint(OPERATING.law, friction_law(case), speed, c, beta=beta), **changes)


def as_modal(model, design):
    """The same model and damping in all its modes, for the modal kernel."""
    w2, phi = la.eigh(model.K.toarray(), model.M.toarray())
    c = design.beta * w2
    c[: len(design.c)] = design.c
    rows = (model.N @ phi, model.T @ phi, model.T_perp @ phi)
    points = (model.area, model.frictional, model.radius, model.gap, model.k_ref, model.force)
    system = ModalSystem(w2, *rows, *points, shapes=model.shapes @ phi)
    d = np.zeros(model.shapes.shape[0]) if design.d is None else design.d
    modal = MotionPoint(design.contact, design.friction, design.speed, c, d=d)
    return system, modal, phi


def run_hybrid(model, design, settings, q0, v0, *sensed):
    return simulate_hybrid(model, replace(design, q0=q0, v0=v0), settings, *sensed)


def run_modal(model, design, settings, q0, v0):
    system, modal, phi = as_modal(model, design)
    project = phi.T @ model.M
    result = run_one(system, modal, settings, project @ q0, project @ v0)
    return result, phi


def test_rounding_beside_a_diagonal_is_dropped():
    """Of its own size there: entries of stiff and of soft coordinates differ by decades."""
    A = np.array([[1e12, 1e-8, 1e-4], [1e-8, 1e-6, 0.0], [1e-4, 0.0, 1e12]])
    kept = _cleaned(sp.csr_matrix(A)).toarray()
    A[0, 2] = A[2, 0] = 0.0
    np.testing.assert_array_equal(kept, A)
    assert _cleaned(sp.csr_matrix(A * 1e-30)).nnz == 5


def test_rows_of_component_modes_see_their_own_mode_alone(case):
    """Those of one component, for motions of it: 1 for the mode itself."""
    modes = component_modes(case.assembly, 4e3)
    damped = {("lower", 8): modes["lower"], ("upper", 7): modes["upper"]}
    rows = momenta(case.assembly, modes, damped)
    for row, (name, number) in zip(rows, damped, strict=True):
        motion = np.zeros((case.assembly.n_dof, modes[name].phi.shape[1]))
        motion[case.assembly.slices[name]] = modes[name].phi
        expected = np.arange(1, motion.shape[1] + 1) == number
        np.testing.assert_allclose((row @ motion).ravel(), expected, atol=1e-9)
    for key in (("lower", 0), ("lower", 10_000), ("middle", 7)):
        with pytest.raises(ModelError, match="no mode"):
            momenta(case.assembly, modes, [key])


def test_explicit_layers(case):
    surface = explicit_dofs(case.assembly, 0)
    assert len(surface) == 2 * 3 * NX
    assert len(explicit_dofs(case.assembly, 1)) == 2 * len(surface)
    assert len(explicit_dofs(case.assembly, NZ)) == case.assembly.n_dof
    with pytest.raises(ModelError, match="layers"):
        explicit_dofs(case.assembly, -1)


def test_static_state_is_the_working_point(case):
    q = static_state(case.assembly, case.point, OPERATING)
    gap = case.assembly.contact.N @ q
    np.testing.assert_allclose(gap, case.point.gap, rtol=1e-8)
    basis = reduced_case(case, 1e3).basis  # of few modes, and of that state
    np.testing.assert_allclose(basis.expand(basis.restrict(q)), q, atol=1e-7 * np.abs(q).max())


@pytest.mark.parametrize("by_component", [True, False])
def test_states_to_the_basis_and_back(case, by_component):
    model = reduced_case(case, 4e3, by_component=by_component)
    basis = model.basis
    assert basis.n == model.n < case.assembly.n_dof
    kept = case.modes[0] <= 2 * np.pi * 4e3
    held = np.column_stack(
        [case.modes[1][:, kept], static_state(case.assembly, case.point, OPERATING)]
    )
    q = basis.restrict(held)
    np.testing.assert_allclose(basis.expand(q), held, atol=1e-6 * np.abs(held).max())
    any_state = np.random.default_rng(0).standard_normal(case.assembly.n_dof)
    again = basis.expand(basis.restrict(any_state))
    np.testing.assert_array_equal(again[basis.explicit], any_state[basis.explicit])
    c = case.assembly.contact
    np.testing.assert_allclose(model.N @ q, c.N @ basis.expand(q), atol=1e-12)
    n_modes = int(kept.sum())
    np.testing.assert_allclose(model.omega[:n_modes], case.modes[0][kept], rtol=1e-9)
    amplitude = np.abs(model.sensors[:n_modes] @ q[:, :n_modes])
    np.testing.assert_allclose(amplitude, np.eye(n_modes), atol=1e-6)


def test_modes_of_the_brake_are_exact(brake, brake_hybrid):
    model, omega = brake_hybrid
    assert len(omega) > 30
    np.testing.assert_allclose(model.omega[: len(omega)], omega, rtol=1e-9)
    for A in (model.M, model.K):
        assert abs(A - A.T).max() <= 1e-15 * abs(A).max()
    assert model.n < 0.26 * brake.assembly.n_dof  # one layer of cells of few


@pytest.mark.as_python
@OF_THE_HYBRID_MODEL
def test_the_working_point_stays_at_rest(case):
    model = reduced_case(case, 4e3)
    rest = np.zeros(model.n)
    result = run_hybrid(model, design_of(model, case), MotionSettings(1e-3, 1e-5), rest, rest)
    assert result.outcome == "ok"
    assert np.abs(result.v).max() < 1e-12
    assert result.solves == pytest.approx(1.0, abs=0.05)
    np.testing.assert_allclose(
        result.history["normal_force"], model.area @ case.point.contact_pressure, rtol=1e-12
    )


@OF_THE_HYBRID_MODEL
def test_second_order_against_expm(case):
    """Bilateral contact without friction is linear; rayleigh, modal and shape damping act."""
    damped = {("upper", 2): component_modes(case.assembly, 1e9)["upper"]}
    model = hybrid_model(
        case.assembly, case.point, OPERATING, HybridSettings(4e3, 3e3), damped, case.modes
    )
    law = contact_law("bilateral", stiffness=2e11)
    design = replace(
        design_of(model, case),
        contact=law,
        friction=FrictionLaw(0.0, 1.0),
        d=np.array([900.0]),
    )
    design = replace(
        design,
        gap=-np.ones(NX) * 1e-6,
        force=np.column_stack([model.area * 2e5, np.zeros((NX, 2))]),
    )
    k = model.area * 2e11 - model.k_ref
    K = (model.K + model.N.T @ sp.diags(k) @ model.N).toarray()
    U = model.M @ model.phi
    C = design.beta * model.K.toarray()
    C += (U * (design.c - design.beta * model.omega**2)) @ U.T
    C += 900.0 * (model.shapes.T @ model.shapes).toarray()
    minus = -la.inv(model.M.toarray())
    A = np.block([[np.zeros_like(K), np.eye(model.n)], [minus @ K, minus @ C]])
    v0 = model.phi[:, :6].sum(axis=1)
    exact = la.expm(A * 2e-3) @ np.concatenate([np.zeros(model.n), v0])
    steps = np.array([4e-5, 2e-5, 1e-5, 5e-6])
    errors = []
    for h in steps:
        r = run_hybrid(model, design, MotionSettings(2e-3, h, 0), np.zeros(model.n), v0)
        assert r.outcome == "ok"
        difference = r.v - exact[model.n :]
        errors.append(np.sqrt(difference @ (model.M @ difference)))
        assert abs(r.energy.relative) < 1e-5  # of the residuals at which steps were accepted
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(2.0, abs=0.15)
    assert errors[-1] < 0.02


@OF_THE_HYBRID_MODEL
@pytest.mark.parametrize(
    ("layers", "duration", "speed"),
    [(0, 4e-3, 0.4), (2, 4e-3, 0.4), pytest.param(0, 2e-4, -1.0, marks=pytest.mark.as_python)],
)
def test_stick_slip_and_lift_off_agree_with_the_modal_kernel(case, layers, duration, speed):
    """The same equations by another kernel: fixed-point iteration on all modes of the model."""
    damped = {("upper", 3): component_modes(case.assembly, 1e9)["upper"]}
    traces = (case.modes[0][:30], case.modes[1][:, :30])
    settings = HybridSettings(1e4, 2e3, layers)
    model = hybrid_model(case.assembly, case.point, OPERATING, settings, damped, traces)
    design = design_of(model, case, d=np.array([400.0]))
    v0 = speed * model.phi[:, :8].sum(axis=1) / np.abs(model.phi[:, :8].sum(axis=1)).max()
    run = MotionSettings(duration, 2e-6, 5, tolerance=1e-9)
    hybrid = run_hybrid(model, design, run, np.zeros(model.n), v0)
    modal, phi = run_modal(model, design, run, np.zeros(model.n), v0)
    assert hybrid.outcome == modal.outcome == "ok"
    assert modal.history["stick"].max() > 0.1
    assert modal.history["open"].max() > 0.1
    size = np.abs(phi @ modal.v).max()
    np.testing.assert_allclose(hybrid.v, phi @ modal.v, atol=1e-5 * size)
    for name in ("torque", "normal_force", "stored", "modal_energy", "dissipated_damping"):
        size = np.abs(modal.history[name]).max()
        np.testing.assert_allclose(hybrid.history[name], modal.history[name], atol=1e-4 * size)
    creep = hybrid.history["creep"], modal.history["creep"]
    assert creep[1].max() > 0
    assert np.isclose(*creep, rtol=1e-2).mean() > 0.95  # but where a point is at its bound
    assert abs(hybrid.energy.relative) < 1e-3
    assert hybrid.energy.friction == pytest.approx(modal.energy.friction, rel=1e-4)


@OF_THE_HYBRID_MODEL
@pytest.mark.parametrize("duration", [4e-3, pytest.param(2e-4, marks=pytest.mark.as_python)])
def test_default_tolerances_are_close(case, duration):
    """What a step does not solve for acts in the next one."""
    model = reduced_case(case, 4e3, damping_hz=3e3)
    design = design_of(model, case)
    shape = model.phi[:, :8].sum(axis=1)
    v0 = 0.1 * shape / np.abs(shape).max()
    run = MotionSettings(duration, 2e-6, 5, tolerance=1e-4)
    exact = run_hybrid(model, design, replace(run, tolerance=1e-10), np.zeros(model.n), v0)
    result = run_hybrid(model, design, run, np.zeros(model.n), v0)
    assert result.solves + result.columns < exact.solves + exact.columns
    size = np.abs(exact.v).max()
    np.testing.assert_allclose(result.v, exact.v, atol=1e-3 * size)
    assert abs(result.energy.relative) < 1e-3


@OF_THE_HYBRID_MODEL
def test_a_final_state_continues(case):
    model = reduced_case(case, 4e3)
    design = design_of(model, case)
    v0 = 1e-2 * model.phi[:, 3]
    run = MotionSettings(2e-3, 1e-5)
    whole = run_hybrid(model, design, run, np.zeros(model.n), v0)
    half = replace(run, duration=1e-3)
    first = run_hybrid(model, design, half, np.zeros(model.n), v0)
    second = run_hybrid(model, design, half, first.q, first.v)
    np.testing.assert_allclose(second.v, whole.v, atol=1e-3 * np.abs(whole.v).max())


@pytest.mark.as_python
@OF_THE_HYBRID_MODEL
def test_sensors_and_histories(case):
    model = reduced_case(case, 4e3, damping_hz=3e3)
    design = design_of(model, case)
    v0 = 1e-3 * model.phi[:, 2]
    run = MotionSettings(1e-4, 1e-5, 2, save_q=True)
    by_modes = run_hybrid(model, design, run, np.zeros(model.n), v0)
    by_some = run_hybrid(model, design, run, np.zeros(model.n), v0, np.array([3, 1]))
    assert by_modes.velocity.shape == (6, len(model.omega))
    assert by_modes.velocity[0, 2] == pytest.approx(1e-3)
    scale = np.abs(by_modes.displacement).max()
    np.testing.assert_array_equal(by_some.displacement, by_modes.displacement[:, [2, 0]])
    np.testing.assert_array_equal(by_some.velocity, by_modes.velocity[:, [2, 0]])
    watching = replace(design, growing=GrowingModes(sensors=model.sensors))
    rows = run_hybrid(model, watching, run, np.zeros(model.n), v0, np.array([1]))
    np.testing.assert_allclose(rows.displacement[:, 1:], by_modes.displacement, atol=1e-9 * scale)
    np.testing.assert_allclose(rows.velocity[:, 1:], by_modes.velocity, atol=1e-12)
    np.testing.assert_allclose(
        by_modes.q_history @ model.sensors.T, by_modes.displacement, atol=1e-9 * scale
    )
    np.testing.assert_allclose(by_modes.q_history[-1], by_modes.q)
    np.testing.assert_allclose(by_modes.history["time"], 2e-5 * np.arange(6))


@OF_THE_HYBRID_MODEL
def test_halving_and_failure_tell_time_and_reason(case):
    model = reduced_case(case, 4e3)
    design = design_of(model, case)
    v0 = 50.0 * model.phi[:, 5]
    run = MotionSettings(1e-3, 1e-4, 10, Newmark(max_halvings=2), max_iterations=1)
    failed = run_hybrid(model, design, run, np.zeros(model.n), v0)
    assert failed.outcome == "not_converged"
    assert "did not converge" in failed.message
    assert failed.halvings == 2
    assert failed.time < 1e-3
    assert np.isnan(failed.energy.stored_end)
    few = MotionSettings(2e-3, 1e-4, 10, Newmark(max_halvings=10), max_iterations=2)
    saved = run_hybrid(model, design, few, np.zeros(model.n), 1e-4 * v0)
    assert saved.outcome == "ok"
    assert saved.halvings > 0
    fine = run_hybrid(model, design, MotionSettings(2e-3, 1e-6), np.zeros(model.n), 1e-4 * v0)
    assert np.abs(saved.v - fine.v).max() < 0.1 * np.abs(fine.v).max()


@pytest.mark.as_python
@OF_THE_HYBRID_MODEL
@pytest.mark.parametrize("size", [1e150, 1e300])
def test_not_a_number_is_never_converged(case, size):
    model = reduced_case(case, 4e3)
    run = MotionSettings(1e-3, 1e-5)
    start = np.full(model.n, size)
    with np.errstate(all="ignore"):
        result = run_hybrid(model, design_of(model, case), run, start, start)
    assert result.outcome == "not_finite"
    assert result.time == 0.0


def test_input_is_checked(case):
    model = reduced_case(case, 4e3)
    design = design_of(model, case)
    run, rest = MotionSettings(1e-3, 1e-5), np.zeros(model.n)
    with pytest.raises(ParameterError, match="prewarp"):
        run_hybrid(model, design, replace(run, integrator=Newmark(prewarp=True)), rest, rest)
    with pytest.raises(ParameterError, match="integrator"):
        run_hybrid(model, design, replace(run, integrator=NewmarkNewton()), rest, rest)
    with pytest.raises(ModelError, match="initial state"):
        run_hybrid(model, design, run, rest, np.full(model.n, np.nan))
    with pytest.raises(ModelError, match="'c' needs"):
        run_hybrid(model, replace(design, c=np.zeros(2)), run, rest, rest)
    with pytest.raises(ModelError, match="'d' needs"):
        run_hybrid(model, replace(design, d=np.zeros(2)), run, rest, rest)
    with pytest.raises(ModelError, match="'gap'"):
        run_hybrid(model, replace(design, gap=np.zeros(2)), run, rest, rest)
    with pytest.raises(ModelError, match="not finite"):
        run_hybrid(model, replace(design, gap=np.full(NX, np.nan)), run, rest, rest)
    with pytest.raises(ModelError, match="not negative"):
        run_hybrid(model, replace(design, beta=-1.0), run, rest, rest)
    with pytest.raises(ModelError, match="'speed'"):
        run_hybrid(model, replace(design, speed=np.inf), run, rest, rest)
    with pytest.raises(ModelError, match="cutoffs"):
        HybridSettings(0.0, 1e3)
    free = component_modes(case.assembly, 1e9)["upper"]
    with pytest.raises(ModelError, match="no mode 0"):
        hybrid_model(
            case.assembly,
            case.point,
            OPERATING,
            HybridSettings(4e3, 4e3),
            {("upper", 0): free},
            case.modes,
        )


@pytest.fixture(scope="module")
def brake_hybrid(brake, reduced):
    """One layer about the contact of the coarse brake, and the modes its traces are made from."""
    basis = reduced[1]
    settings = HybridSettings(CUTOFF, CUTOFF)
    modes = (basis.omega, basis.phi)
    return hybrid_model(brake.assembly, brake.point, NOMINAL, settings, modes=modes), basis.omega


@OF_THE_HYBRID_MODEL
def test_growth_on_the_brake_is_that_of_the_modal_model(brake, reduced, brake_hybrid):
    zeta = 0.005
    state = DesignState(NOMINAL, damping_ratio=zeta)
    reference = shared_modes(reduced[0], brake.point, state)
    band = (2 * np.pi * 500.0, 2 * np.pi * TOP)
    lam, right = dense_roots(reference.C, reference.K, band)
    k = int(np.argmax(lam.real))
    psi = reduced[1].expand(reference.phi @ right[:, k])
    psi *= 1e-6 / np.abs(psi * lam[k]).max()
    model, _ = brake_hybrid
    speed = NOMINAL.sliding_speed
    friction = FrictionLaw(0.5, 0.5 * brake.point.contact_pressure.max() / (0.02 * speed))
    c, beta = uniform_damping(model, zeta)
    design = MotionPoint(NOMINAL.law, friction, speed, c, beta=beta)
    settings = MotionSettings(2e-3, 2e-6, 5, tolerance=1e-4)
    q0, v0 = model.basis.restrict(psi.real), model.basis.restrict((lam[k] * psi).real)
    result = run_hybrid(model, design, settings, q0, v0)
    assert result.outcome == "ok"
    growth = 0.5 * np.polyfit(result.history["time"], np.log(result.history["modal_energy"]), 1)[0]
    assert growth == pytest.approx(lam[k].real, rel=0.01)
    assert 1.0 <= result.solves <= 1.7
    assert abs(result.energy.relative) < 1e-3
