"""Stick-slip of the mass on a belt by phases, friction without regularisation: a judge of runs.

While it sticks the mass goes with the belt, x' = -v, until the spring and its damper ask for static
friction; then it slips, m x'' + c x' + k x = -F mu(v + x'), until v + x' is zero again. Nothing
of the package is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import quad, solve_ivp


@dataclass(frozen=True)
class StickSlip:
    """One period: its frequency [Hz], RMS of the friction force about its mean [N], share stuck."""

    frequency_hz: float
    rms: float
    peak_to_peak: float
    stuck_share: float


def stick_slip(
    mass: float,
    stiffness: float,
    normal_force: float,
    friction: float,
    static_ratio: float,
    decay_speed: float,
    sliding_speed: float,
    damping_ratio: float,
) -> StickSlip:
    """The cycle that sticks once in a period, in SI units."""
    v, c = sliding_speed, 2 * damping_ratio * np.sqrt(mass * stiffness)

    def slipping(s: float) -> float:
        excess = (static_ratio - 1) * np.exp(-s / decay_speed)
        return normal_force * friction * (1 + excess)

    def rates(_: float, y: np.ndarray) -> list[float]:
        force = slipping(max(v + y[1], 0.0))
        return [y[1], (-force - c * y[1] - stiffness * y[0]) / mass, force, force**2]

    def sticks(t: float, y: np.ndarray) -> float:
        return v + y[1] if t > 1e-9 else 1.0

    sticks.terminal, sticks.direction = True, -1
    top = slipping(0.0)
    begins = (c * v - top) / stiffness
    nudge = 1e-9 * v  # off the unstable state in which static friction just holds
    period = 2 * np.pi * np.sqrt(mass / stiffness)
    slip = solve_ivp(
        rates,
        (0, 3 * period),
        [begins, -v + nudge, 0.0, 0.0],
        method="DOP853",
        events=sticks,
        rtol=1e-10,
        atol=1e-13,
    )
    assert slip.status == 1, "the mass does not stick again"
    x, _, impulse, square = slip.y[:, -1]
    duration = (x - begins) / v
    low = c * v - stiffness * x
    impulse += quad(lambda t: low + stiffness * v * t, 0, duration)[0]
    square += quad(lambda t: (low + stiffness * v * t) ** 2, 0, duration)[0]
    whole = slip.t[-1] + duration
    mean = impulse / whole
    least = min(low, normal_force * friction)
    return StickSlip(
        frequency_hz=1 / whole,
        rms=float(np.sqrt(square / whole - mean**2)),
        peak_to_peak=top - least,
        stuck_share=duration / whole,
    )
