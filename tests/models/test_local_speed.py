"""Contact points that slide at speeds of their own: a disc that turns, forward and in reverse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from conftest import COARSE, NOMINAL, build_model
from motions import run_one
from scipy.integrate import solve_ivp
from shared_kernels import OF_COMPARED_INTEGRATORS, OF_THE_HYBRID_MODEL

from squealstudy.errors import ModelError, ParameterError
from squealstudy.laboratory.integrators.alpha_methods import GeneralisedAlpha
from squealstudy.laws import FrictionLaw, contact_law, friction_curve
from squealstudy.models.assembly import Assembly, Component, ContactInterface
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.modes.point import linearised_point, solve_point
from squealstudy.modes.sensitivity.reduced import ModeChoice, point_sensitivities, solve_families
from squealstudy.modes.sensitivity.state_derivatives import StateParameter
from squealstudy.motion.growing_modes import GrowingModes
from squealstudy.motion.hybrid_run import simulate_hybrid
from squealstudy.motion.integrators.newmark import Newmark, NewmarkNewton
from squealstudy.motion.point import friction_law, motion_point
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.shared_modes import shared_modes
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.hybrid import HybridSettings, hybrid_model
from squealstudy.reduction.prepared import prepare
from squealstudy.system.contact_weights import contact_weights

MU, RATIO, DECAY = 0.35, 1.6, 0.4
LAW = contact_law("exponential", p0=1e5, lam=1e5)
AREA, FACTOR = np.array([1e-4, 2e-4]), np.array([0.6, 1.3])
MASS = np.array([0.5, 0.4, 0.3, 0.6])
ROWS = np.array(
    [
        [[0.0, 1.0, 0.1, 0.0], [0.2, 0.0, 1.0, 0.1]],  # gap
        [[1.0, 0.0, 0.3, 0.1], [0.7, 0.2, 0.0, 0.4]],  # along the sliding direction
        [[0.1, 0.2, 0.0, 1.0], [0.0, 0.1, 0.3, 0.9]],  # across it
    ]
)
K = np.array(
    [
        [3e6, -8e5, 2e5, 1e5],
        [-8e5, 2e6, -3e5, 2e5],
        [2e5, -3e5, 2.5e6, -4e5],
        [1e5, 2e5, -4e5, 3.5e6],
    ]
)
LOAD = np.array([0.0, -1e-4, -2e-4, 0.0])
EVERYTHING = ReductionSettings(1e6, 1e6, 0.0)
BAND = (1.0, 1e6)


def assembly(factor=FACTOR, frictional=(1.0, 1.0)):
    """Four degrees of freedom under two contact points."""
    body = Component("body", sp.diags(MASS).tocsr(), sp.csr_matrix((4, 4)))
    stiffness, shapes = la.eigh(K)
    rows = [sp.csr_matrix(part) for part in ROWS]
    contact = ContactInterface(
        *rows,
        area=AREA,
        gap0=np.zeros(2),
        radius=0.1 * np.asarray(factor),
        law=LAW,
        frictional=np.array(frictional),
        speed_factor=np.asarray(factor),
    )
    springs = SpringInterface("springs", sp.csr_matrix(shapes.T), stiffness)
    return Assembly((body,), contact, (springs,), LOAD, np.zeros(4))


def operating(speed, pressure=1e6):
    curve = friction_curve(static_ratio=RATIO, decay_speed=DECAY)
    return OperatingPoint(MU, pressure, speed, LAW, curve)


def coefficient(s):
    """mu(s) and its slope, written once more."""
    fall = (RATIO - 1) * np.exp(-s / DECAY)
    return MU * (1 + fall), -MU * fall / DECAY


def pressure(g):
    return 1e5 * np.exp(-1e5 * g)


def by_hand(speed):
    """Displacements, pressures, C and K of steady sliding, each point at its own speed."""
    N, T, P = ROWS
    v = speed * FACTOR
    mu, slope = coefficient(np.abs(v))

    grip = np.sign(v) * mu
    q = np.zeros(4)
    for _ in range(60):
        force = AREA * pressure(N @ q)
        stiffness = K + (N - grip[:, None] * T).T @ np.diag(1e5 * force) @ N
        step = la.solve(stiffness, 1e6 * LOAD + (N - grip[:, None] * T).T @ force - K @ q)
        q = q + step * min(1.0, 1e-5 / np.abs(N @ step).max())
    p = pressure(N @ q)
    damping = P.T @ np.diag(mu * AREA * p / np.abs(v)) @ P + T.T @ np.diag(slope * AREA * p) @ T
    return q, p, damping, stiffness


def roots_by_hand(damping, stiffness):
    own = np.diag(1 / MASS)
    lam = la.eigvals(np.block([[np.zeros((4, 4)), np.eye(4)], [-own @ stiffness, -own @ damping]]))
    return np.sort_complex(lam[lam.imag > 0])


@pytest.mark.parametrize("speed", [0.5, -0.5])
def test_working_point_and_roots_by_hand(speed):
    """Friction falls with the speed of the point: one slides at 0.3 m/s, the other at 0.65."""
    prepared = prepare(assembly(), operating(speed), EVERYTHING)
    state = DesignState(operating(speed))
    point, system = linearised_point(prepared, state)
    q, p, damping, stiffness = by_hand(speed)
    np.testing.assert_allclose(point.gap, ROWS[0] @ q, rtol=1e-9)
    np.testing.assert_allclose(point.contact_pressure, p, rtol=1e-9)
    mu, slope = coefficient(abs(speed) * FACTOR)
    np.testing.assert_allclose(system.weights.across, mu * AREA * p / (0.5 * FACTOR), rtol=1e-9)
    np.testing.assert_allclose(system.weights.along, slope * AREA * p, rtol=1e-9)
    found = solve_point(prepared, state, BAND)
    np.testing.assert_allclose(
        np.sort_complex(found.lam), roots_by_hand(damping, stiffness), rtol=1e-9
    )


def test_reverse_turns_friction_alone():
    """The same brake the other way round: T changes its sign, nothing else."""
    turned = replace(assembly().contact, T=sp.csr_matrix(-ROWS[1]))
    mirrored = replace(assembly(), contact=turned)
    forward = prepare(mirrored, operating(0.5), EVERYTHING)
    reverse = prepare(assembly(), operating(-0.5), EVERYTHING)
    one = solve_point(forward, DesignState(operating(0.5)), BAND)
    other = solve_point(reverse, DesignState(operating(-0.5)), BAND)
    np.testing.assert_allclose(np.sort_complex(one.lam), np.sort_complex(other.lam), rtol=1e-12)


@pytest.mark.parametrize("speed", [0.5, -0.5])
@pytest.mark.parametrize(
    "name", ["sliding_speed", "friction", "pressure", "friction_law.decay_speed"]
)
def test_sensitivities_against_differences(speed, name):
    prepared = prepare(assembly(), operating(speed), EVERYTHING)
    state = DesignState(operating(speed))
    parameter = StateParameter(name)
    design = solve_families(prepared, state, BAND, ModeChoice(count=4))
    modes = point_sensitivities(design, [parameter], 0.01, 1e6)
    assert len(modes) == 4
    value = parameter.value(state)
    h = 1e-5 * abs(value)
    ends = [solve_point(prepared, parameter.moved(state, value + s * h), BAND) for s in (1, -1)]
    for mode in modes:
        up, down = (end.lam[np.argmin(abs(end.lam - mode.lam))] for end in ends)
        assert mode.sensitivities[0].derivative == pytest.approx(
            (up - down) / (2 * h), rel=1e-5, abs=1e-7 * abs(mode.lam) / abs(value)
        )


def test_curves_without_slopes_have_those_of_differences():
    """Each point by its own speed, as where a curve gives its slopes."""
    point, p = operating(0.5), np.array([1e6, 2e6])
    rows = point.friction_slopes(p, FACTOR)
    h = 1e-6
    names = ("sliding_speed", "friction", "friction_law.static_ratio")
    for row, name in zip(rows[[0, 2, 3]], names, strict=True):
        moved = (point.with_value(name, point.value(name) + s * h) for s in (1, -1))
        up, down = (m.friction_at(p, FACTOR) for m in moved)
        np.testing.assert_allclose(row[0], (up.mu - down.mu) / (2 * h), rtol=1e-7)
        np.testing.assert_allclose(row[1], (up.by_speed - down.by_speed) / (2 * h), rtol=1e-7)


# -- in time -------------------------------------------------------------------------------------
STEP, DURATION = 1e-6, 4e-3
K_T = 1e9  # N s/m3, of a tanh that is the bound where a point slides


def accelerations(speed, q0):
    """q'' about steady sliding at q0, by the equations of motion as they stand in a textbook."""
    N, T, P = ROWS

    def rate(_, y):
        q, v = y[:4], y[4:]
        p = pressure(N @ (q0 + q))
        w = np.stack([speed * FACTOR + T @ v, P @ v])
        s = np.linalg.norm(w, axis=0)
        bound = coefficient(s)[0] * p
        t = -AREA * bound * np.tanh(K_T * s / bound) * w / s
        force = 1e6 * LOAD - K @ (q0 + q) + N.T @ (AREA * p) + T.T @ t[0] + P.T @ t[1]
        return np.concatenate([v, force / MASS])

    return rate


def designs(speed):
    """Shared modes, the design point on them and its working point."""
    whole = assembly()
    prepared = prepare(whole, operating(speed), EVERYTHING)
    state = DesignState(operating(speed))
    point, _ = linearised_point(prepared, state)
    reference = shared_modes(prepared.model, point, state)
    friction = FrictionLaw(MU, K_T, operating(speed).curve, "smooth")
    design = motion_point(reference, point, state, friction, BAND, 1e-9)
    return whole, reference, design, point


WAYS = [
    "modal",
    pytest.param("alpha", marks=OF_COMPARED_INTEGRATORS),
    pytest.param("hybrid", marks=OF_THE_HYBRID_MODEL),
]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("speed", [0.5, -0.5])
def test_motions_against_an_integration_of_the_textbook_equations(speed, way):
    """The modal kernels, a batch, an alpha method and the hybrid model."""
    whole, reference, design, point = designs(speed)
    q_steady = by_hand(speed)[0]
    v0 = np.array([0.05, -0.02, 0.03, 0.04])
    rate = accelerations(speed, q_steady)
    assert np.abs(rate(0.0, np.zeros(8))).max() < 1e-4
    y0, steps = np.concatenate([0 * v0, v0]), {"first_step": 1e-7, "max_step": 1e-5}
    exact = solve_ivp(rate, (0, DURATION), y0, "DOP853", rtol=1e-11, atol=1e-13, **steps).y[:, -1]
    size = np.abs(exact[4:]).max()
    observed = ROWS[1] @ exact[4:]
    settings = MotionSettings(DURATION, STEP, 10, tolerance=1e-9)
    start = la.lstsq(
        np.vstack([reference.system.N, reference.system.T1, reference.system.T2]),
        np.concatenate(ROWS @ v0),
    )[0]
    alpha = (GeneralisedAlpha(rho_inf=1.0),)
    for method in {"modal": (Newmark(), NewmarkNewton()), "alpha": alpha}.get(way, ()):
        own = replace(settings, integrator=method)
        run = run_one(reference.system, design, own, np.zeros(4), start)
        assert run.outcome == "ok"
        np.testing.assert_allclose(reference.system.T1 @ run.v, observed, atol=1e-4 * size)
        assert abs(run.energy.relative) < 1e-4
    if way != "hybrid":
        return
    model = hybrid_model(whole, point, operating(speed), HybridSettings(1e6, 1e6))
    hybrid = replace(design, c=np.zeros(len(model.omega)), d=None, s=None, growing=GrowingModes())
    q0, w0 = np.zeros(model.n), model.basis.restrict(v0)
    run = simulate_hybrid(model, replace(hybrid, q0=q0, v0=w0), settings)
    assert run.outcome == "ok"
    np.testing.assert_allclose(model.T @ run.v, observed, atol=1e-4 * size)
    assert abs(run.energy.relative) < 1e-4
    assert run.history["torque"][0] > 0  # it brakes, whichever way


def test_friction_must_saturate_where_sliding_is_slowest():
    _, reference, _, point = designs(0.5)
    state, contact = DesignState(operating(0.5)), reference.system
    mu, _ = coefficient(0.5 * FACTOR)
    least = float((mu * point.contact_pressure / (0.5 * FACTOR)).max())
    friction_law(contact, state, point, 1.001 * least, 0.0, "regularised")
    with pytest.raises(ParameterError, match="at least"):
        friction_law(contact, state, point, 0.999 * least, 0.0, "regularised")


# -- contact without friction --------------------------------------------------------------------
HOLD = 3e6  # N/m, along and across, where a point is stuck


def mixed(stuck):
    """Friction at the first point alone; the second has no sliding direction, or is held."""
    kept = sp.diags([1.0, 0.0]).tocsr()
    whole = assembly(factor=(0.6, 0.0), frictional=(1.0, 0.0))
    contact = replace(whole.contact, T=kept @ whole.contact.T, T_perp=kept @ whole.contact.T_perp)
    layer = SpringInterface("stuck", sp.csr_matrix(ROWS[1:, 1]), np.full(2, HOLD * stuck))
    return replace(whole, contact=contact, springs=(*whole.springs, layer))


@pytest.mark.parametrize("hybrid", [False, pytest.param(True, marks=OF_THE_HYBRID_MODEL)])
@pytest.mark.parametrize("stuck", [0.0, 1.0])
def test_frictionless_and_stuck_contact_in_frequency_and_in_time(stuck, hybrid):
    state = DesignState(operating(0.5))
    whole = mixed(stuck)
    prepared = prepare(whole, state.operating, EVERYTHING)
    point, system = linearised_point(prepared, state)
    N, T, P = ROWS
    held = K + HOLD * stuck * ROWS[1:, 1].T @ ROWS[1:, 1]
    (p1, p2), (mu, slope) = point.contact_pressure, coefficient(0.5 * 0.6)
    force = AREA * point.contact_pressure
    q = la.solve(held, 1e6 * LOAD + N.T @ force - mu * force[0] * T[0])
    np.testing.assert_allclose(point.gap, N @ q, rtol=1e-8)
    stiffness = held + N.T @ np.diag(1e5 * force) @ N
    stiffness -= mu * 1e5 * force[0] * np.outer(T[0], N[0])
    damping = mu * force[0] / 0.3 * np.outer(P[0], P[0]) + slope * force[0] * np.outer(T[0], T[0])
    found = solve_point(prepared, state, BAND)
    np.testing.assert_allclose(
        np.sort_complex(found.lam), roots_by_hand(damping, stiffness), rtol=1e-9
    )
    assert (system.weights.across[1], system.weights.coupling[1]) == (0.0, 0.0)

    reference = shared_modes(prepared.model, point, state)
    friction = friction_law(reference.system, state, point, 0.0, 1e-3, "regularised")
    slowest = float(coefficient(0.0)[0] * p1 / 1e-3)
    assert friction.k_t == pytest.approx(slowest, rel=1e-12)  # p2 is the larger one, not rubbed
    assert p2 > p1
    design = motion_point(reference, point, state, friction, BAND, 1e-9)
    settings = MotionSettings(1e-4, STEP, 10, tolerance=1e-9)
    v0 = np.linalg.lstsq(
        np.vstack([reference.system.N, reference.system.T1[:1], reference.system.T2[:1]]),
        1e-6 * np.ones(4),
    )[0]
    run = run_one(reference.system, design, settings, np.zeros(4), v0)
    assert run.outcome == "ok"
    assert (run.history["slip"] == 1.0).all()
    np.testing.assert_allclose(run.history["normal_force"], force[0], rtol=1e-2)
    np.testing.assert_allclose(run.history["torque"], 0.06 * mu * force[0], rtol=1e-2)
    if not hybrid:
        return
    model = hybrid_model(whole, point, state.operating, HybridSettings(1e6, 1e6))
    design = replace(design, c=np.zeros(len(model.omega)), d=None, s=None, growing=GrowingModes())
    other = simulate_hybrid(model, replace(design, q0=np.zeros(4), v0=np.zeros(4)), settings)
    assert other.outcome == "ok"
    assert (other.history["slip"] == 1.0).all()


# -- the generated brake -------------------------------------------------------------------------
@pytest.mark.usefixtures("meshed_as_brake")
def test_a_turning_disc_changes_the_damping_across_alone(brake):
    """Constant friction: forces and coupling are the same, mu A p / s has each point's speed."""
    turning = build_model("disc_brake", COARSE | {"kinematics": "rotation"}).contact
    uniform = brake.assembly.contact
    assert (uniform.speed_factor == 1.0).all()
    for name in ("N", "T", "T_perp"):
        assert (getattr(turning, name) != getattr(uniform, name)).nnz == 0
    r = turning.radius
    mean = (turning.area @ r) / turning.area.sum()
    np.testing.assert_allclose(turning.speed_factor, r / mean, rtol=2e-4)
    assert 0.78 < turning.speed_factor.min() < 0.83
    assert 1.15 < turning.speed_factor.max() < 1.2
    one, other = (contact_weights(c, brake.point, NOMINAL) for c in (uniform, turning))
    for name in ("normal", "coupling", "along"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_allclose(other.across, one.across / turning.speed_factor, rtol=1e-14)


def test_speed_factors_are_checked():
    with pytest.raises(ModelError, match="speed_factor"):
        assembly(factor=(1.0, 0.0))
    with pytest.raises(ModelError, match="speed_factor"):
        replace(assembly().contact, speed_factor=np.ones(3))
