"""Whether a run has come to a cycle that is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.harmonics import series_at
from squealstudy.motion.motion import Motion

ARRIVED = "arrived at cycle "  # begins why a run stopped; the cycle's number follows
ARRIVAL_PERIODS = 8  # periods of a cycle for which a run has to be close to it
ORBIT_SAMPLES = 256  # states of a cycle, to the nearest of which distances are taken
# largest distance to a cycle over the RMS of its state: half a step between samples is a tenth of
# that at 3 harmonics, and a level of this error is within the tolerance of levels
ARRIVAL_REL_DISTANCE = 0.05

Judge = Callable[[int, Motion], str]


def arrived_at(motion: Motion) -> int | None:
    """Number, from 0, of the cycle that a run stopped at; None where it did not."""
    return int(motion.stopped[len(ARRIVED) :]) if motion.stopped.startswith(ARRIVED) else None


def or_arrived(judge: Judge, every: int, cycles: Sequence[PeriodicMotion], steps: int) -> Judge:
    """A watch's test, made every so many steps, which also stops runs at one of the cycles.

    It is called every `steps` steps.
    """

    def watched(k: int, motion: Motion) -> str:
        for number, cycle in enumerate(cycles):
            if _is_near(motion, cycle):
                return f"{ARRIVED}{number}"
        return judge(k, motion) if motion.steps % every < steps else ""

    return watched


def steps_to_arrive(cycles: Sequence[PeriodicMotion], step: float) -> int:
    """Steps of the longest stretch for which a run is held against cycles."""
    return round(ARRIVAL_PERIODS * 2 * np.pi / (min(c.omega for c in cycles) * step))


def _is_near(motion: Motion, cycle: PeriodicMotion) -> bool:
    """Whether a run has been close to a stable cycle for some periods, and goes no further away."""
    begin = motion.times[-1] - ARRIVAL_PERIODS * 2 * np.pi / cycle.omega
    rows = slice(int(np.searchsorted(motion.times, begin)), None)
    if begin < 0.0:
        return False
    theta = 2 * np.pi * np.arange(ORBIT_SAMPLES) / ORBIT_SAMPLES
    synthesis, slope = series_at(theta, cycle.harmonics)
    Q = cycle.Q[:, motion.sensed - 1]
    orbit = np.hstack([synthesis @ Q * motion.omega, cycle.omega * (slope @ Q)])
    states = np.hstack([motion.sensed_q[rows] * motion.omega, motion.sensed_v[rows]])
    size = float(((orbit - orbit.mean(axis=0)) ** 2).sum(axis=1).mean())
    last = ((states[-1] - orbit) ** 2).sum(axis=1).min()
    if not last <= ARRIVAL_REL_DISTANCE**2 * size:
        return False
    squares = ((states[:, None, :] - orbit[None]) ** 2).sum(axis=2).min(axis=1)
    first, second = (float(half.mean()) for half in np.array_split(squares, 2))
    return bool(squares.max() <= ARRIVAL_REL_DISTANCE**2 * size and second <= 1.1 * first)
