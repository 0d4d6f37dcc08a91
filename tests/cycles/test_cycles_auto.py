"""Cycles, Hopf points, folds and multipliers against AUTO-07p, which collocates."""

from __future__ import annotations

from dataclasses import replace

import auto_brake
import auto_runs
import cycle_models as models
import numpy as np
import pytest

from squealstudy.cycles.borders import BorderPoint, fold_near, follow_border
from squealstudy.cycles.branch import HOPF, NS, branch
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.floquet import floquet
from squealstudy.cycles.folds import FOLD
from squealstudy.cycles.harmonics import derivative

pytestmark = [
    pytest.mark.auto,
    pytest.mark.skipif(
        bool(auto_runs.MISSING), reason=f"not compared with AUTO-07p: no {auto_runs.MISSING}"
    ),
]
EQUAL = 1e-6
PRINTED = 1e-5  # relative, of multipliers that AUTO prints with six digits
ZERO = 1e-7  # of multipliers too small for AUTO's collocation


def size(motion, P, units=(1.0, 1.0), mean=0.0):
    """Root mean square of states (q, q') with P the rows of the coordinates: AUTO's L2 norm."""
    q = motion.Q @ P.T
    q[0] += mean
    v = motion.omega * derivative(motion.Q @ P.T)
    per = [(x[0] ** 2).sum() + 0.5 * (x[1:] ** 2).sum() for x in (q, v)]
    return np.sqrt(sum(unit**2 * x for unit, x in zip(units, per, strict=True)))


def compare_multipliers(own, auto, equal=EQUAL):
    """All but the trivial one, which AUTO prints as one."""
    trivial = min(auto, key=lambda x: abs(x - 1.0))
    rest = sorted((x for x in auto if x is not trivial), key=abs, reverse=True)
    assert len(rest) == len(own.multipliers) - 1
    for exact in rest:
        distance = np.abs(own.multipliers[:-1] - exact).min()
        assert distance <= equal + PRINTED * abs(exact) + ZERO
    assert abs(own.trivial - 1.0) <= own.error


def first_harmonics(osc, harmonics, reach):
    lam, psi = models.linear_modes(osc)
    equations, curve = models.growth_curve(
        osc, lam[0], psi[:, 0], 1e-2, harmonics, lambda m: np.abs(m.Q).max() > reach
    )
    return [equations.motion(p.u) for p in curve.at("C")]


def test_quintic_oscillator_through_its_fold(tmp_path):
    equations = "F(1)=U(2)\nF(2)=-(PAR(1)-U(1)**2+U(1)**4)*U(2)-U(1)"
    steady, cycles = auto_runs.auto_cycles(
        tmp_path, equations, 2, 0.2, low=-0.1, high=0.3, step=-0.02, at=0.05
    )
    hopf = next(p for p in steady if p.kind == "HB")
    osc = models.scalar_oscillator(models.quintic, 0.05)
    start, last = first_harmonics(osc, 21, 2.0)

    def at(nu):
        return models.scalar_oscillator(models.quintic, nu)

    points, end = branch(
        at, PeriodicMotion(last.Q, last.omega, 0.05), (-0.1, 0.2), 1.0, models.shrunk(osc, 1e-4)
    )
    assert end == "hopf"
    (own_fold,) = (p for p in points if p.event == FOLD)
    assert [p.event for p in points if p.event] == [FOLD, HOPF]
    assert points[-1].motion.parameter == pytest.approx(hopf.parameter, abs=EQUAL)
    (fold,) = (p for p in cycles if p.kind == "LP")
    assert own_fold.motion.parameter == pytest.approx(fold.parameter, abs=EQUAL)
    assert 2 * np.pi / own_fold.motion.omega == pytest.approx(fold.period, rel=EQUAL)
    inner, outer = (p for p in cycles if p.kind == "UZ")
    for own, judge in ((start, inner), (last, outer)):
        assert 2 * np.pi / own.omega == pytest.approx(judge.period, rel=EQUAL)
        assert size(own, np.eye(1)) == pytest.approx(judge.norm, rel=EQUAL)
        compare_multipliers(floquet(osc, own), judge.multipliers)


def test_folds_of_the_quintic_oscillator_over_two_parameters(tmp_path):
    equations = "F(1)=U(2)\nF(2)=-(PAR(1)-U(1)**2+PAR(2)*U(1)**4)*U(2)-U(1)"
    settings = {"low": -0.1, "high": 0.3, "step": -0.02, "at": 0.05}
    judges = auto_runs.auto_folds(tmp_path, equations, 2, 0.2, 1.0, 100, **settings)
    judges = judges[np.argsort(judges[:, 2])]
    judges = judges[(judges[:, 2] > 0.45) & (judges[:, 2] < 2.0)][::15]
    assert np.ptp(judges[:, 2]) > 1.0

    def line(kappa):
        def force(x, v, nu):
            c = nu - x**2 + kappa * x**4
            return -c * v, (2 * x - 4 * kappa * x**3) * v, -c

        return lambda nu: models.scalar_oscillator(force, nu)

    def locate(kappa, guess):
        return BorderPoint(kappa, *fold_near(line(kappa), guess, (0.0, 0.3)))

    start = PeriodicMotion(np.zeros((31, 1)), 1.0, 0.125)
    start.Q[1] = 1.0
    found = {}
    for side in (-1.0, 1.0):
        points, end = follow_border(locate, locate(1.0, start), judges[:, 2], side, 0.3)
        assert end == "range"
        found |= {p.over: p.motion for p in points}
    for nu, time, kappa in judges:
        assert found[kappa].parameter == pytest.approx(nu, abs=EQUAL)
        assert 2 * np.pi / found[kappa].omega == pytest.approx(time, rel=EQUAL)


def test_van_der_pol(tmp_path):
    equations = "F(1)=U(2)\nF(2)=PAR(1)*U(2)-U(1)-U(1)**2*U(2)"
    _, cycles = auto_runs.auto_cycles(
        tmp_path, equations, 2, -0.5, low=-0.6, high=1.5, step=0.02, at=1.0, zeros=1, far=0.5
    )
    (judge,) = (p for p in cycles if p.kind == "UZ")
    osc = models.scalar_oscillator(models.van_der_pol, 1.0)
    (own,) = first_harmonics(osc, 41, 4.0)
    assert 2 * np.pi / own.omega == pytest.approx(judge.period, rel=EQUAL)
    assert size(own, np.eye(1)) == pytest.approx(judge.norm, rel=EQUAL)
    compare_multipliers(floquet(osc, own), judge.multipliers)


def hoffmann_terms(values):
    """Hoffmann's model with a cubic contact spring as it stands in a textbook: N, accelerations."""
    angles = np.deg2rad([150.0, 30.0])
    k = np.array([values["k1"], values["k2"]])
    c, s = np.cos(angles), np.sin(angles)
    k11, k12, k22 = (float(k @ x) for x in (c * c, c * s, s * s))
    return (
        [("N", 2, values["contact_stiffness"])],
        [[f"{-k11!r}*X1", f"{-k12!r}*X2", "-PAR(1)*N"]],
        [[f"{-k12!r}*X1", f"{-k22!r}*X2", "N", f"{-values['normal_force']!r}"]],
    )


def hulten_terms(values):
    """Hulten's model with cubic contact springs."""
    k = (2 * np.pi * np.array([100.0, values["frequency_2"]])) ** 2
    k = k.tolist()
    return (
        [("N", 1, k[0]), ("M", 2, k[1])],
        [["N", "-PAR(1)*M", "-100.0"]],
        [["M", "PAR(1)*N", "-100.0"]],
    )


def fortran(springs, forces, C, cubic):
    """Equations in mm and ms, one term a line."""
    lines = ["X1=U(1)*1D-3", "X2=U(2)*1D-3", "F(1)=U(3)", "F(2)=U(4)"]
    for name, x, k in springs:
        lines.append(f"{name}=({-k!r})*X{x}")
        lines.append(f"{name}={name}-({float(k / 5e11 * cubic)!r})*X{x}**3")
    for i, terms in enumerate(forces):
        lines.append(f"F({i + 3})=0D0")
        lines += [f"F({i + 3})=F({i + 3})+({term})*1D-3" for term in terms]
        lines += [f"F({i + 3})=F({i + 3})-({float(C[i, j])!r})*U({j + 3})*1D-3" for j in (0, 1)]
    return "\n".join(lines)


CASES = {  # values, textbook; friction of the cycles, range, cycles there
    "hoffmann": (models.BISTABLE, hoffmann_terms, 0.6, (0.05, 0.9), 2),
    "hulten": (models.HARDENING, hulten_terms, 0.305, (0.26, 0.4), 1),
}


@pytest.mark.parametrize("name", CASES)
def test_cubic_springs(tmp_path, name):
    """Hopf, fold, and the cycles beside stable steady sliding, by the house's contact laws."""
    values, terms, mu, (low, high), count = CASES[name]
    designs = models.Designs(name, values)
    springs, *forces = terms(values)
    contact = designs.at(friction=mu)
    rows = (contact.system.T1[0], contact.system.N[0]) if name == "hoffmann" else contact.system.N
    P = np.array(rows)  # q1, q2 of the textbook
    C = P @ contact.oscillator.C @ np.linalg.inv(P)
    text = fortran(springs, [f for (f,) in forces], C, values["contact.cubic_stiffness"])

    def steady(friction):
        """Of the textbook, m."""
        point = designs.at(friction=friction).point
        if name == "hulten":
            return point.gap
        k = {x: -float(t.partition("*")[0]) for t, x in zip(forces[0][0][:2], (1, 2), strict=True)}
        return np.array(
            [(-k[2] * point.gap[0] - friction * point.force[0, 0]) / k[1], point.gap[0]]
        )

    start = [*(1e3 * steady(low)).tolist(), 0.0, 0.0]
    rest, cycles = auto_runs.auto_cycles(
        tmp_path,
        text,
        4,
        low,
        start,
        low=low - 0.01,
        high=high,
        step=0.002,
        largest=0.01,
        at=mu,
        zeros=count,
    )
    hopf = next(p for p in rest if p.kind == "HB")
    lam, psi = models.linear_modes(contact.oscillator)
    assert lam[0].real < 0  # stable to small perturbations
    equations, curve = models.growth_curve(
        contact.oscillator,
        lam[0],
        psi[:, 0],
        1e-2,
        15,
        lambda m: contact.levels(m)["open_share_max"] > 0,
    )
    own = [equations.motion(p.u) for p in curve.at("C")]
    judges = [p for p in cycles if p.kind == "UZ"]
    assert len(own) == len(judges) == count
    for motion, judge in zip(own, judges, strict=True):
        assert 2e3 * np.pi / motion.omega == pytest.approx(judge.period, rel=EQUAL)
        norm = size(motion, P, (1e3, 1.0), steady(mu))
        assert norm == pytest.approx(judge.norm, rel=EQUAL)
        compare_multipliers(floquet(contact.oscillator, motion), judge.multipliers)
    points, end = branch(
        # AUTO has one damping for all frictions, a design its own
        lambda friction: replace(designs.at(friction=friction).oscillator, C=contact.oscillator.C),
        PeriodicMotion(own[-1].Q, own[-1].omega, mu),
        (low, high),
        -1.0 if count == 2 else 1.0,
        models.shrunk(contact.oscillator, 1e-4),
    )
    assert end == "hopf"
    assert points[-1].motion.parameter == pytest.approx(hopf.parameter, abs=EQUAL)
    folds = [p for p in points if p.event == FOLD]
    judges = [p for p in cycles if p.kind == "LP"]
    assert len(folds) == len(judges) == count - 1
    for motion, judge in zip(folds, judges, strict=True):
        assert motion.motion.parameter == pytest.approx(judge.parameter, abs=EQUAL)
        assert 2e3 * np.pi / motion.motion.omega == pytest.approx(judge.period, rel=EQUAL)


# -- a reduced brake -------------------------------------------------------------------------------
OPERATION = {"sliding_speed": 2.0, "pressure": 12e5}
FALLING = {"friction_law.static_ratio": 1.3, "friction_law.decay_speed": 2.0}
BRAKES = {  # regularisation, its speed, values; friction of AUTO's start, of the cycles
    "constant friction": ("regularised", 0.01, {}, 0.19, 0.21),
    "friction that falls": ("smooth", 0.4, FALLING, 0.12, 0.2),
}
BRAKE_HARMONICS = 9
LEVEL, MULTIPLIERS = 1e-5, 2e-5  # contact opens at a tenth of its area: harmonics fall off slowly


@pytest.mark.full_size
@pytest.mark.parametrize("name", BRAKES)
def test_a_brake_on_twelve_coordinates(tmp_path, prepared, name):
    """Exponential contact, no stick: two cycles beside stable sliding, their fold, the onset.

    By default minimal models above; of brakes test_cycles.py and test_brake_growth.py.
    """
    kind, saturation, values, start, mu = BRAKES[name]
    brake = auto_brake.SmallBrake(prepared, 0.2, kind, saturation, OPERATION | values)
    n, contact = brake.system.n, brake.at(mu)
    assert (n, len(brake.system.area)) == (12, 144)
    rest, cycles = auto_runs.run_auto(
        tmp_path,
        brake.write(tmp_path, start),
        2 * n,
        low=0.1,
        high=0.3,
        step=0.002,
        largest=0.01,
        at=mu,
        far=2.0,
        mesh=30,
    )
    lam, psi = models.linear_modes(contact.oscillator)
    assert lam[0].real < 0  # stable to small perturbations
    equations, curve = models.growth_curve(
        contact.oscillator,
        lam[0],
        psi[:, 0],
        3e-4,
        BRAKE_HARMONICS,
        lambda m: contact.contact_velocity(m) > 0.5 * OPERATION["sliding_speed"],
    )
    own = [equations.motion(p.u) for p in curve.at("C")]
    judges = [p for p in cycles if p.kind == "UZ"]
    assert len(own) == len(judges) == 2
    units = 1 / auto_brake.LENGTH, 1 / (auto_brake.LENGTH * auto_brake.RATE)
    for motion, judge in zip(own, judges, strict=True):
        levels = contact.levels(motion)
        assert levels["stick_share_max"] == 0.0
        assert period(motion) == pytest.approx(judge.period, rel=EQUAL)
        norm = size(motion, np.eye(n), units, brake.steady(mu)[0])
        assert norm == pytest.approx(judge.norm, rel=LEVEL)
        torque = brake.torque(mu, judge.states)
        mean = judge.mean(torque)
        assert levels["torque_mean"] == pytest.approx(mean, rel=LEVEL)
        rms = np.sqrt(judge.mean((torque - mean) ** 2))
        assert levels["torque_rms"] == pytest.approx(rms, rel=LEVEL)
        compare_multipliers(floquet(contact.oscillator, motion), judge.multipliers, MULTIPLIERS)
    points, end = branch(
        lambda friction: brake.at(friction).oscillator,
        PeriodicMotion(own[-1].Q, own[-1].omega, mu),
        (0.1, 0.3),
        -1.0,
        models.shrunk(contact.oscillator, 1e-4),
    )
    assert end == "hopf"
    hopf = next(p for p in rest if p.kind == "HB")
    assert points[-1].motion.parameter == pytest.approx(hopf.parameter, abs=EQUAL)
    (fold,) = (p.motion for p in points if p.event == FOLD)
    (judge,) = (p for p in cycles if p.kind == "LP")
    assert fold.parameter == pytest.approx(judge.parameter, abs=EQUAL)
    assert period(fold) == pytest.approx(judge.period, rel=EQUAL)
    tori = [p.parameter for p in cycles if p.kind == "TR"]
    for point in points:  # steps next to a fold are not looked through
        if point.event == NS:
            assert min(abs(point.motion.parameter - x) for x in tori) <= EQUAL


def period(motion):
    """In AUTO's unit of time."""
    return 2 * np.pi * auto_brake.RATE / motion.omega
