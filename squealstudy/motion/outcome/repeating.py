"""Motions that stick for most of each period and come back the same: stick-slip.

While all of the contact sticks what went before is forgotten, so that a period which is like the
one before is like all that follow. Whatever the linear growth at steady sliding, it says nothing
about such a motion: nor how it goes on, nor when that would be known.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.fundamental import fundamental_hz
from squealstudy.motion.outcome.levels import LAST

MOSTLY = 0.5  # share of the time and area that sticks
ALL = 0.99  # share of the area, once in each period at least
PERIODS = 5  # that must be alike
ROWS = 40  # of a period, at least: fewer do not tell its level to `SAME`
SAME = 0.01  # relative: spread of the levels of successive periods, that of a row at its ends too
LONGER = 1.25  # times: the least duration that is asked for


def sticks_mostly(run: Motion) -> bool:
    """Whether contact sticks for most of the last part of a run, and all of it at a time."""
    stick = run.history["stick"][_last(run)]
    return bool(len(stick) and stick.mean() >= MOSTLY and stick.max() >= ALL)


def repeats(run: Motion) -> bool:
    """Whether the last part of a run is stick-slip that comes back the same, five times or more."""
    last = _last(run)
    period = 1.0 / (_hz(run) * _step(run)) if sticks_mostly(run) else np.nan
    count = int(len(run.times[last]) / period) if period >= ROWS else 0
    if count < PERIODS:
        return False
    ends = len(run.times) - np.round(period * np.arange(count, -1, -1)).astype(int)
    parts = [slice(a, b) for a, b in pairwise(ends.tolist())]
    if min(float(run.history["stick"][part].max()) for part in parts) < ALL:
        return False
    force = run.history["torque"]
    level = np.array([force[part].std() for part in parts])
    mean = np.array([force[part].mean() for part in parts])  # a peak is one row's alone
    return all(bool(np.ptp(x) <= SAME * level.mean()) for x in (level, mean))


def decided_by(run: Motion) -> float:
    """The duration after which stick-slip of a run would be known to repeat, s.

    Infinite where the run has periods enough, which are not alike, or none that is told.
    """
    hz, end = _hz(run), float(run.times[-1])
    until = LONGER * (PERIODS + 1) / (LAST * hz) if hz > 0 else np.inf
    return until if until > end else np.inf


def _last(run: Motion) -> slice:
    return slice(round((1 - LAST) * len(run.times)), None)


def _step(run: Motion) -> float:
    return float(run.times[-1] - run.times[0]) / max(len(run.times) - 1, 1)


def _hz(run: Motion) -> float:
    last = _last(run)
    return fundamental_hz(_step(run), run.sensed_q[last], run.sensed_v[last], run.omega)
