"""The Newmark kernels: laws, order, closed-form cases, and every implementation against another."""

from __future__ import annotations

import math
from dataclasses import replace

import newmark_reference as twin
import numpy as np
import pytest
import scipy.linalg as la
from motions import run_one as run
from motions import started
from scipy.integrate import solve_ivp
from shared_kernels import IN_SINGLE_PRECISION

from squealstudy.kernels import newmark_layout
from squealstudy.kernels.laws import N_LAW, friction_at, friction_tangent, law_row, mu_at
from squealstudy.laws import FrictionLaw, contact_law, friction_curve
from squealstudy.motion.integrator import integrator
from squealstudy.motion.integrators.newmark import Newmark, NewmarkNewton
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import (
    ModalSystem,
    MotionPoint,
    stick_number,
)

LAWS = [(kind, *mu) for mu in ((0.4, 0.4), (0.6, 0.3)) for kind in ("regularised", "smooth")]
P, K_T, V_MU = 1e6, 2e7, 0.3  # sticks below 0.02 m/s at mu 0.4


def row(kind, mu_s=0.4, mu_d=0.4, v_mu=V_MU):
    """Laws of a design with friction from mu_s to mu_d."""
    curve = friction_curve(static_ratio=mu_s / mu_d, decay_speed=v_mu)
    return law_row(contact_law(), FrictionLaw(mu_d, K_T, curve, kind))


@pytest.mark.parametrize(("kind", "mu_s", "mu_d"), LAWS)
@pytest.mark.parametrize("w", [(0.004, 0.003), (0.5, 0.0), (-0.1, 0.2), (0.03, -0.02)])
def test_friction_tangent_is_the_slope(kind, mu_s, mu_d, w):
    law = row(kind, mu_s, mu_d)

    def t(p, w1, w2):
        return np.array(friction_at(law, 1.0, p, w1, w2)[:2])

    h = 1e-7
    d11, d12, d22, s1, s2 = friction_tangent(law, 1.0, P, *w)
    along_1 = (t(P, w[0] + h, w[1]) - t(P, w[0] - h, w[1])) / (2 * h)
    along_2 = (t(P, w[0], w[1] + h) - t(P, w[0], w[1] - h)) / (2 * h)
    along_p = (t(P + 1, *w) - t(P - 1, *w)) / 2
    scale = np.abs([d11, d12, d22]).max()
    np.testing.assert_allclose([d11, d12], along_1, rtol=1e-5, atol=1e-6 * scale)
    np.testing.assert_allclose([d12, d22], along_2, rtol=1e-5, atol=1e-6 * scale)
    np.testing.assert_allclose([s1, s2], along_p, rtol=1e-5, atol=1e-8)


@pytest.mark.parametrize(
    ("kind", "w", "traction", "sticks"),
    [
        ("regularised", (0.006, 0.008), (-1.2e5, -1.6e5), True),
        ("regularised", (0.3, 0.4), (-2.4e5, -3.2e5), False),
        ("smooth", (0.06, 0.08), (-0.24e6 * math.tanh(5), -0.32e6 * math.tanh(5)), False),
        ("regularised", (0.0, 0.0), (0.0, 0.0), True),
        ("smooth", (0.0, 0.0), (0.0, 0.0), True),
    ],
)
def test_friction_closed_form(kind, w, traction, sticks):
    *t, stuck = friction_at(row(kind), 1.0, P, *w)
    assert t == pytest.approx(traction, rel=1e-14)
    assert stuck is sticks


def test_falling_friction_and_open_points():
    falling, kinked, smooth = row("smooth", 0.6, 0.3, 0.5), row("regularised"), row("smooth")
    assert mu_at(falling, 0.0, P) == pytest.approx((0.6, -0.6, 0.0))
    assert mu_at(falling, 0.5, P)[0] == pytest.approx(0.3 + 0.3 / math.e)
    assert friction_at(kinked, 1.0, 0.0, 1.0, 1.0) == (0.0, 0.0, False)
    assert friction_at(kinked, 1.0, -P, 1.0, 1.0) == (0.0, 0.0, False)
    assert np.isnan(friction_at(kinked, 1.0, np.nan, 1.0, 1.0)[0])
    assert np.isnan(friction_at(smooth, 1.0, P, np.nan, 1.0)[0])


def test_column_layout_is_what_the_names_say():
    columns = [v for k, v in vars(newmark_layout).items() if k.startswith(("POINT_", "LAW_"))]
    assert columns == [*range(16), *range(15)]
    assert len(row("smooth")) == N_LAW


def point_system(omega2, N, T, pressure_force=None, **changes):
    """A system with one contact point of unit area."""
    n = len(omega2)
    one, zero = np.ones(1), np.zeros(1)
    values = {
        "omega2": np.asarray(omega2, dtype=float),
        "N": np.reshape(N, (1, n)).astype(float),
        "T1": np.reshape(T, (1, n)).astype(float),
        "T2": np.zeros((1, n)),
        "area": one,
        "frictional": one,
        "radius": one,
        "gap": zero,
        "k_ref": zero,
        "force": np.zeros((1, 3)),
    }
    return ModalSystem(**(values | changes))


def constant_force(f):
    """With N = 0 the gap stays 0, and so the pressure p0."""
    return contact_law("exponential", p0=f, lam=1.0)


def linear_case():
    """Two modes with a bilateral contact, friction in the stick branch: linear."""
    w2, c = np.array([1e4, 6e4]), np.array([3.0, 8.0])
    N, T = np.array([1.0, 0.5]), np.array([0.3, -1.0])
    system = point_system(w2 + 0, N, T, shapes=np.array([[1.0, 1.0]]))
    law = contact_law("bilateral", stiffness=2e4)
    friction = FrictionLaw(1e6, 40.0)
    load = np.array([5.0, 1.0])
    system = replace(system, gap=np.array([-1.0]), force=np.array([[2e4, 0.0, 0.0]]))
    design = MotionPoint(law, friction, 0.0, c, load, np.array([4.0]), np.array([500.0]))
    between = np.array([[0.0, 2.0], [2.0, 0.0]])
    design = replace(design, damping_between=between)
    u = np.ones((2, 2))
    K = np.diag(w2) + 2e4 * np.outer(N, N) + 500 * u
    C = np.diag(c) + between + 40 * np.outer(T, T) + 4 * u
    return system, design, K, C, load


def test_second_order_against_expm():
    system, design, K, C, load = linear_case()
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -C]])
    rest = np.concatenate([np.linalg.solve(K, load), np.zeros(2)])
    start = np.array([0.01, -0.02, 1.0, 0.5])
    end = rest + la.expm(A * 0.08) @ (start - rest)
    steps = 0.08 / np.array([100, 200, 400, 800])
    errors = []
    for h in steps:
        settings = MotionSettings(0.08, h, 0, tolerance=1e-11)
        r = run(system, design, settings, start[:2], start[2:])
        assert r.outcome == "ok"
        errors.append(np.linalg.norm(np.concatenate([r.q * 200, r.v]) - end * [200, 200, 1, 1]))
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(2.0, abs=0.05)
    warped = MotionSettings(0.08, steps[1], 0, Newmark(prewarp=True))
    assert run(system, design, warped, start[:2], start[2:]).outcome == "ok"


def test_free_decay_of_a_damped_mode():
    w, zeta = 2 * np.pi * 1000, 0.01
    system = point_system([w * w], [0], [0])
    design = MotionPoint(constant_force(1.0), FrictionLaw(0, 1.0), 0, np.array([2 * zeta * w]))
    settings = MotionSettings(0.02, 1e-6, 1, Newmark(prewarp=True), save_q=True)
    r = run(system, design, settings, 1e-3, 0.0)
    t = r.history["time"]
    wd = w * math.sqrt(1 - zeta**2)
    phase = zeta * w / wd * np.sin(wd * t) + np.cos(wd * t)
    exact = 1e-3 * np.exp(-zeta * w * t) * phase
    assert np.abs(r.q_history[:, 0] - exact).max() < 1e-6 * 1e-3
    assert r.energy.damping == pytest.approx(r.energy.stored_start - r.energy.stored_end, rel=1e-3)


def coulomb_slider():
    system = point_system([1e4], [0], [1])
    return system, MotionPoint(constant_force(10.0), FrictionLaw(0.1, 4e5), 0.0, np.zeros(1))


@pytest.mark.parametrize("method", [Newmark(), NewmarkNewton()])
def test_coulomb_slider(method):
    system, design = coulomb_slider()
    settings = MotionSettings(0.2, 1e-5, 1, method, save_q=True)
    r = run(system, design, settings, 0.85e-3, 0.0)
    assert r.outcome == "ok"
    turning = np.interp(np.arange(1, 5) * np.pi / 100, r.history["time"], r.q_history[:, 0])
    np.testing.assert_allclose(turning, [-0.65e-3, 0.45e-3, -0.25e-3, 0.05e-3], rtol=1e-3)
    stuck = r.history["time"] > 4 * np.pi / 100 + 1e-3
    assert r.history["stick"][stuck].min() == 1.0
    assert np.interp(0.13, r.history["time"], r.q_history[:, 0]) == pytest.approx(5e-5, rel=1e-3)
    assert abs(r.energy.relative) < 1e-6


def belt(v_d, k_t=2e3):
    friction = FrictionLaw(0.5, k_t, friction_curve(static_ratio=2.0, decay_speed=0.5))
    system = point_system([1.0], [0], [1])
    return system, MotionPoint(constant_force(1.0), friction, -v_d, np.array([0.1]))


@pytest.mark.parametrize(("factor", "grows"), [(0.97, True), (1.03, False)])
def test_belt_oscillator_stability(factor, grows):
    v_d = factor * math.log(10) / 2
    system, design = belt(v_d)
    rest = 0.5 + 0.5 * math.exp(-v_d / 0.5)  # x of steady sliding
    r = run(system, design, MotionSettings(120, 0.01, 1, save_q=True), rest, 0.01)
    x = np.abs(r.q_history[:, 0] - rest)
    early, late = x[: len(x) // 4].max(), x[-len(x) // 4 :].max()
    assert (late > 1.1 * early) if grows else (late < 0.9 * early)
    rate = math.log(late / early) / 90
    assert rate == pytest.approx((0.5 / 0.5 * math.exp(-v_d / 0.5) - 0.1) / 2, rel=0.1)


def filippov_belt(v_d):
    """Limit cycle by DOP853 with events: slip phases, and stick until the spring tears loose."""

    def mu(s):
        return 0.5 + 0.5 * math.exp(-s / 0.5)

    def slip(t, y):
        return [y[1], -0.1 * y[1] - y[0] + mu(v_d - y[1])]

    def meets(t, y):
        return y[1] - v_d

    meets.terminal, meets.direction = True, 1
    tear = 1.0 - 0.1 * v_d  # spring + damper = static friction
    sol = solve_ivp(
        slip,
        (0, 100),
        [tear, v_d * (1 - 1e-9)],
        "DOP853",
        events=meets,
        rtol=1e-10,
        atol=1e-12,
        max_step=0.05,
        first_step=1e-4,
    )
    slip_time = sol.t_events[0][-1]
    stick_time = (tear - sol.y_events[0][-1][0]) / v_d
    return sol.y[0].max(), sol.y[0].min(), slip_time + stick_time


def test_belt_oscillator_limit_cycle():
    v_d = 0.5
    high, low, period = filippov_belt(v_d)
    system, design = belt(v_d, k_t=1e5)
    r = run(system, design, MotionSettings(60, 2e-3, 1, save_q=True), 1.2, 0.0)
    assert r.outcome == "ok"
    x, t = r.q_history[:, 0], r.history["time"]
    last = t > 30
    assert x[last].max() - x[last].min() == pytest.approx(high - low, rel=1e-3)
    middle = (high + low) / 2
    up = np.flatnonzero((x[:-1] < middle) & (x[1:] >= middle) & (t[1:] > 20))
    crossings = t[up] + (middle - x[up]) / (x[up + 1] - x[up]) * 2e-3
    assert np.diff(crossings).mean() == pytest.approx(period, rel=1e-3)
    assert abs(r.energy.relative) < 1e-3


@pytest.mark.parametrize(
    ("x", "low", "high"), [(0.5, 0.0, 1e-6), (1.25, 0.0, 1e-3), (2.5, 3e-3, 0.05)]
)
def test_energy_gain_of_an_impact_oscillator(x, low, high):
    # Hughes 1976: no gain for h omega_peak below 1.26, about 1 % at 2.5 (THEORY.md eq. (101))
    lam = 1e5
    system = point_system([1e4], [1], [0])
    law = contact_law("exponential", p0=1e-2, lam=lam)
    design = MotionPoint(law, FrictionLaw(0, 1.0), 0.0, np.zeros(1))
    h = x / (lam * math.sqrt(0.5))  # peak stiffness lam^2 times the kinetic energy 1/2
    r = run(system, design, MotionSettings(0.9, h, 1, tolerance=1e-8), 0.0, 1.0)
    assert r.outcome == "ok"
    free = r.history["open"] > 0.5
    assert (np.diff(free.astype(int)) == -1).sum() > 20  # impacts
    assert low <= r.history["stored"][free].max() / r.history["stored"][0] - 1 < high


def random_system(n=12, nc=20, seed=3):
    """A frictional assembly brought to the coordinates of its closed reference."""
    rng = np.random.default_rng(seed)
    w2 = (2 * np.pi * np.sort(rng.uniform(800, 9e3, n))) ** 2
    area = rng.uniform(0.5, 1.5, nc) * 1e-2 / nc
    law = contact_law("exponential", p0=1e5, lam=5e5)
    p = rng.uniform(0.5, 1.5, nc) * 1e6
    k = area * p * law.value("contact.lambda")
    shapes = rng.normal(size=(3, nc, n)) * np.sqrt(0.3 * w2.mean() / (k.sum() * n))
    values, phi = la.eigh(np.diag(w2) + shapes[0].T @ (k[:, None] * shapes[0]))
    N, T1, T2 = shapes @ phi
    friction = FrictionLaw(0.4, 3e7, friction_curve(static_ratio=1.25, decay_speed=0.5))
    mu = friction.curve.at(friction.friction, 0.5, p).mu
    gap = np.array([law.gap_at(x) for x in p])
    force = np.column_stack([area * p, -mu * area * p, 0 * p])
    system = ModalSystem(
        values,
        N,
        T1,
        T2,
        area,
        np.ones(nc),
        np.full(nc, 0.1),
        gap,
        k,
        force,
        shapes=rng.normal(size=(1, n)) / np.sqrt(n),
        sensed=np.array([1, 2]),
    )
    full = rng.normal(size=(n, n)) / np.sqrt(n)  # damping of about 1 % on other modes
    C = (full * (0.02 * np.sqrt(values))) @ full.T
    design = MotionPoint(
        law,
        friction,
        0.5,
        np.diag(C).copy(),
        d=np.array([50.0]),
        damping_between=C - np.diag(np.diag(C)),
    )
    return system, design


KICK = np.random.default_rng(5).normal(size=12) * 3.0
SHORT = MotionSettings(2e-3, 2e-6, 1, tolerance=1e-10)
NEWTON = replace(SHORT, integrator=NewmarkNewton(), tolerance=1e-5)


def distance(r, s):
    return np.linalg.norm(r.v - s.v) / np.linalg.norm(s.v)


@pytest.fixture(scope="module")
def rough():
    """Stick, slip and lift-off in a run of the fixed Jacobian."""
    system, design = random_system()
    return system, design, run(system, design, SHORT, np.zeros(12), KICK)


def test_reference_state_stays_at_rest(rough):
    system, design, _ = rough
    r = run(system, design, SHORT, np.zeros(12), np.zeros(12))
    assert np.abs(r.v).max() < 1e-9
    assert r.mean_iterations == 1.0
    assert r.history["torque"][-1] == pytest.approx(-0.1 * system.force[:, 1].sum())


def test_stick_slip_and_lift_off_agree_with_newton(rough):
    system, design, r = rough
    assert r.outcome == "ok"
    assert r.history["stick"].max() > 0.05
    assert r.history["open"].max() > 0.1
    newton = run(system, design, NEWTON, np.zeros(12), KICK)
    assert newton.outcome == "ok"
    assert newton.newton_steps > 1000
    assert distance(r, newton) < 1e-6
    assert abs(r.energy.relative) < 2e-3  # 1e-3 in this violent run at 2 us


def test_twin(rough):
    system, design, r = rough
    states = twin.newmark(system, design, 2e-6, 200, np.zeros(12), KICK)
    np.testing.assert_allclose(
        r.velocity[:201], states[:, 1, :2], atol=1e-6 * np.abs(states[:, 1]).max()
    )


def test_batches_agree_with_single_runs(rough):
    system, design, r = rough
    others = [
        replace(
            design, friction=replace(design.friction, friction=mu, curve=friction_curve()), speed=v
        )
        for mu, v in ((0.1, 0.5), (0.3, 1.0), (0.6, 0.2), (0.2, 2.0), (0.0, 1.0))
    ]
    others[1] = replace(others[1], damping_between=None)
    others[2] = replace(others[2], damping_between=0.5 * design.damping_between)
    alone = [run(system, x, SHORT, np.zeros(12), KICK) for x in others]
    together = simulate(system, started([design, *others], np.zeros(12), KICK), SHORT)
    pair = simulate(system, started(others[:2], np.zeros(12), KICK), SHORT)
    for a, b in zip([r, *alone, *alone[:2]], [*together, *pair], strict=True):
        assert b.outcome == "ok"
        assert distance(b, a) < 1e-8
        assert b.energy.friction == pytest.approx(a.energy.friction, rel=1e-9)


def test_odd_number_of_points_in_a_batch(rough):
    system, design, _ = rough
    names = ("N", "T1", "T2", "area", "frictional", "radius", "gap", "k_ref", "force")
    names = (*names, "speed_factor")
    odd = replace(system, **{k: getattr(system, k)[:19] for k in names})
    single = run(odd, design, replace(SHORT, duration=2e-4), np.zeros(12), KICK)
    both = simulate(odd, started([design] * 2, np.zeros(12), KICK), replace(SHORT, duration=2e-4))
    assert max(distance(b, single) for b in both) < 1e-10


@pytest.mark.parametrize("n", [3, 5])
def test_few_coordinates_are_those_of_a_larger_system(n):
    """Kernels take few without tiles; the larger one has modes that no contact point sees."""
    system, design = random_system(n=12, nc=6)
    D = np.zeros((12, 12))
    D[:n, :n] = design.damping_between[:n, :n]
    seen = np.arange(12) < n
    wide = replace(system, **{k: getattr(system, k) * seen for k in ("N", "T1", "T2", "shapes")})
    parts = {k: np.ascontiguousarray(getattr(wide, k)[:, :n]) for k in ("N", "T1", "T2", "shapes")}
    small = replace(system, omega2=system.omega2[:n], sensed=system.sensed[:1], **parts)
    runs = [
        (wide, replace(design, damping_between=D), KICK * seen),
        (small, replace(design, c=design.c[:n], damping_between=D[:n, :n]), KICK[:n]),
    ]
    settings = replace(SHORT, duration=4e-4)
    large, few = (run(*pair, settings, 0 * v0, v0) for *pair, v0 in runs)
    assert large.outcome == few.outcome == "ok"
    np.testing.assert_allclose(few.v, large.v[:n], atol=1e-9 * np.abs(large.v).max())
    assert few.energy.friction == pytest.approx(large.energy.friction, rel=1e-9)
    assert few.energy.damping == pytest.approx(large.energy.damping, rel=1e-9)
    others = [replace(runs[1][1], speed=v) for v in (0.5, 2.0, 0.2, 4.0)]
    together = simulate(small, started([runs[1][1], *others], np.zeros(n), KICK[:n]), settings)
    np.testing.assert_array_equal(together[0].v, few.v)  # each goes alone


@IN_SINGLE_PRECISION
def test_single_precision_storage_is_close(rough):
    system, design, r = rough
    single = replace(SHORT, integrator=Newmark(single_storage=True))
    stored = run(system, design, single, np.zeros(12), KICK)
    assert 1e-12 < distance(stored, r) < 1e-3


@pytest.mark.parametrize(
    "changes",
    [{"contact_factor": 4.0}, {"contact_stiffness": 5e11}, {"tangential_damping": "always"}],
)
def test_other_fixed_jacobians_reach_the_same_state(rough, changes):
    system, design, r = rough
    other = run(system, design, replace(SHORT, integrator=Newmark(**changes)), np.zeros(12), KICK)
    assert other.outcome == "ok"
    assert distance(other, r) < 1e-6


def test_an_option_of_an_integrator_serves_under_its_old_name_with_a_warning():
    with pytest.warns(DeprecationWarning, match="mockup of integrators is called tangential_dam"):
        renamed = integrator("newmark", {"mockup": "never"})
    assert renamed == Newmark(tangential_damping="never")


def test_tangential_damping_serves_a_stiff_regularisation():
    # 1 point, stick number 50: plain iteration diverges, tangential damping contracts it by 25/26
    system, design = coulomb_slider()
    stiff = replace(design, friction=FrictionLaw(0.1, 1e7))
    plain = Newmark(aitken=False, max_halvings=0)
    settings = MotionSettings(1e-3, 1e-5, 0, plain, max_iterations=2000)
    assert stick_number(system, stiff, 1e-5) == pytest.approx(50.0)
    with_it = run(system, stiff, settings, 1e-5, 0.0)
    assert with_it.outcome == "ok"
    assert with_it.newton_steps == 0
    unaided = Newmark(aitken=False, max_halvings=0, tangential_damping="never")
    without = run(system, stiff, replace(settings, integrator=unaided), 1e-5, 0.0)
    assert without.newton_steps > 0


def test_halving_and_failure_tell_time_and_reason(rough):
    system, design, _ = rough
    hard = replace(SHORT, step=2e-5, max_iterations=2, integrator=Newmark(max_halvings=1))
    designs = [replace(design, friction=FrictionLaw(0, 1.0), speed=0.5), design]
    kicks = np.array([0 * KICK, KICK, KICK])
    r = simulate(system, started([*designs, designs[1]], np.zeros(12), kicks), hard)
    assert r[1].outcome == r[2].outcome == "not_converged"
    assert r[1].halvings > 0
    assert 0 <= r[1].time < 2e-3
    assert f"t = {r[1].time:.4g} s" in r[1].message
    assert "did not converge" in r[1].message
    assert r[0].time >= r[1].time


def test_not_a_number_is_never_converged(rough):
    system, design, r = rough
    broken = replace(design, speed=np.nan)
    results = simulate(system, started([broken, design], np.zeros(12), KICK), SHORT)
    assert results[0].outcome == "not_finite"
    assert results[0].time == 0.0
    assert np.isnan(results[0].energy.stored_end)
    assert results[1].outcome == "ok"
    assert distance(results[1], r) < 1e-8


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")  # without the compiler
def test_overflow_is_never_converged():
    system = point_system([1e4], [1], [0])
    law = contact_law("power", stiffness=1e200, exponent=9.0)
    design = MotionPoint(law, FrictionLaw(0, 1.0), 0.0, np.zeros(1))
    r = run(system, design, MotionSettings(1e-2, 1e-4, 0), 1e-3, -1e30)
    assert r.outcome in ("not_finite", "not_converged")


def test_contraction_of_sticking_points_is_the_stick_number():
    system, design = random_system()
    gap = -system.force[:, 0] / system.area / 5e11
    force = system.force * np.array([1.0, 0.0, 0.0])
    system = replace(system, gap=gap, k_ref=system.area * 5e11, force=force)
    law = contact_law("bilateral", stiffness=5e11)
    friction = FrictionLaw(0.5, 3e7)
    design = replace(design, contact=law, friction=friction, speed=0.0)
    friction = replace(friction, k_t=friction.k_t * 5 / stick_number(system, design, 1e-6))
    design = replace(design, friction=friction)
    settings = MotionSettings(5e-5, 1e-6, 1, Newmark(tangential_damping="never"), tolerance=1e-4)
    r = run(system, design, settings, np.zeros(12), KICK * 1e-6)
    assert r.history["stick"].min() == pytest.approx(1.0)
    assert r.contraction == pytest.approx(5.0, rel=0.05)
    assert r.halvings == 0
    unaided = replace(settings, integrator=Newmark(tangential_damping="never", aitken=False))
    plain = run(system, design, unaided, np.zeros(12), KICK * 1e-6)
    assert plain.halvings > 0
    for choice in ("always", "auto"):
        with_damping = replace(settings, integrator=Newmark(tangential_damping=choice))
        other = run(system, design, with_damping, np.zeros(12), KICK * 1e-6)
        assert other.contraction < 1.0
        assert other.mean_iterations < r.mean_iterations
        assert distance(other, r) < 1e-3


def moved_base(system, design):
    """The same assembly resting elsewhere: its own gaps and the forces that belong to them."""
    p = np.linspace(0.6, 1.4, len(system.gap)) * 1e6
    normal = system.area * p
    mu = design.friction.curve.at(design.friction.friction, design.speed, np.zeros(1)).mu
    gap = np.array([design.contact.gap_at(x) for x in p])
    return gap, np.column_stack([normal, -mu * normal, 0 * p])


def test_a_design_with_its_own_base_is_a_system_built_there(rough):
    system, design, r = rough
    gap, force = moved_base(system, design)
    moved = replace(design, gap=gap, force=force)
    built = run(replace(system, gap=gap, force=force), design, SHORT, np.zeros(12), KICK)
    assert built.outcome == "ok"
    assert distance(built, r) > 1e-2
    alone = run(system, moved, SHORT, np.zeros(12), KICK)
    together = simulate(system, started([moved, design, moved], np.zeros(12), KICK), SHORT)
    for other, expected in zip([alone, *together], [built, built, r, built], strict=True):
        assert distance(other, expected) < 1e-8
        assert other.energy.residual == pytest.approx(expected.energy.residual, rel=1e-6)
    np.testing.assert_array_equal(alone.v, built.v)
    assert abs(alone.energy.relative) < 2e-3
    rest = run(system, moved, SHORT, np.zeros(12), np.zeros(12))
    assert np.abs(rest.v).max() < 1e-9
