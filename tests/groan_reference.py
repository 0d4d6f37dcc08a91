"""Independent judge of a pad on a caliper over a belt: Coulomb's friction in pieces.

Nothing of the package is imported. Between events one phase holds, sticking or sliding ahead or
back, and DOP853 integrates it; each piece ends where the phase does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

STICK, AHEAD, BACK = 0.0, 1.0, -1.0


@dataclass(frozen=True)
class Groan:
    """Pad of 1 kg on a caliper of 6 kg; along x, against the belt's motion."""

    speed: float  # m/s
    pad: float = 1.0  # kg
    caliper: float = 6.0
    between: float = 7e6  # N/m
    mount: float = 1.5e6
    ratio: float = 0.01  # modal damping
    force: float = 1500.0  # N
    friction: float = 0.4
    static: float = 1.5  # over friction
    decay: float = 0.1  # m/s

    def matrices(self) -> tuple[np.ndarray, np.ndarray]:
        """M^-1 K and M^-1 C of pad and caliper."""
        M = np.diag([self.pad, self.caliper])
        K = np.array([[self.between, -self.between], [-self.between, self.between + self.mount]])
        root = np.diag(np.diag(M) ** -0.5)
        squares, shapes = np.linalg.eigh(root @ K @ root)
        C = shapes @ np.diag(2 * self.ratio * np.sqrt(squares)) @ shapes.T
        inverse = np.linalg.inv(M)
        return inverse @ K, inverse @ np.linalg.inv(root) @ C @ np.linalg.inv(root)

    def drag(self, slip: float) -> float:
        """Size of the friction force [N] at a slip [m/s]."""
        falls = (self.static - 1.0) * np.exp(-abs(slip) / self.decay)
        return self.force * self.friction * (1.0 + falls)

    def run(self, duration: float, sample: float) -> tuple[np.ndarray, np.ndarray]:
        """Times and friction forces on the belt; from steady sliding with a kick of 0.1 m/s."""
        K, C = self.matrices()
        x = np.linalg.solve(K, [-self.drag(self.speed) / self.pad, 0.0])
        y, t, phase = np.concatenate([x, [0.1, 0.0]]), 0.0, AHEAD
        times = np.arange(0.0, duration, sample)
        forces = np.zeros(len(times))

        def free(y: np.ndarray) -> np.ndarray:
            return -K @ y[:2] - C @ y[2:]

        def rate(t: float, y: np.ndarray, phase: float) -> np.ndarray:
            a = free(y)
            if phase == STICK:
                a[0] = 0.0
            else:
                a[0] -= phase * self.drag(self.speed + y[2]) / self.pad
            return np.concatenate([y[2:], a])

        def ends(t: float, y: np.ndarray, phase: float) -> float:
            if phase == STICK:  # what holds the pad, over what can
                return float(self.drag(0.0) - abs(self.pad * free(y)[0]))
            return float(phase * (self.speed + y[2]))

        ends.terminal = True  # type: ignore[attr-defined]
        ends.direction = -1.0  # type: ignore[attr-defined]
        while t < duration:
            found = solve_ivp(
                rate, (t, duration), y, "DOP853", args=(phase,), events=ends,
                dense_output=True, rtol=1e-9, atol=1e-12,
            )  # fmt: skip
            inside = (times >= t) & (times <= found.t[-1])
            states = found.sol(times[inside])
            if phase == STICK:
                forces[inside] = [self.pad * free(s)[0] for s in states.T]
            else:
                forces[inside] = [phase * self.drag(self.speed + s[2]) for s in states.T]
            t, y = float(found.t[-1]), found.y[:, -1]
            if found.status != 1:
                break
            if phase == STICK:
                phase = AHEAD if free(y)[0] > 0 else BACK
                y[2] = -self.speed + phase * 1e-12
            else:
                y[2] = -self.speed
                held = self.pad * free(y)[0]
                phase = STICK if abs(held) < self.drag(0.0) else float(np.sign(held))
        return times, forces

    def levels(self, duration: float, window: float) -> tuple[float, float, float]:
        """Mean and RMS [N] of the friction force over the last `window` s, and its line [Hz]."""
        sample = 2e-5
        times, forces = self.run(duration, sample)
        last = forces[times >= duration - window]
        spectrum = np.abs(np.fft.rfft((last - last.mean()) * np.hanning(len(last))))
        line = np.fft.rfftfreq(len(last), sample)[spectrum.argmax()]
        return float(last.mean()), float(last.std()), float(line)
