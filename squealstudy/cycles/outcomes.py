"""What a run in time has come to, of those that limit cycles and design studies make.

Classes are those of studies in time but for two kinds of runs. A motion that repeats lasts whatever
its levels say of the way to it: stick-slip is reached within a period. Of an undamped model nothing
lasts by itself, for any motion stays that a run begins with.
"""

from __future__ import annotations

import numpy as np

from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.behaviour import LEAST_DAMPING
from squealstudy.motion.outcome.energies import moving_energy
from squealstudy.motion.outcome.fundamental import fundamental_hz
from squealstudy.motion.outcome.levels import last_window, torque_levels
from squealstudy.motion.outcome.settling import LEAST_ROWS, SETTLED, known_outcome
from squealstudy.motion.outcome.verdict import expected_rise, run_verdict
from squealstudy.wording import LASTING, LIMIT_CYCLE, UNDECIDED

PERIODS = 8.0  # of a motion that repeats, in the window that is judged
EVEN = 5e-3  # of the RMS velocity: difference of the first and the second half of them
STICKS = 0.05  # of the contact, in the mean: its friction is not that of small motions
WOULD_CHANGE = 0.25  # of the logarithm: what growth or decay of small motions would have made of it


def class_of(run: Motion) -> str:
    """Class of a finished run (`wording`)."""
    name = run_verdict(run, moving_energy(run)).name
    if name in LASTING and _undamped(run):
        return UNDECIDED
    return LIMIT_CYCLE if name == UNDECIDED and repeats(run) else name


def known_so_far(run: Motion, duration: float, tolerance: float) -> str:
    """`known_outcome`, or ``settled`` of a motion that repeats, in which nothing else rises.

    Its level is known within the tolerance, too.
    """
    known = known_outcome(run, duration, tolerance)
    if known or len(run.times) < LEAST_ROWS or not repeats(run):
        return known
    torque = run.history["torque"]
    window = last_window(run.times, torque)
    levels = torque_levels(run.times[window], torque[window])
    if not 0.5 * (levels.rms_high - levels.rms_low) <= tolerance * levels.rms:
        return ""
    return SETTLED if expected_rise(run, window, duration) <= 2 * tolerance else ""


def repeats(run: Motion) -> bool:
    """Whether a run has come to a periodic motion that small motions would not explain.

    All modes that grow are followed, the sensed modes come back after a period (`fundamental_hz`),
    at least eight times and as fast in both halves of these; and a part of the contact sticks for a
    while, or every followed complex mode would have changed the motion by a quarter.
    """
    modes = run.point.growing
    finite = run.outcome == "ok" and np.isfinite(run.modal_energy).all()
    if not finite or modes.n_outside or modes.n_unstable > modes.n_followed:
        return False
    window = last_window(run.times, run.history["torque"])
    time, v = run.times[window], run.sensed_v[window]
    if len(time) < LEAST_ROWS:
        return False
    length = float(time[-1] - time[0])
    pace = float(np.abs(np.real(modes.lam)).min()) if len(modes.lam) else 0.0
    stick = run.history["stick"][window]
    sticks = np.ptp(stick) > 0.0 and stick.mean() >= STICKS
    if not (sticks or pace * length >= WOULD_CHANGE):
        return False
    step = length / (len(time) - 1)
    hz = fundamental_hz(step, run.sensed_q[window], v, run.omega)
    if not length * hz >= PERIODS:
        return False
    half = round(np.floor(0.5 * length * hz) / (hz * step))  # rows of whole periods
    first, second = (float((x**2).sum()) for x in (v[-2 * half : -half], v[-half:]))
    return abs(np.sqrt(second / first) - 1.0) <= EVEN


def _undamped(run: Motion) -> bool:
    """Whether no mode grows, and the least damped one does not decay either."""
    modes = run.point.growing
    if modes.n_unstable or modes.n_outside or not len(modes.lam):
        return False
    return bool(abs(modes.lam[0].real) <= LEAST_DAMPING * abs(modes.lam[0]))
