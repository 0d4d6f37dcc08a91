"""Cycles of the mass on a belt by balance against return maps, integrated from kink to kink."""

from __future__ import annotations

from dataclasses import dataclass

import cycle_models as models
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from squealstudy.cycles.branch import HOPF, SHRUNK, branch
from squealstudy.cycles.cycle import Search
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.families import families
from squealstudy.cycles.folds import FOLD

W, FORCE, XI = 200 * np.pi, 200 * np.pi, 0.05  # the model's defaults, mass 1 kg
DYNAMIC, RATIO, FALL = 0.5, 2.0, 0.5
SPEED, SATURATION = 1.3, 0.4  # m/s; soft: friction is straight up to about .3 m/s
EQUAL = 1e-3
DENSE = 400  # points between two kinks


@dataclass(frozen=True)
class Belt:
    """x'' + 2 xi w x' + w^2 x = -f(v + x'), f straight up to its bound mu(s) F."""

    speed: float
    saturation: float = SATURATION

    def bound(self, s):
        return FORCE * DYNAMIC * (1 + (RATIO - 1) * np.exp(-s / FALL))

    def beyond(self, s):
        """Positive where the straight line is above the bound."""
        return DYNAMIC * RATIO * FORCE / self.saturation * s - self.bound(s)

    def force(self, s):
        """Straight up to the bound."""
        return np.where(self.beyond(s) > 0, self.bound(s), self.bound(s) + self.beyond(s))

    def period_from(self, top):
        """From a largest displacement about steady sliding to the next: it, time, forces, speeds.

        Integration ends and begins anew at each kink of the law.
        """
        rest = -self.bound(self.speed) / W**2
        t, y = 0.0, np.array([rest + top, -1e-13])
        parts = []

        def rates(_, y):
            f = float(self.force(self.speed + y[1]))
            return [y[1], -2 * XI * W * y[1] - W**2 * y[0] - f]

        def kink(_, y):
            return self.beyond(self.speed + y[1])

        def turned(_, y):
            return y[1]

        kink.terminal = turned.terminal = True
        kink.direction = turned.direction = -1.0
        while True:
            run = solve_ivp(
                rates,
                (t, 0.02),
                y,
                "DOP853",
                events=(kink, turned),
                rtol=1e-9,
                atol=1e-12,
                dense_output=True,
            )
            dense = np.linspace(t, run.t[-1], DENSE)
            v = run.sol(dense)[1]
            parts.append((dense, self.force(self.speed + v), v))
            t, y = float(run.t[-1]), run.y[:, -1]
            if not run.t_events[0].size:
                break
            kink.direction *= -1.0
        assert run.t_events[1].size
        return y[0] - rest, t, *(np.concatenate(x) for x in zip(*parts, strict=True))

    def gain(self, top):
        return self.period_from(top)[0] - top

    def best(self):
        """The displacement that a period changes least to its disadvantage, and what it gains."""
        low, high = 0.6 * self.speed / W, 1.2 * self.speed / W
        found = minimize_scalar(
            lambda x: -self.gain(x), bounds=(low, high), method="bounded", options={"xatol": 1e-8}
        )
        return found.x, -found.fun

    def cycle(self, low, high):
        return self.period_from(brentq(self.gain, low, high, xtol=1e-12))


def level(times, forces):
    mean = np.trapezoid(forces, times) / times[-1]
    return np.sqrt(np.trapezoid((forces - mean) ** 2, times) / times[-1])


@pytest.fixture(scope="module")
def designs():
    return models.Designs("belt", {"sliding_speed": SPEED}, law=None, saturation=SATURATION)


@pytest.fixture(scope="module")
def found(designs):
    contact = designs.at()
    search = Search(None, 5e-4, 1.2 * SPEED)
    ((_, family),) = families(contact, (1.0, 1e6), [1], 1e-9, search).families
    return family


def test_both_cycles_of_a_soft_belt(found):
    belt = Belt(SPEED)
    top, gain = belt.best()
    assert gain > 0
    judges = belt.cycle(0.3 * top, top), belt.cycle(top, 1.3 * top)
    inner, outer = found.cycles
    assert (inner.multipliers.n_unstable, outer.attracts) == (1, True)
    for cycle, (_, period, times, forces, speeds) in zip(found.cycles, judges, strict=True):
        assert cycle.status == "ok"
        assert cycle.motion.omega * period / (2 * np.pi) == pytest.approx(1, abs=EQUAL)
        assert cycle.levels["torque_rms"] == pytest.approx(level(times, forces), rel=EQUAL)
        assert cycle.levels["contact_velocity"] == pytest.approx(np.abs(speeds).max(), rel=EQUAL)
    assert outer.levels["contact_velocity"] > SPEED - SATURATION  # friction is not saturated there


@pytest.mark.parametrize("saturation", [0.3, SATURATION, 0.45])
def test_the_fold_of_a_soft_belt_over_its_speed(saturation):
    """Where no displacement gains in a period any more; kinks pass nodes of time beside it."""
    designs = models.Designs("belt", {"sliding_speed": SPEED}, law=None, saturation=saturation)
    search = Search(None, 5e-4, 1.2 * SPEED)
    ((_, family),) = families(designs.at(), (1.0, 1e6), [1], 1e-9, search).families
    start = family.cycles[1].motion
    points, end = branch(
        lambda speed: designs.at(sliding_speed=speed).oscillator,
        PeriodicMotion(start.Q, start.omega, SPEED),
        (0.5, 3.0),
        1.0,
        models.shrunk(designs.at().oscillator, 1e-4),
    )
    assert ([p.event for p in points if p.event], end) == ([FOLD, HOPF], SHRUNK)
    fold = next(p for p in points if p.event == FOLD)
    speeds = 0.98 * fold.motion.parameter, 1.02 * fold.motion.parameter
    exact = brentq(lambda v: Belt(v, saturation).best()[1], *speeds, xtol=1e-7)
    assert abs(fold.motion.parameter - exact) < fold.apart < 2e-4
