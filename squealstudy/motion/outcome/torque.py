"""Line and levels of a run's torque, computed once; those of a batch of runs side by side."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.levels import (
    TorqueLevels,
    TorqueSums,
    judged_part,
    levels_side_by_side,
    plain_levels,
    plain_levels_side_by_side,
    step_of,
    torque_levels,
)
from squealstudy.motion.outcome.spectrum import unfolded_line

RowsOfRun = tuple[Motion, slice]
LINE, LEVELS, PLAIN = "line", "levels", "plain levels"  # keys of `Motion.windows`


def judged_line(run: Motion) -> float:
    """Dominant line of the last 40 % of a run [Hz]; NaN where there is none."""
    if LINE not in run.windows:
        torque, means = run.history["torque"], _means(run)
        line = np.nan
        if len(torque) > 1:
            part = judged_part(len(torque))
            line = float(unfolded_line(step_of(run.times), torque[part], means))
        run.windows[LINE] = line
    line_hz: float = run.windows[LINE]
    return line_hz


def levels_of(run: Motion, rows: slice) -> TorqueLevels:
    """`torque_levels` of some rows, from sums over every step, or from rows in their place."""
    key = LEVELS, rows.start, rows.stop
    if key not in run.windows:
        torque = run.history["torque"][rows]
        sums = TorqueSums.of(run.history, rows) or TorqueSums.of_rows(torque)
        run.windows[key] = torque_levels(run.times[rows], torque, sums)
    levels: TorqueLevels = run.windows[key]
    return levels


def plain_levels_of(run: Motion, rows: slice) -> np.ndarray:
    """`plain_levels` (3,) of some rows."""
    sums = TorqueSums.of(run.history, rows)
    levels = run.windows.get((LEVELS, rows.start, rows.stop))
    if sums is not None and levels is not None:
        return np.array([levels.rms, levels.mean, levels.peak_to_peak])
    key = PLAIN, rows.start, rows.stop
    if key not in run.windows:
        run.windows[key] = plain_levels(run.times[rows], run.history["torque"][rows], sums)
    plain: np.ndarray = run.windows[key]
    return plain


def find_lines(runs: Iterable[Motion]) -> None:
    """Compute `judged_line` of the runs of a batch, and store it with each run."""
    judged_runs = [(run, judged_part(len(run.times))) for run in runs if len(run.times) > 1]
    for group in _windows_of_equal_rows(judged_runs):
        rows = group[0][1]
        signals, means = (
            np.array([run.history[name][rows] for run, _ in group])
            for name in ("torque", "torque_mean")
        )
        lines = unfolded_line(step_of(group[0][0].times), signals, means)
        for (run, _), line in zip(group, lines.tolist(), strict=True):
            run.windows[LINE] = line


def find_levels(windows: Iterable[RowsOfRun]) -> None:
    """Compute `levels_of` rows of the runs of a batch, and store them with each run."""
    for group in _windows_of_equal_rows(windows):
        torque, sums = _together(group)
        levels = levels_side_by_side(step_of(group[0][0].times), torque, sums)
        for (run, rows), run_levels in zip(group, levels, strict=True):
            run.windows[LEVELS, rows.start, rows.stop] = run_levels


def find_plain_levels(windows: Iterable[RowsOfRun]) -> None:
    """Compute `plain_levels_of` rows of the runs of a batch, and store them with each run."""
    for group in _windows_of_equal_rows(windows):
        torque, sums = _together(group)
        levels = plain_levels_side_by_side(step_of(group[0][0].times), torque, sums)
        for (run, rows), run_levels in zip(group, levels, strict=True):
            run.windows[PLAIN, rows.start, rows.stop] = run_levels


def _windows_of_equal_rows(windows: Iterable[RowsOfRun]) -> Iterator[list[RowsOfRun]]:
    """Groups of windows with the same rows, of runs whose torque was summed over every step."""
    groups: dict[tuple[int, int, int, float], list[RowsOfRun]] = {}
    for run, rows in windows:
        if _means(run) is not None and len(run.times) > 1 and rows.stop > rows.start:
            key = len(run.times), rows.start, rows.stop, round(run.time, 12)
            groups.setdefault(key, []).append((run, rows))
    yield from groups.values()


def _together(group: Sequence[RowsOfRun]) -> tuple[np.ndarray, TorqueSums]:
    """Torque (m, rows) at the rows, and its sums between them."""
    every = [TorqueSums.of(run.history, rows) for run, rows in group]
    sums = TorqueSums.together([run_sums for run_sums in every if run_sums is not None])
    return np.array([run.history["torque"][rows] for run, rows in group]), sums


def _means(run: Motion) -> np.ndarray | None:
    """Means of the torque between rows; None where it was not summed over every step."""
    means = run.history.get("torque_mean")
    return means if means is not None and np.isfinite(means).all() else None
