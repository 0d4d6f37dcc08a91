"""Independent judge of a pad on a caliper over a belt whose speed, or press, changes over time.

Nothing of the package is imported. Between events, and between points of the schedules, one phase
holds, sticking or sliding ahead or back, and DOP853 integrates it; a piece ends where its phase
does. Friction opposes the slip, whichever way the belt runs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from groan_reference import AHEAD, BACK, STICK, Groan
from scipy.integrate import solve_ivp

Points = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Scheduled(Groan):
    """`Groan` under a speed [m/s] and a press [N] by straight lines between points (s, value)."""

    speeds: Points = ()
    presses: Points = ()
    curve: Callable[[float], float] | None = None  # friction coefficient over |slip|; None: falling

    def at(self, points: Points, t: float, value: float) -> tuple[float, float]:
        """Value and slope at a time; constant beyond the ends."""
        if not points:
            return value, 0.0
        times, values = np.array(points).T
        k = int(np.searchsorted(times, t, side="right")) - 1
        if k < 0 or k >= len(times) - 1:
            return float(values[0] if k < 0 else values[-1]), 0.0
        slope = float((values[k + 1] - values[k]) / (times[k + 1] - times[k]))
        return float(values[k] + slope * (t - times[k])), slope

    def bound(self, slip: float, t: float) -> float:
        """Size of the friction force [N] at a slip [m/s] and a time."""
        force, _ = self.at(self.presses, t, self.force)
        if self.curve is not None:
            return force * self.curve(abs(slip))
        return force * self.drag(slip) / self.force

    def follow(
        self, duration: float, sample: float, y: Sequence[float], phase: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times, friction forces on the belt and states (rows, 4) from a state and a phase."""
        K, C = self.matrices()
        y, t = np.array(y, dtype=float), 0.0
        times = np.arange(0.0, duration, sample)
        forces, states = np.zeros(len(times)), np.zeros((len(times), 4))
        knots = sorted({x for x, _ in (*self.speeds, *self.presses) if 0.0 < x < duration})

        def free(y):
            return -K @ y[:2] - C @ y[2:]

        def slip(t, y):
            return self.at(self.speeds, t, self.speed)[0] + y[2]

        def held(t, y):  # friction force on the belt that keeps the pad on it
            _, slope = self.at(self.speeds, t, self.speed)
            return self.pad * (free(y)[0] + slope)

        def rate(t, y, phase):
            a = free(y)
            if phase == STICK:
                a[0] = -self.at(self.speeds, t, self.speed)[1]
            else:
                a[0] -= phase * self.bound(slip(t, y), t) / self.pad
            return np.concatenate([y[2:], a])

        def ends(t, y, phase):
            if phase == STICK:
                return self.bound(0.0, t) - abs(held(t, y))
            return phase * slip(t, y)

        ends.terminal, ends.direction = True, -1.0
        while t < duration:
            until = min([x for x in knots if x > t * (1 + 1e-14)] + [duration])
            found = solve_ivp(
                rate, (t, until), y, "DOP853", args=(phase,), events=ends,
                dense_output=True, rtol=1e-9, atol=1e-12, max_step=2e-3,
            )  # fmt: skip
            inside = (times >= t) & (times <= found.t[-1])
            if inside.any():
                states[inside] = found.sol(times[inside]).T
            for k in np.flatnonzero(inside):
                now = states[k]
                sliding = phase * self.bound(slip(times[k], now), times[k])
                forces[k] = held(times[k], now) if phase == STICK else sliding
            t, y = float(found.t[-1]), found.y[:, -1]
            if found.status != 1:
                if phase == STICK and abs(held(t, y)) > self.bound(0.0, t):
                    phase = AHEAD if held(t, y) > 0 else BACK  # the belt's pull jumps at a knot
                    y[2] += phase * 1e-12
                continue
            now = self.at(self.speeds, t, self.speed)[0]
            if phase == STICK:
                phase = AHEAD if held(t, y) > 0 else BACK
                y[2] = -now + phase * 1e-12
            else:
                y[2] = -now
                pull = held(t, y)
                phase = STICK if abs(pull) < self.bound(0.0, t) else float(np.sign(pull))
        return times, forces, states

    def steady(self) -> np.ndarray:
        """Displacements of steady sliding at `speed` and `force`."""
        K, _ = self.matrices()
        drag = np.sign(self.speed) * self.drag(self.speed)
        return np.linalg.solve(K, [-drag / self.pad, 0.0])
