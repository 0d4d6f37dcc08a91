"""Integrators beside Newmark: orders, limits, energy, agreement, twins, failures, options."""

from __future__ import annotations

import math
from dataclasses import replace

import integrator_reference as twins
import newmark_reference as newmark_twin
import numpy as np
import pytest
import scipy.linalg as la
from motions import run_one, started
from scipy.integrate import solve_ivp
from shared_kernels import COMPARED, OF_COMPARED_INTEGRATORS, by_integrator
from test_newmark import KICK, belt, linear_case, point_system, random_system

from squealstudy.errors import ModelError, ParameterError
from squealstudy.laboratory.integrators.adaptive import Adaptive, Equations
from squealstudy.laboratory.integrators.fixed_step import own_arrays
from squealstudy.laws import FrictionLaw, contact_law, friction_curve
from squealstudy.motion.integrator import Integrator, integrator, integrators, register_integrator
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import ModalSystem, MotionPoint
from squealstudy.motion.warmup import warm

INTEGRATORS = integrators()
SOLVERS = [name for name, method in INTEGRATORS.items() if issubclass(method, Adaptive)]
ORDERS = {name: method.order for name, method in INTEGRATORS.items() if method.order}
FIXED = [name for name in ORDERS if not name.startswith("newmark")]
EXPLICIT = ("central_difference", "exponential_2", "exponential_3")
SHARP = {"tolerance": 1e-11}
FREE = FrictionLaw(0, 1.0)


def run(name, system, design, settings, q0, v0, **options):
    chosen = replace(settings, integrator=integrator(name, options))
    return run_one(system, design, chosen, q0, v0)


def observed_order(name, system, design, duration, counts, start, end, **options):
    """Fitted order of the error of (omega q, v), and the errors."""
    n, w = system.n, np.sqrt(system.omega2)
    errors = []
    for count in counts:
        settings = MotionSettings(duration, duration / count, 0, **SHARP)
        r = run(name, system, design, settings, start[:n], start[n:], **options)
        assert r.outcome == "ok"
        errors.append(la.norm(np.concatenate([w * (r.q - end[:n]), r.v - end[n:]])))
    return -np.polyfit(np.log(counts), np.log(errors), 1)[0], errors


@pytest.mark.parametrize("name", by_integrator(FIXED, short=True))
def test_order_on_a_linear_case_against_expm(name):
    system, design, K, C, load = linear_case()
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -C]])
    rest = np.concatenate([np.linalg.solve(K, load), np.zeros(2)])
    start = np.array([0.01, -0.02, 1.0, 0.5])
    end = rest + la.expm(A * 0.08) @ (start - rest)
    order, _ = observed_order(name, system, design, 0.08, [200, 400, 800, 1600], start, end)
    assert order == pytest.approx(ORDERS[name], abs=0.06)


def smooth_case():
    """Two modes, a point that slides with falling, smooth friction under an exponential law."""
    system = point_system(
        [1e4, 6e4],
        [1.0, 0.5],
        [0.3, -1.0],
        T2=np.array([[0.4, 0.2]]),
        k_ref=np.array([3e3]),
        shapes=np.array([[1.0, 1.0]]),
    )
    law = contact_law("exponential", p0=20.0, lam=150.0)
    friction = FrictionLaw(0.4, 40.0, friction_curve(static_ratio=1.5), "smooth")
    load = np.array([15.0, 1.0])
    damped, stiff = np.array([4.0]), np.array([500.0])
    between = np.array([[0.0, -3.0], [-3.0, 0.0]])
    design = MotionPoint(
        law,
        friction,
        0.4,
        np.array([3.0, 8.0]),
        load,
        damped,
        stiff,
        damping_between=between,
    )
    return system, design, np.array([0.001, -0.002, 0.8, 0.4])


def exact(system, design, duration, start):
    """By DOP853 on the slow twin of the equation of motion."""
    n = system.n

    def rate(t, y):
        a = newmark_twin.acceleration(system, design, y[:n], y[n:])
        return np.concatenate([y[n:], a])

    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    return solve_ivp(rate, (0, duration), start, **options).y[:, -1]


@pytest.fixture(scope="module")
def smooth():
    system, design, start = smooth_case()
    return system, design, start, exact(system, design, 0.1, start)


OPTIONS = [
    pytest.param(*values, marks=[OF_COMPARED_INTEGRATORS, pytest.mark.as_python])
    for values in (
        ("hht_alpha", {"alpha": -1 / 3}, 2),
        ("generalised_alpha", {"rho_inf": 0.0}, 2),
        ("central_difference", {"velocity": "lagged"}, 1),
    )
]


@pytest.mark.parametrize(
    ("name", "options", "order"),
    [
        *by_integrator(FIXED[:3], {}, None),
        *by_integrator(FIXED[3:], {}, None, short=True),
        *OPTIONS,
    ],
)
def test_order_with_contact_and_friction(smooth, name, options, order):
    system, design, start, end = smooth
    order = order or ORDERS[name]
    counts = [400, 800, 1600]
    found, _ = observed_order(name, system, design, 0.1, counts, start, end, **options)
    assert found == pytest.approx(order, abs=0.12)


@pytest.mark.parametrize("name", by_integrator(FIXED, short=True))
def test_work_and_energy_balance(smooth, name):
    """Of friction, damping, loads and the belt, closer as steps are shorter."""
    system, design, start, _ = smooth
    off = []
    for count in (200, 400):
        settings = MotionSettings(0.1, 0.1 / count, 0, **SHARP)
        energy = run(name, system, design, settings, start[:2], start[2:]).energy
        assert abs(energy.friction) > 0.1 * energy.stored_start
        off.append(abs(energy.relative))
    assert off[1] < 0.01
    assert off[1] < 0.6 * off[0] + 1e-9


@pytest.mark.parametrize("name", SOLVERS)
def test_adaptive_solvers_follow_their_tolerance(smooth, name):
    system, design, start, end = smooth
    settings = MotionSettings(0.1, 1e-3, 7)
    errors = []
    for rtol in (1e-4, 1e-8):
        r = run(name, system, design, settings, start[:2], start[2:], rtol=rtol)
        assert r.outcome == "ok"
        errors.append(la.norm((r.v - end[2:]) / la.norm(end[2:])))
        np.testing.assert_allclose(r.history["time"], np.arange(0, 101, 7) * 1e-3)
        assert r.mean_iterations * r.steps > 50
    assert errors[0] < 0.05
    assert errors[1] < 1e-5
    assert errors[1] < 1e-2 * errors[0]
    # dense output at a row equals a run that ends there
    middle = exact(system, design, 98e-3, start)
    np.testing.assert_allclose(r.history["modal_energy"][-1], energy_of(system, middle), rtol=1e-5)


def energy_of(system, y):
    n = system.n
    return 0.5 * (y[n:] @ y[n:] + system.omega2 @ y[:n] ** 2)


def ball(law, w2=(1e4,), N=(1.0,)):
    """An impact oscillator without damping or friction."""
    system = point_system(w2, N, np.zeros(len(w2)), sensed=np.arange(len(w2)) + 1)
    return system, MotionPoint(law, FREE, 0.0, np.zeros(len(w2)))


@pytest.mark.parametrize("name", by_integrator([*FIXED, "newmark"]))
def test_order_falls_where_contact_begins(name):
    # a kink in the force: all methods end at order 2, with a scattered constant
    system, design = ball(contact_law("unilateral", stiffness=4e4))
    w, up = 100.0, math.sqrt(5e4)  # half a free period up, half a closed one down
    end = np.array([0.0, math.sqrt(1e4) / w])
    duration = math.pi / up + math.pi / w + math.pi / up / 3
    x = math.pi / 3
    end = np.array([-1 / up * math.sin(x), -math.cos(x)])
    counts = np.round(np.geomspace(100, 3200, 21)).astype(int)
    order, _ = observed_order(name, system, design, duration, counts, np.array([0.0, -1.0]), end)
    assert order == pytest.approx(2.0, abs=0.35)


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")  # without the compiler
@pytest.mark.parametrize(
    ("name", "options"),
    [
        *by_integrator(["exponential_2", "exponential_3"], {}, short=True),
        ("exponential", {"exact_limit": 1e9}),
    ],
)
def test_exponential_steps_are_exact_without_contact(name, options):
    # light, critical, over-damped, undamped, rigid with and without damping, unstable
    w2 = np.array([1e6, 1e4, 1e4, 1e8, 0.0, 0.0, -25.0])
    c = np.array([20.0, 200.0, 5e3, 0.0, 0.0, 40.0, 1.0])
    n = len(w2)
    zero = np.zeros(n)
    system = point_system(w2, zero, zero)
    load = np.linspace(1, 2, n)
    law = contact_law("exponential", p0=1.0, lam=1.0)
    design = MotionPoint(law, FREE, 0.0, c, load)
    q0, v0 = np.linspace(1e-3, 2e-3, n), np.linspace(-1, 1, n)
    ends = []
    for k in range(n):
        A = np.array([[0, 1, 0], [-w2[k], -c[k], load[k]], [0, 0, 0]])
        ends.append((la.expm(0.3 * A) @ [q0[k], v0[k], 1.0])[:2])
    q, v = np.array(ends).T
    for step in (0.3, 0.1, 1e-3):
        settings = MotionSettings(0.3, step, 0)
        r = run(name, system, design, settings, q0, v0, **options)
        assert r.outcome == "ok"
        np.testing.assert_allclose(r.v, v, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(r.q, q, rtol=1e-8, atol=1e-11)


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")  # without the compiler
@pytest.mark.as_python
@OF_COMPARED_INTEGRATORS
def test_stability_limit_of_central_differences():
    system, design = ball(contact_law("unilateral", stiffness=1.0), N=(0.0,))
    outcomes = [
        run(
            "central_difference",
            system,
            design,
            MotionSettings(1000 * x / 100, x / 100, 0),
            0.0,
            1.0,
        ).outcome
        for x in (1.9995, 2.0005)
    ]
    assert outcomes == ["ok", "blown_up"]


LAWS = {
    "exponential": (contact_law("exponential", p0=1e-2, lam=1e5), 1e5 * math.sqrt(0.5)),
    "unilateral": (contact_law("unilateral", stiffness=5e9), math.sqrt(5e9)),
    "power": (contact_law("power", stiffness=1e13, exponent=2.0), math.sqrt(2e13 * 6e-5)),
}


@OF_COMPARED_INTEGRATORS
@pytest.mark.parametrize("x", [0.5, 5.0])
@pytest.mark.parametrize("modes", [1, 5])
@pytest.mark.parametrize("kind", LAWS)
def test_discrete_gradient_keeps_the_energy_of_impacts(kind, modes, x):
    # Hughes 1976: average acceleration gains energy at h omega_peak = 5; this one nowhere
    system, design, settings = impacts(kind, modes, x, 100_000)
    stored = kept_energy(system, design, settings).history["stored"]
    if x == 5.0:
        rest, kick = np.zeros(modes), np.ones(modes)
        r = run("newmark", system, design, replace(settings, **SHARP), rest, kick)
        assert r.history["stored"].max() > 3 * stored[0]


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")  # without the compiler
@pytest.mark.as_python
@OF_COMPARED_INTEGRATORS
@pytest.mark.parametrize("kind", LAWS)
def test_discrete_gradient_keeps_the_energy_of_some_impacts(kind):
    """The first at once, as the run begins."""
    r = kept_energy(*impacts(kind, 5, 0.5, 1_000), kick=-1.0)
    force = r.history["normal_force"]
    assert force.max() > 10 * np.median(force)


def impacts(kind, modes, x, steps):
    """Modes that fly against a point, in steps of h omega_peak = x."""
    law, peak = LAWS[kind]
    w2 = np.array([1e4, 9e4, 4e5, 1e6, 3e6])[:modes]
    N = np.array([1.0, 0.5, -0.7, 0.3, 0.2])[:modes]
    h = x / (peak * la.norm(N))
    settings = MotionSettings(steps * h, h, steps // 200, max_iterations=100)
    return *ball(law, w2, N), settings


def kept_energy(system, design, settings, kick=1.0):
    """A run by the discrete gradient, at all rows with the energy of its start."""
    options = {"iteration_tolerance": 1e-13, "max_halvings": 10}
    rest, kicked = np.zeros(system.n), np.full(system.n, kick)
    r = run("discrete_gradient", system, design, settings, rest, kicked, **options)
    assert r.outcome == "ok"
    assert r.steps == round(settings.duration / settings.step)
    stored = r.history["stored"]
    assert np.abs(stored / stored[0] - 1).max() < 1e-10
    return r


def test_energy_from_nowhere_is_no_success():
    law, peak = LAWS["unilateral"]
    w2, N = np.array([1e4, 9e4, 4e5, 1e6, 3e6]), np.array([1.0, 0.5, -0.7, 0.3, 0.2])
    system, design = ball(law, w2, N)
    h = 5.0 / (peak * la.norm(N))
    settings = MotionSettings(1e5 * h, h, 0)
    gentle = np.vstack([np.ones(5), np.zeros(5)])
    blown, still = simulate(system, started([design, design], 0 * gentle, gentle), settings)
    assert blown.outcome == "blown_up"
    assert "far more energy than was ever put in" in blown.message
    assert still.outcome == "ok"


@pytest.fixture(scope="module")
def stick_slip():
    system, design = belt(0.5, k_t=100.0)
    settings = MotionSettings(25, 1e-3, 5, **SHARP)
    reference = run("newmark_newton", system, design, settings, 1.2, 0.0)
    assert 0.1 < reference.history["stick"].mean() < 0.9
    return system, design, settings, reference


@pytest.mark.parametrize("name", by_integrator(INTEGRATORS))
def test_all_agree_in_stick_slip(stick_slip, name):
    system, design, settings, reference = stick_slip
    r = run(name, system, design, settings, 1.2, 0.0)
    assert r.outcome == "ok"
    for column in ("torque", "stored", "modal_energy"):
        size = np.ptp(reference.history[column])
        assert np.abs(r.history[column] - reference.history[column]).max() < 0.01 * size
    assert r.history["stick"].mean() == pytest.approx(reference.history["stick"].mean(), abs=0.01)
    assert r.v[0] == pytest.approx(reference.v[0], abs=0.005)
    if name not in SOLVERS:
        for column in ("dissipated_friction", "dissipated_damping", "work_belt"):
            got, wanted = r.history[column][-1], reference.history[column][-1]
            assert got == pytest.approx(wanted, rel=0.01)
        assert abs(r.energy.relative) < 2e-3


@pytest.fixture(scope="module")
def rough():
    """Lift-off and stick in 12 modes and 20 points, finely resolved."""
    system, design = random_system()
    settings = MotionSettings(4e-4, 1e-7, 40, save_q=True, **SHARP)
    options = {"rtol": 1e-10}
    reference = run("dop853", system, design, settings, np.zeros(12), KICK, **options)
    assert reference.history["stick"].max() > 0.05
    assert reference.history["open"].max() > 0.1
    return system, design, settings, reference


@pytest.mark.parametrize("name", by_integrator(INTEGRATORS))
def test_histories_agree(rough, name):
    system, design, settings, reference = rough
    r = run(name, system, design, settings, np.zeros(12), KICK)
    assert r.outcome == "ok"
    assert r.time == pytest.approx(4e-4)
    for column in ("time", "torque", "normal_force", "stored", "modal_energy", "stick", "open"):
        wanted = reference.history[column]
        size = np.abs(wanted).max()
        off = np.abs(r.history[column] - wanted)
        jumps = column in ("stick", "open")  # by whole points, at the row of an instant
        assert (off.mean() if jumps else off.max()) < 0.01 * size
    for got, wanted in (
        (r.displacement, reference.displacement),
        (r.velocity, reference.velocity),
        (r.q_history, reference.q_history),
        (r.v, reference.v),
    ):
        assert np.abs(got - wanted).max() < 0.01 * np.abs(wanted).max()
    total = r.history["stick"] + r.history["slip"] + r.history["open"]
    np.testing.assert_allclose(total, 1.0, rtol=1e-12)
    if name in SOLVERS:
        assert np.isnan(r.energy.friction)
    else:
        assert abs(r.energy.relative) < 2e-3


@pytest.mark.as_python
@OF_COMPARED_INTEGRATORS
def test_twins():
    system, design = random_system()
    h, n = 4e-7, 60
    settings = MotionSettings(n * h, h, 1, save_q=True, **SHARP)
    cases = {
        "central_difference": (twins.central_difference, {}),
        "generalised_alpha": (twins.generalised_alpha, {"rho": 0.6}),
        "exponential_2": (twins.exponential_2, {}),
    }
    for name, (twin, given) in cases.items():
        options = {"rho_inf": 0.6} if given else {}
        r = run(name, system, design, settings, np.zeros(12), KICK, **options)
        states = twin(system, design, h, n, np.zeros(12), KICK, **given)
        size = np.abs(states[:, 1]).max()
        np.testing.assert_allclose(r.velocity, states[:, 1, :2], atol=1e-8 * size)
        np.testing.assert_allclose(
            r.q_history, states[:, 0], atol=1e-8 * np.abs(states[:, 0]).max()
        )
        if name in EXPLICIT:
            assert r.mean_iterations == r.max_iterations == 1.0


@pytest.mark.parametrize(
    ("name", "options"),
    [
        *by_integrator(["hht_alpha"], {"alpha": 0.0}),
        ("exponential", {"exact_limit": 0.0}),
    ],
)
def test_members_of_families_that_are_newmark(name, options):
    system, design = random_system()
    settings = MotionSettings(2e-4, 1e-6, 0, **SHARP)
    ours = run("newmark", system, design, settings, np.zeros(12), KICK)
    r = run(name, system, design, settings, np.zeros(12), KICK, **options)
    np.testing.assert_allclose(r.v, ours.v, rtol=1e-7, atol=1e-7)
    if name in COMPARED:
        damped = run(name, system, design, settings, np.zeros(12), KICK, alpha=-0.3)
        assert la.norm(damped.v - ours.v) > 1e-4 * la.norm(ours.v)


def wide_system(n=40, nc=24):
    """As random_system with modes to 200 kHz, as a brake's reduced model has them."""
    rng = np.random.default_rng(3)
    w2 = (2 * np.pi * np.geomspace(800, 200e3, n)) ** 2
    area = rng.uniform(0.5, 1.5, nc) * 1e-2 / nc
    law = contact_law("exponential", p0=1e5, lam=5e5)
    p = rng.uniform(0.5, 1.5, nc) * 1e6
    k = area * p * law.value("contact.lambda")
    shapes = rng.normal(size=(3, nc, n)) * np.sqrt(0.04 * w2 / k.sum())
    values, phi = la.eigh(np.diag(w2) + shapes[0].T @ (k[:, None] * shapes[0]))
    N, T1, T2 = shapes @ phi
    gap = np.array([law.gap_at(x) for x in p])
    force = np.column_stack([area * p, -0.5 * area * p, 0 * p])
    one = np.ones(nc)
    system = ModalSystem(values, N, T1, T2, area, one, 0.1 * one, gap, k, force)
    friction = FrictionLaw(0.5, 0.5 * p.max() / 0.01)
    v = rng.normal(size=n) / (1 + (np.sqrt(values) / (2 * np.pi * 4e3)) ** 3)
    v *= 0.6 / np.hypot(T1 @ v, T2 @ v).max()
    return system, MotionPoint(law, friction, 0.5, 0.01 * np.sqrt(values)), v


def test_exact_resolved_modes_beat_average_acceleration():
    # stick, lift-off and omega h to 2.6: all modes exact resonate with the changes of contact
    system, design, v0 = wide_system()
    settings = MotionSettings(1e-3, 2e-6, 10)
    rest = np.zeros(len(v0))
    reference = run("dop853", system, design, settings, rest, v0, rtol=1e-9)
    assert reference.history["stick"].max() > 0.1
    assert reference.history["open"].max() > 0.1
    assert math.sqrt(system.omega2[-1]) * settings.step > 2.5

    def error(name, **options):
        r = run(name, system, design, settings, rest, v0, **options)
        assert r.outcome == "ok"
        return la.norm(r.v - reference.v) / la.norm(reference.v)

    limited = error("exponential")
    assert limited < 0.1 * error("newmark")
    assert limited < 0.1 * error("exponential", exact_limit=1e9)


@pytest.mark.parametrize(
    "name",
    by_integrator(
        ["newmark", "newmark_newton", "generalised_alpha", "discrete_gradient", "exponential"]
    ),
)
def test_predictor_held_constant_reaches_the_same_state(name):
    system, design = random_system()
    sharp = {"tolerance": 1e-5} if name == "newmark_newton" else SHARP
    settings = MotionSettings(2e-4, 1e-6, 0, **sharp)
    one = run(name, system, design, settings, np.zeros(12), KICK)
    held = run(name, system, design, settings, np.zeros(12), KICK, extrapolate=False)
    assert held.mean_iterations > one.mean_iterations
    np.testing.assert_allclose(held.v, one.v, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "duration", "start"),
    [
        *by_integrator(["exponential", *FIXED[1:4]], 5, (1.2, 0.4)),
        *by_integrator(FIXED[1:4], 0.2, (0.2, 0.499), short=True),
    ],
)
def test_tangential_damping_shortens_the_iteration_of_sticking_points(name, duration, start):
    system, design = belt(0.5, k_t=1e5)
    settings = MotionSettings(duration, 1e-3, 0)
    with_it, without = (
        run(name, system, design, settings, *start, tangential_damping=x) for x in ("auto", "never")
    )
    assert with_it.outcome == "ok"
    assert with_it.mean_iterations < without.mean_iterations


def test_jacobian_is_the_slope_of_the_rate(rough):
    system, design, settings, reference = rough
    (point,) = started([design], np.zeros(12), KICK)
    equations = Equations(own_arrays(system, point, settings))
    for y in (np.concatenate([np.zeros(12), KICK]), np.concatenate([reference.q, reference.v])):
        J = equations.jacobian(0.0, y)
        size = np.concatenate([np.full(12, 1e-12), np.full(12, 1e-7)])
        columns = [
            (equations.rate(0.0, y + e) - equations.rate(0.0, y - e)) / (2 * e.max())
            for e in np.diag(size)
        ]
        difference = np.abs(np.array(columns).T - J)
        scale = np.abs(J).max(axis=0)
        assert (difference / scale).max() < 1e-4


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")  # without the compiler
@pytest.mark.parametrize("name", by_integrator(FIXED, short=True))
def test_a_step_far_too_long_is_a_failure(name):
    law, peak = LAWS["exponential"]
    system, design = ball(law)
    h = 30 / peak
    settings = MotionSettings(3000 * h, h, 1, max_iterations=2)
    options = {} if name in EXPLICIT else {"max_halvings": 0}
    r = run(name, system, design, settings, 0.0, 1.0, **options)
    assert r.outcome in ("not_converged", "not_finite", "blown_up")
    assert r.outcome == "not_converged" or name in EXPLICIT
    assert f"t = {r.time:.4g} s" in r.message
    assert r.time < settings.duration
    assert np.isnan(r.energy.stored_end)
    assert len(r.history["time"]) <= r.steps + 1


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")  # without the compiler
@pytest.mark.parametrize("name", by_integrator(INTEGRATORS, short=True))
def test_overflow_is_a_failure(name):
    system, design = ball(contact_law("power", stiffness=1e200, exponent=9.0))
    r = run(name, system, design, MotionSettings(1e-2, 1e-4, 0), 1e-3, -1e30)
    if name in SOLVERS and r.outcome == "ok":  # steps of 1e-60 s may follow the bounce
        assert r.energy.stored_end == pytest.approx(r.energy.stored_start, rel=1e-4)
    else:
        assert r.outcome in ("not_finite", "not_converged", "blown_up", "solver_failed")
        assert r.message


def test_adaptive_solvers_give_up_in_words(smooth):
    system, design, start, _ = smooth
    settings = MotionSettings(0.1, 1e-3, 10)
    r = run("dop853", system, design, settings, start[:2], start[2:], max_evaluations=100)
    assert r.outcome == "solver_failed"
    assert "100 evaluations" in r.message
    assert 0 < r.time < 0.1
    assert len(r.history["time"]) == int(r.time / 0.01) + 1
    assert np.isnan(r.energy.stored_end)


@pytest.mark.parametrize(
    ("name", "options", "key", "message"),
    [
        ("runge_kutta", {}, "integrator", r"is none of .*exponential, newmark, newmark_newton"),
        ("newmark", {"rho_inf": 0.5}, "rho_inf", "it takes extrapolate, max_halvings"),
        ("exponential_2", {"prewarp": True}, "prewarp", "it takes nothing"),
        ("hht_alpha", {"alpha": 0.1}, "alpha", "expected at most 0, got 0.1"),
        ("hht_alpha", {"alpha": math.nan}, "alpha", "expected a finite number, got nan"),
        ("generalised_alpha", {"rho_inf": True}, "rho_inf", "expected a number, got True"),
        ("generalised_alpha", {"aitken": 1}, "aitken", "expected true or false, got 1"),
        (
            "central_difference",
            {"velocity": "new"},
            "velocity",
            "expected 'extrapolated' or 'lagged', got 'new'",
        ),
        ("exponential_3", {"start_parts": 1.5}, "start_parts", "expected a whole number, got 1.5"),
        ("dop853", {"rtol": 0.0}, "rtol", "expected at least 1e-14, got 0.0"),
    ],
)
def test_options_are_checked(stick_slip, name, options, key, message):
    system, design, settings, _ = stick_slip
    with pytest.raises(ParameterError, match=message) as caught:
        run(name, system, design, settings, 0.0, 0.0, **options)
    assert caught.value.key == key


def test_initial_states_are_checked(stick_slip):
    system, design, settings, _ = stick_slip
    for name in INTEGRATORS:
        chosen = replace(settings, integrator=integrator(name))
        for q0 in (np.zeros(2), np.zeros((1, 1)), np.array([np.inf])):
            with pytest.raises(ModelError, match="initial state"):
                simulate(system, [replace(design, q0=q0)], chosen)


def test_catalogue_has_words_and_allowed_defaults():
    for name, method in INTEGRATORS.items():
        assert method.label
        assert method.description
        made = integrator(name)
        assert made == integrator(name, made.model_dump())
        assert all(field.description for field in method.model_fields.values())


def test_two_integrators_of_one_name_are_refused():
    class Impostor(Integrator):
        name = "newmark"

    with pytest.raises(ParameterError, match="there is another 'newmark'"):
        register_integrator(Impostor)
    assert integrators()["newmark"] is not Impostor


@OF_COMPARED_INTEGRATORS
def test_warming_runs_every_integrator():
    assert warm(integrator(name) for name in integrators()) >= 0.0
    with pytest.raises(ParameterError, match=r"is none of .*exponential"):
        integrator("euler")
