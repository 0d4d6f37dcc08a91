"""Independent judge of a block on a belt, held by springs that are not linear.

Nothing of the package is imported. Between events one phase holds, sticking or sliding ahead or
back, on one straight part of the stop; DOP853 integrates it, and each piece ends where that does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

STICK, AHEAD, BACK = 0.0, 1.0, -1.0


@dataclass(frozen=True)
class Block:
    """x is against the belt's motion; a spring with a third power and a stop hold the block.

    The stop acts where x < -gap (side -1), x > gap (1) or both (0).
    """

    speed: float  # m/s, of the belt along -x
    mass: float = 1.0  # kg
    stiffness: float = 4e4  # N/m
    cubic: float = 0.0  # N/m3
    damping: float = 4.0  # N s/m
    stop: float = 0.0  # N/m
    stop_cubic: float = 0.0  # N/m3
    gap: float = 0.0  # m
    side: float = 0.0
    force: float = 100.0  # N
    friction: float = 0.4
    static: float = 2.0  # over friction
    decay: float = 0.2  # m/s
    exponent: float = 1.0  # of the fall
    rise: float = 0.0  # s/m, over friction

    def beyond(self, x: float) -> float:
        """Deflection of the stop."""
        if self.side >= 0 and x > self.gap:
            return x - self.gap
        return x + self.gap if self.side <= 0 and x < -self.gap else 0.0

    def pull(self, x: float, v: float) -> float:
        """Force of springs and damper on the block."""
        d = self.beyond(x)
        held = self.stiffness * x + self.cubic * x**3 + self.stop * d + self.stop_cubic * d**3
        return -held - self.damping * v

    def drag(self, slip: float) -> float:
        """Size of the friction force at a slip [m/s]."""
        falls = (self.static - 1.0) * np.exp(-((abs(slip) / self.decay) ** self.exponent))
        return self.force * self.friction * (1.0 + falls + self.rise * abs(slip))

    def steady(self) -> float:
        """Deflection of steady sliding: the belt pulls the block along -x."""
        low, high = -1.0, 0.0
        for _ in range(200):
            x = 0.5 * (low + high)
            low, high = (x, high) if self.pull(x, 0.0) > self.drag(self.speed) else (low, x)
        return x

    def run(
        self, duration: float, sample: float, kick: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times, deflections and friction forces, positive where they brake the belt."""
        t, y, phase = 0.0, np.array([self.steady(), kick]), AHEAD
        times = np.arange(0.0, duration, sample)
        shown, forces = np.zeros(len(times)), np.zeros(len(times))

        def rate(t: float, y: np.ndarray, phase: float) -> np.ndarray:
            if phase == STICK:
                return np.array([y[1], 0.0])
            drag = -phase * self.drag(self.speed + y[1])
            return np.array([y[1], (self.pull(*y) + drag) / self.mass])

        def ends(t: float, y: np.ndarray, phase: float) -> float:
            if phase == STICK:
                return self.drag(0.0) - abs(self.pull(*y))
            return phase * (self.speed + y[1])

        def upper(t: float, y: np.ndarray, phase: float) -> float:
            return y[0] - self.gap

        def lower(t: float, y: np.ndarray, phase: float) -> float:
            return y[0] + self.gap

        ends.terminal, ends.direction = True, -1
        upper.terminal = lower.terminal = True
        k = 0
        while t < duration:
            found = solve_ivp(
                rate,
                (t, duration),
                y,
                method="DOP853",
                rtol=1e-10,
                atol=1e-12,
                events=(ends, upper, lower),
                args=(phase,),
                dense_output=True,
            )
            while k < len(times) and times[k] <= found.t[-1]:
                x, v = found.sol(times[k])
                shown[k] = x
                forces[k] = self.pull(x, v) if phase == STICK else phase * self.drag(self.speed + v)
                k += 1
            t, y = found.t[-1], found.y[:, -1]
            if len(found.t_events[0]):
                phase = self._next(phase, y)
                if phase == STICK:
                    y[1] = -self.speed
                else:  # off the corner, for the next piece not to end at once
                    y[1] = -self.speed + phase * 1e-11
            elif t < duration:  # a corner of the stop: go on behind it
                y = y + 1e-12 * rate(t, y, phase)
                t += 1e-12
        return times, shown, forces

    def _next(self, phase: float, y: np.ndarray) -> float:
        held = self.pull(y[0], -self.speed)
        if phase != STICK and abs(held) <= self.drag(0.0):
            return STICK
        return AHEAD if held > 0 else BACK

    def levels(self, duration: float, skip: float, kick: float) -> dict[str, float]:
        """Mean and RMS of friction, frequency, and the ends of the motion, after `skip` s."""
        sample = 2e-5
        times, x, force = self.run(duration, sample, kick)
        own = times >= skip
        t, x, force = times[own], x[own], force[own]
        middle = x - x.mean()
        up = np.flatnonzero((middle[:-1] < 0) & (middle[1:] >= 0))
        crossed = t[up] - middle[up] * (t[up + 1] - t[up]) / (middle[up + 1] - middle[up])
        whole = (t >= crossed[0]) & (t < crossed[-1])
        return {
            "mean": float(force[whole].mean()),
            "rms": float(force[whole].std()),
            "frequency_hz": float((len(crossed) - 1) / (crossed[-1] - crossed[0])),
            "low": float(x.min()),
            "high": float(x.max()),
        }
