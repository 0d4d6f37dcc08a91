"""Motions that come back the same after a period: stick-slip, and other periodic motion.

While all of the contact sticks what went before is forgotten, so that a period which is like the
one before is like all that follow. Whatever the linear growth at steady sliding, it says nothing
about such a motion: nor how it goes on, nor when that would be known. Motion that sticks for a
part of the period at most comes back the same where it is a limit cycle, or where small motion
neither grows nor decays in the time that is judged.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.fundamental import EXACT_PERIOD_RESIDUAL
from squealstudy.motion.outcome.levels import JUDGED_SHARE
from squealstudy.motion.outcome.own_frequency import judged_window, own_frequency

MIN_STICK_SHARE = 0.5  # share of the time and area that sticks
ALL_STUCK_AREA_SHARE = 0.99  # share of the area, once in each period at least
N_EQUAL_PERIODS = 5  # that must be alike
# of a period, at least: fewer do not tell its level to `MAX_REL_PERIOD_SPREAD`
MIN_ROWS_PER_PERIOD = 40
# relative: spread of the levels of successive periods, that of a row at its ends too
MAX_REL_PERIOD_SPREAD = 0.01
DURATION_FACTOR = 1.25  # times: the least duration that is asked for
# of motion that sticks for less
MIN_JUDGED_PERIODS = 8.0  # periods in the window that is judged
# of the RMS velocity: difference of the first and the second half of them
MAX_HALVES_DIFFERENCE = 5e-3
# of the contact, in the mean: its friction is not that of small motions
MIN_MEAN_STICK_SHARE = 0.05
WOULD_CHANGE = 0.25  # of the logarithm: what growth or decay of small motions would have made of it


def sticks_mostly(run: Motion) -> bool:
    """Whether contact sticks for most of the last part of a run, and all of it at a time."""
    stick = run.history["stick"][_last(run)]
    return bool(
        len(stick) and stick.mean() >= MIN_STICK_SHARE and stick.max() >= ALL_STUCK_AREA_SHARE
    )


def repeats_stick_slip(run: Motion) -> bool:
    """Whether the last part of a run is stick-slip that comes back the same, five times or more."""
    last = _last(run)
    period = 1.0 / (_hz(run) * _step(run)) if sticks_mostly(run) else np.nan
    count = int(len(run.times[last]) / period) if period >= MIN_ROWS_PER_PERIOD else 0
    if count < N_EQUAL_PERIODS:
        return False
    ends = len(run.times) - np.round(period * np.arange(count, -1, -1)).astype(int)
    parts = [slice(a, b) for a, b in pairwise(ends.tolist())]
    if min(float(run.history["stick"][part].max()) for part in parts) < ALL_STUCK_AREA_SHARE:
        return False
    force = run.history["torque"]
    level = np.array([force[part].std() for part in parts])
    mean = np.array([force[part].mean() for part in parts])  # a peak is one row's alone
    return all(bool(np.ptp(x) <= MAX_REL_PERIOD_SPREAD * level.mean()) for x in (level, mean))


def decided_by(run: Motion) -> float:
    """The duration after which stick-slip of a run would be known to repeat, s.

    Infinite where the run has periods enough, which are not alike, or none that is told.
    """
    hz, end = _hz(run), float(run.times[-1])
    until = DURATION_FACTOR * (N_EQUAL_PERIODS + 1) / (JUDGED_SHARE * hz) if hz > 0 else np.inf
    return until if until > end else np.inf


def _last(run: Motion) -> slice:
    return slice(round((1 - JUDGED_SHARE) * len(run.times)), None)


def _step(run: Motion) -> float:
    return float(run.times[-1] - run.times[0]) / max(len(run.times) - 1, 1)


def _hz(run: Motion) -> float:
    return own_frequency(run, _last(run)).hz


def comes_back(run: Motion) -> bool:
    """Whether a run has come to a periodic motion that small motions would not explain.

    All modes that grow are followed, the sensed modes come back after a period within 1 %, at
    least eight times and as fast in both halves of these; and a part of the contact sticks for a
    while, or every followed complex mode would have changed the motion by a quarter. In the window
    that is judged, or in its second half: growth may have filled the first.
    """
    modes = run.point.growing
    finite = run.outcome == "ok" and np.isfinite(run.modal_energy).all()
    if not finite or modes.n_outside or modes.n_unstable > modes.n_followed:
        return False
    rows = len(run.times)
    judged = judged_window(run)
    late = slice(rows - (rows - judged.start) // 2, rows)
    return any(_is_periodic(run, window) for window in (judged, late))


def _is_periodic(run: Motion, window: slice) -> bool:
    """The same of a window of the run."""
    time, v = run.times[window], run.sensed_v[window]
    if len(time) < MIN_ROWS_PER_PERIOD:
        return False
    length, lam = float(time[-1] - time[0]), run.point.growing.lam
    pace = float(np.abs(np.real(lam)).min()) if len(lam) else 0.0
    stick = run.history["stick"][window]
    sticks = np.ptp(stick) > 0.0 and stick.mean() >= MIN_MEAN_STICK_SHARE
    if not (sticks or pace * length >= WOULD_CHANGE):
        return False
    step = length / (len(time) - 1)
    hz, residual, _ = own_frequency(run, window)
    if not (length * hz >= MIN_JUDGED_PERIODS and residual <= EXACT_PERIOD_RESIDUAL):
        return False
    half = round(np.floor(0.5 * length * hz) / (hz * step))  # rows of whole periods
    first, second = (float((x**2).sum()) for x in (v[-2 * half : -half], v[-half:]))
    return abs(np.sqrt(second / first) - 1.0) <= MAX_HALVES_DIFFERENCE
