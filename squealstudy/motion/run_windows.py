"""Windows of equal length of a run whose speed or pressure changes: level, line, class.

Nothing in such a run is steady. Levels are those of the window, about a straight line through it;
they do not say what would last at a constant speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.levels import TorqueSums
from squealstudy.motion.outcome.periods import own_frequency
from squealstudy.motion.outcome.spectrum import FLUCTUATION_ROUND_OFF, folds, spectrum
from squealstudy.motion.step_errors import (
    LEVEL_SAFETY_FACTOR,
    SECOND_DIFFERENCE_RATIO,
    settling,
)
from squealstudy.wording import QUIET, STICK_SLIP, VIBRATES

QUIET_SHARE = 0.01  # RMS over the torque of steady sliding at the window's pressure: less is quiet
LEAST_STICKS = 2  # a window is of stick-slip if sticking begins at least so often in it
STICK_LEVEL = 0.5  # sticking begins at this share of the largest stuck area in a window
ROUND_OFF_SPEED = 1e-12  # a belt with a lower speed, over the design point's, stands still
LEVELS = ("torque_mean", "torque_rms", "torque_peak_to_peak")
# index of these in the parts of `settling`, and index of the level that each part is relative to:
# the part of the mean is relative to the RMS
OF_SETTLING, SCALES = [1, 0, 2], [1, 1, 2]


def window_rows(run: Motion, count: int, again: Sequence[Motion] = ()) -> list[dict[str, Any]]:
    """One row for each window of a run with a schedule; fewer where it has fewer saved rows.

    Parameters
    ----------
    run : Motion
    count : int
        Number of windows of the run.
    again : sequence of Motion
        The run with half its step and, where possible, with twice its step, for the errors of
        levels. Without them, or where the first failed, bounds are NaN.
    """
    rows = len(run.times) - 1
    if rows < 1:
        return []
    parts = np.array_split(np.arange(1, rows + 1), min(count, rows))
    windows = [slice(int(part[0]), int(part[-1]) + 1) for part in parts]
    others = [x for x in again if x.outcome == "ok" and len(x.times) == len(run.times)]
    is_compared = any(x is again[0] for x in others)
    table = []
    for number, window in enumerate(windows, 1):
        row = _levels(run, window)
        changes = [np.abs(_sizes(row) - _sizes(_levels(x, window))) for x in others]
        half = np.full(len(LEVELS), np.nan)
        if is_compared:
            half = LEVEL_SAFETY_FACTOR * np.fmax(changes[0], SECOND_DIFFERENCE_RATIO * changes[-1])
            half += settling(run, window)[OF_SETTLING] * _sizes(row)[SCALES]
        for name, width in zip(LEVELS, half, strict=True):
            lower_bound = -np.inf if name == "torque_mean" else 0.0
            row[f"{name}_low"] = (
                float(max(row[name] - width, lower_bound)) if is_compared else np.nan
            )
            row[f"{name}_high"] = float(row[name] + width)
        table.append({"window": number, **row, **_imposed(run, window), **_motion(run, window)})
        table[-1]["class"] = _class(run, window, row)
    return table


def _sizes(row: dict[str, Any]) -> np.ndarray:
    return np.array([row[name] for name in LEVELS])


def _levels(run: Motion, window: slice) -> dict[str, Any]:
    """Mean, RMS about a straight line and peak to peak of the torque, over all steps."""
    sums = TorqueSums.of(run.history, window)
    if sums is None:
        sums = TorqueSums.of_rows(run.history["torque"][window])
    residual = _off_the_line(sums.mean)
    return {
        "torque_mean": float(sums.mean.mean()),
        "torque_rms": float(np.sqrt((sums.variance + residual**2).mean())),
        "torque_peak_to_peak": float(sums.most.max() - sums.least.min()),
    }


def _off_the_line(values: np.ndarray) -> np.ndarray:
    """Values (rows,) less the straight line through them."""
    x = np.arange(len(values)) - 0.5 * (len(values) - 1)
    deviations: np.ndarray = values - values.mean()
    return deviations - x * float(x @ deviations) / max(float(x @ x), 1.0)


def _imposed(run: Motion, window: slice) -> dict[str, Any]:
    """Times, speeds and pressures at the ends of a window; pressures are NaN if constant."""
    times = run.times[[window.start - 1, window.stop - 1]]
    schedule, speed = run.point.schedule, run.point.speed
    assert schedule is not None
    speeds, pressures = schedule.speed_at(times), schedule.pressure_at(times)
    speeds = np.where(np.abs(speeds) < ROUND_OFF_SPEED, 0.0, speeds)
    values = {
        "time": times,
        "sliding_speed": speed * speeds,
        "pressure": schedule.pressure * pressures,
    }
    ends = enumerate(("start", "stop"))
    return {f"{name}_{end}": float(x[k]) for k, end in ends for name, x in values.items()}


def _motion(run: Motion, window: slice) -> dict[str, Any]:
    """Own frequency, the torque's line and its level, energy and shares of the contact."""
    torque, time = run.history["torque"][window], run.times[window]
    step = float(run.times[-1] - run.times[0]) / (len(run.times) - 1)
    lines = spectrum(step, torque)
    line = lines.peak()
    sums = TorqueSums.of(run.history, window)
    is_folded = sums is not None and folds(lines, line, step, sums.mean)
    columns = {
        "frequency_hz": own_frequency(run, window).hz if len(time) > 1 else np.nan,
        "torque_line_hz": np.nan if is_folded else line,
        "dominant_level": np.nan if is_folded else lines.level(line),
        "energy_mean": float(run.history["modal_energy_mean"][window].mean()),
    }
    for name in ("stick", "open"):
        columns[f"{name}_share"] = float(run.history[f"{name}_mean"][window].mean())
        columns[f"{name}_share_max"] = float(run.history[f"{name}_max"][window].max())
    return columns


def _class(run: Motion, window: slice, row: dict[str, Any]) -> str:
    """Behaviour of the torque in a window: quiet, stick_slip, vibrates."""
    schedule, sums = run.point.schedule, TorqueSums.of(run.history, window)
    assert schedule is not None
    pressure = float(np.mean(schedule.pressure_at(run.times[window])))
    quiet_level = QUIET_SHARE * abs(run.point.static_torque) * pressure
    round_off = FLUCTUATION_ROUND_OFF * (0.0 if sums is None else float(np.abs(sums.mean).max()))
    if row["torque_rms"] <= max(quiet_level, round_off):
        return QUIET
    sticks = run.history["stick_mean"][window]
    level = STICK_LEVEL * float(run.history["stick_max"][window].max())
    begins = (sticks[1:] >= level) & (sticks[:-1] < level) if level > 0 else np.zeros(0, bool)
    return STICK_SLIP if int(begins.sum()) >= LEAST_STICKS else VIBRATES
