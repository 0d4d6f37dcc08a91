"""The judge of runs and limit cycles, itself judged: laws, scipy, Runge-Kutta, energies, roots."""

from __future__ import annotations

import event_laws as laws
import numpy as np
import pytest
from event_reference import SmallDesign, case_of, design, kicked, roots, run, steady
from scipy.integrate import solve_ivp

from squealstudy.laws import CONTACT_LAWS, REGULARISATIONS, ContactLaw, friction_curve

STICK_SLIP = {"contact.regularisation_speed": 2.5e-3}
SLOW = {
    "mass": 10.0,
    "stiffness": 4000.0,
    "normal_force": 98.1,
    "friction": 0.2,
    "friction_law.static_ratio": 1.5,
    "friction_law.decay_speed": 1e-3,
    "sliding_speed": 0.01,
    "damping_ratio": 0.01,
}
IMPACTS = {"friction": 1.0, "damping_ratio": 0.01, "contact.lambda": 3e4, "contact.p0": 1e6}
CASES = {
    "belt": (design("belt", **STICK_SLIP), 1.5),
    "belt, smooth": (design("belt", smooth=True, **STICK_SLIP), 1.5),
    "belt, Coulomb": (SmallDesign("belt", {}, coulomb=True), 1.5),
    "hoffmann, bilateral": (design("hoffmann", friction=0.9, damping_ratio=0.01), 0.3),
    "hoffmann, unilateral": (
        design("hoffmann", "unilateral", friction=0.9, damping_ratio=0.01),
        0.3,
    ),
    "hoffmann, power": (
        design("hoffmann", "power", friction=0.9, damping_ratio=0.01)
        .with_values(**{"contact.stiffness": 4e13, "friction_law.static_ratio": 1.2}),
        0.2,
    ),
    "hoffmann, exponential": (design("hoffmann", "exponential", **IMPACTS), 0.5),
    "hulten, cubic": (
        design("hulten", "cubic", friction=0.4, damping_ratio=0.01)
        .with_values(**{"contact.cubic_stiffness": 4.6e17}),
        0.5,
    ),
    "hulten, back": (design("hulten", friction=0.4).with_values(sliding_speed=-0.3), 0.2),
}  # fmt: skip


@pytest.mark.parametrize("name", laws.CONTACT_CODES)
def test_contact_laws_are_those_of_the_package(name):
    definition = CONTACT_LAWS[name]
    values = [p.default * 1.3 for p in definition.parameters]
    if name == "cubic":
        values[1] = -3e17
    law = ContactLaw(name, tuple(values))
    pair = (*values, 0.0)[:2]
    for g in (-4.3e-6, -3.1e-7, 2.2e-7):
        p, tangent = law.evaluate(np.array([g]))
        shut = g < 0 or name not in ("unilateral", "power")
        code = laws.CONTACT_CODES[name]
        assert laws.pressure(code, *pair, g) * shut == pytest.approx(p[0], rel=1e-13)
        assert laws.tangent(code, *pair, g) * shut == pytest.approx(tangent[0], rel=1e-13)
        assert laws.potential(code, *pair, g) == pytest.approx(
            definition.potential(g, *values), rel=1e-13
        )


@pytest.mark.parametrize("smooth", [False, True])
def test_friction_is_that_of_the_package(smooth):
    d, _ = CASES["belt, smooth" if smooth else "belt"]
    case, curve = case_of(d), friction_curve(static_ratio=2.0, decay_speed=0.5)
    resistance = REGULARISATIONS["smooth" if smooth else "regularised"].resistance
    p = d["normal_force"] / case.area[0]
    for w in (-1.3, -2.4e-3, -1e-4, 1e-4, 2.4e-3, 2.6e-3, 0.7):
        y = np.zeros(laws.N_ROWS)
        y[2] = w - case.speed
        phases, opened = np.zeros(1, np.int64), np.zeros(1, bool)
        laws.enter(case, y, phases, opened)
        bound = curve.at(d["friction"], abs(w), np.array([p])).mu * p
        expected = -resistance(case.slope, bound, abs(w)) * w
        assert laws.traction(case, y, phases, 0) == pytest.approx(expected, rel=1e-12)
        assert (phases[0] == laws.STICK) == (case.slope * abs(w) < bound)


def apart(record, end):
    """Of two ends, over the largest displacement and the largest velocity of a run."""
    size = np.abs(record.rows[:, :4]).reshape(-1, 2, 2).max(axis=(0, 2))
    return (np.abs(record.end - end[:4]).reshape(2, 2).max(axis=1) / size).max()


def with_scipy(d, start, duration):
    """The end (4,) by solve_ivp in pieces, phases changed at its own events."""
    case = case_of(d)
    points = range(len(case.area))
    phases, opened = np.zeros(len(points), np.int64), np.zeros(len(points), bool)
    y, t, out = np.zeros(laws.N_ROWS), 0.0, np.zeros(laws.N_ROWS)
    y[:4] = start
    laws.enter(case, y, phases, opened)

    def rhs(_, y):
        laws.rate(case, y, phases, opened, out)
        return out.copy()

    def corner(y, i):
        w = laws.sliding(case, y, i)
        bound = laws.coefficient(case.friction, case.ratio, case.decay, abs(w))
        s = w if phases[i] == laws.AHEAD else -w if phases[i] == laws.BACK else abs(w)
        return case.slope * s - bound * laws.normal(case, y, laws.STICK, i)

    events = [lambda t, y, i=i: laws.closing(case, y, i) for i in points]
    events += [lambda t, y, i=i: corner(y, i) for i in points]
    for event in events:
        event.terminal = True
    while duration - t > 1e-12:
        found = solve_ivp(
            rhs, (t, duration), y, "DOP853", rtol=1e-9, atol=1e-12, events=events, max_step=2e-5
        )
        t, y = found.t[-1], found.y[:, -1].copy()
        if found.status == 1:  # a hair beyond the event, where its sign has changed
            before, hair = phases.copy(), 1e-13
            while hair < 1e-8 and (phases == before).all():
                t, y, hair = t + hair, y + hair * rhs(t, y), 2 * hair
                laws.enter(case, y, phases, opened)
            assert (phases != before).any()
    return y


@pytest.mark.parametrize("name", [n for n in CASES if "Coulomb" not in n])
def test_scipy_in_pieces_comes_to_the_same_end(name):
    d, kick = CASES[name]
    start = kicked(d, kick, (0.0, 1e6))
    duration = 0.02
    found = run(d, duration, start=start, sample=1e-4)
    assert apart(found, with_scipy(d, start, duration)) < 1e-6
    assert found.events > 3


@pytest.mark.parametrize("name", CASES)
def test_energy_and_tolerance(name):
    d, kick = CASES[name]
    found, tighter = (run(d, 0.1, kick, tolerance=t) for t in (1e-9, 1e-11))
    assert abs(found.imbalance()) < 1e-9
    a, b = (r.levels(0.0, 0.1) for r in (found, tighter))
    assert a.rms == pytest.approx(b.rms, rel=1e-6)
    assert a.mean == pytest.approx(b.mean, rel=1e-6)
    assert a.peak_to_peak == pytest.approx(b.peak_to_peak, rel=1e-3)
    assert a.open_share == pytest.approx(b.open_share, abs=1e-6)
    assert a.stick_share + a.slip_share + a.open_share == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("name", ["belt", "hoffmann, unilateral", "hulten, cubic"])
def test_steps_of_runge_and_kutta_without_events(name):
    d, kick = CASES[name]
    start, case, h = kicked(d, kick, (0.0, 1e6)), case_of(d), 2e-6
    y, out = np.zeros(laws.N_ROWS), np.zeros(laws.N_ROWS)
    y[:4] = start
    phases, opened = np.zeros(len(case.area), np.int64), np.zeros(len(case.area), bool)

    def rhs(y):
        laws.enter(case, y.copy(), phases, opened)
        laws.rate(case, y, phases, opened, out)
        return out.copy()

    for _ in range(10_000):
        a = rhs(y)
        b = rhs(y + h / 2 * a)
        c = rhs(y + h / 2 * b)
        y = y + h / 6 * (a + 2 * b + 2 * c + rhs(y + h * c))
    found = run(d, 0.02, start=start, sample=1e-4)
    assert apart(found, y) < 1e-5
    levels = found.levels(0.0, 0.02)
    mean = y[laws.TORQUE] / 0.02
    assert levels.mean == pytest.approx(mean, rel=1e-5)
    assert levels.rms == pytest.approx(np.sqrt(y[laws.SQUARE] / 0.02 - mean**2), rel=1e-4)
    assert levels.stick_share == pytest.approx(y[laws.STICKS] / 0.02, abs=1e-3)


@pytest.mark.parametrize(
    ("d", "growth"),
    [
        (design("hoffmann", "unilateral", friction=1.0, damping_ratio=0.01), 188.484),
        (design("hulten", friction=0.3, damping_ratio=0.01), 13.531),
        (design("hulten", friction=0.8, damping_ratio=0.01), 182.600),
        (
            design("hoffmann", "exponential", friction=1.0, damping_ratio=0.03).with_values(
                **{"contact.p0": 1e6, "contact.lambda": 1e5}
            ),
            -28.458,
        ),
    ],
)
def test_small_motion_grows_as_roots_say(d, growth):
    lam, _ = roots(d)
    assert lam[0].real == pytest.approx(growth, abs=2e-3)
    found = run(d, 0.06, kick=1e-7)
    x = found.rows[:, 2:4] @ found.rows[0, 2:4]
    last = len(x) // 2
    state = np.column_stack([x[2:], x[1:-1], x[:-2]])[last:]
    a, b = np.linalg.lstsq(state[:, 1:], state[:, 0], rcond=None)[0]
    pair = np.log(np.roots([1.0, -a, -b])[0]) / found.sample
    assert pair.real == pytest.approx(growth, rel=1e-3)
    assert abs(pair.imag) == pytest.approx(lam[0].imag, rel=1e-4)


@pytest.mark.parametrize(
    ("speed", "corner", "rms", "hz", "mean"),
    [
        (0.25, 2.5e-3, 114.034, 80.241, 441.7),
        (0.5, 2.5e-3, 128.903, 90.739, 400.3),
        (1.0, 2.5e-3, 116.397, 97.728, 378.7),
        (1.3, 2.5e-3, 103.506, 99.063, 377.6),
        (0.5, 1e-2, 125.606, None, None),
        (1.3, 1e-2, 100.945, None, None),
    ],
)
def test_levels_of_the_belt(speed, corner, rms, hz, mean):
    """Found before by DOP853 with events at 1e-10, by others."""
    d = design("belt", **{"contact.regularisation_speed": corner}).with_values(sliding_speed=speed)
    cycle = run(d, 0.6, kick=1.5).cycle()
    assert cycle.levels.rms == pytest.approx(rms, abs=6e-4)
    if hz:
        assert cycle.frequency_hz == pytest.approx(hz, abs=6e-4)
        assert cycle.levels.mean == pytest.approx(mean, abs=0.06)


def test_slow_stick_slip_with_and_without_regularisation():
    corner = design("belt", **SLOW, **{"contact.regularisation_speed": 2e-5})
    coulomb = SmallDesign("belt", SLOW, coulomb=True)
    for d, rms, hz in ((corner, 4.758, 1.515), (coulomb, 4.864, 1.496)):
        cycle = run(d, 5.0, kick=0.02).cycle()
        assert cycle.levels.rms == pytest.approx(rms, abs=6e-4)
        assert cycle.frequency_hz == pytest.approx(hz, abs=6e-4)


def test_contact_that_is_open_most_of_the_time():
    d = design("hoffmann", "exponential", friction=1.0, damping_ratio=0.01).with_values(
        **{"contact.regularisation_speed": 1e-3}
    )
    _, p, _ = steady(d)
    assert case_of(d).area @ p == pytest.approx(65.4, abs=0.1)
    found = run(d, 0.5, kick=0.1).levels(0.3, 0.5)
    assert found.rms == pytest.approx(763.5, abs=1.5)
    assert found.open_share == pytest.approx(0.949, abs=2e-3)
    assert found.peak_to_peak == pytest.approx(10526, rel=1e-3)


def test_impacts_of_two_lasting_cycles():
    """A loud cycle with open contact, and a quiet one beside it from a small kick."""
    d = design("hoffmann", "exponential", **IMPACTS)
    loud, quiet = (run(d, 1.0, kick=kick).cycle(0.3) for kick in (0.5, 0.01))
    assert loud.levels.rms == pytest.approx(886.28, rel=1e-3)
    assert quiet.levels.rms == pytest.approx(97.945, rel=1e-4)


SOFTENS = {
    "k1": 1.31e6,
    "k2": 1.356e6,
    "contact_stiffness": 2.6e6,
    "contact.cubic_stiffness": -5.4e17,
    "normal_force": 1000.0,
    "sliding_speed": 10.0,
    "friction": 0.9,
}


def test_how_much_damping_silences_the_softening_oscillator():
    """That of studies/kicked_design.toml, whose searches end at .0378 and .0385."""

    def level(damping, start=None):
        d = design("hoffmann", "cubic", **SOFTENS, damping_ratio=damping)
        assert (steady(d)[2] > 0).all()  # a state beyond the top of the law balances the load too
        start = kicked(d, 2.5, (100.0, 1000.0)) if start is None else start
        found = run(d, 0.4, start=start, sample=2e-4)
        return float(found.torque[-250:].std()), found.end

    start = None
    for damping in (0.025, 0.032, 0.035, 0.0365):
        lasts, start = level(damping, start)
        assert lasts > 150.0
    assert level(0.0378, start)[0] < 10.0
