"""The judged window of a run, and its own frequency over a window: each asked for several times."""

from __future__ import annotations

from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.fundamental import Fundamental, fundamental
from squealstudy.motion.outcome.levels import last_window


def judged_window(run: Motion) -> slice:
    """Rows of a run that are judged: `levels.last_window` of its torque, made once a run."""
    if "judged" not in run.windows:
        run.windows["judged"] = last_window(run.times, run.history["torque"])
    window: slice = run.windows["judged"]
    return window


def own_frequency(run: Motion, window: slice) -> Fundamental:
    """Of the motion of the sensed modes over a window of a run, made once for equal rows."""
    rows = window.indices(len(run.times))
    if rows not in run.windows:
        time = run.times[window]
        step = float(time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else 0.0
        run.windows[rows] = fundamental(step, run.sensed_q[window], run.sensed_v[window], run.omega)
    frequency: Fundamental = run.windows[rows]
    return frequency
