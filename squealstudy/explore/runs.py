"""Runs in time on a page: levels, classes, and the extremes of each history."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from squealstudy.colours import RUN_FILLS
from squealstudy.errors import ResultsError
from squealstudy.explore.limit_cycles import of_friction
from squealstudy.explore.packed import packed_numbers, packed_single
from squealstudy.explore.points import Content, classes, measure
from squealstudy.wording import TORQUE

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MOST_ROWS = 2_000_000  # rows of all histories together: 12 MB, which base64 makes 16 MB
LEAST_BINS, MOST_BINS = 500, 20_000  # parts of a history
# most that the torque ranges over from row to row, over its difference between rows, in the mean:
# a sine has 1.02 with four rows a period, 1.18 with 2.5, 1.27 with two, more with fewer
MOST_BETWEEN = 1.25
LEVELS = {"torque_rms": "RMS", "torque_peak_to_peak": "peak to peak", "torque_mean": "mean"}
PREDICTED = "predicted_growth_rate"
OTHERS = {
    "frequency_hz": ("frequency", "Hz"),
    "growth_rate": ("fitted growth", "1/s"),
    PREDICTED: ("predicted growth", "1/s"),
}


def runs_content(results: Results, points: pd.DataFrame) -> tuple[Content, list[Content]]:
    """Histories of some design points, and quantities of runs that a map can show.

    A history that has more rows than its share of MOST_ROWS is cut into parts, and each part is
    replaced by its least and its largest value: no peak is lost.
    """
    unit = results.units.get(TORQUE, "N m")
    with_history = results.store.kept_histories()
    rows = [row for row, point_id in enumerate(points["point_id"]) if point_id in with_history]
    max_histories = MOST_ROWS // (2 * LEAST_BINS)
    bins = min(MOST_BINS, MOST_ROWS // (2 * max(min(len(rows), max_histories), 1)))
    histories = {}
    for row in rows[:max_histories]:
        try:
            history = results.history(str(points["point_id"].iloc[row]))
        except ResultsError:  # a damaged file; the page says so
            continue
        histories[str(row)] = _extremes(history, bins)
    content: Content = {
        "unit": unit,
        "what": of_friction(unit),
        "histories": histories,
        "left": [row for row in rows if str(row) not in histories],
    }
    words, status = points["class"].astype(str).tolist(), points["status"].tolist()
    named = {n: (f"{text} of {of_friction(unit)}", unit) for n, text in LEVELS.items()}
    measures = [classes("class", words, status, RUN_FILLS)]
    n = points["n_unstable"]
    for name, (text, unit_shown) in (named | OTHERS).items():
        if name in points:
            values = points[name].to_numpy(dtype=float, na_value=np.nan)
            if np.isfinite(values).any():
                measures.append(measure(text, unit_shown, values, n if name == PREDICTED else None))
    return content, measures


def _extremes(history: pd.DataFrame, bins: int) -> Content:
    """A history (n,) as it is, or the least and the largest value in each of `bins` parts.

    Where rows do not show the motion they are those of all steps since the row before.
    """
    time, torque = history["time"].to_numpy(float), history["torque"].to_numpy(float)
    low, high, each, is_shown = torque, torque, 1, _shows_motion(history)
    if not is_shown:
        low = np.fmin(torque, history["torque_min"].to_numpy(float))
        high = np.fmax(torque, history["torque_max"].to_numpy(float))
    if len(time) > 2 * bins:
        starts = np.linspace(0, len(time), bins, endpoint=False).astype(int)
        each = -(-len(time) // bins)
        low, high = np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
        time = time[starts]
    if each > 1 or not is_shown:
        time, torque = np.repeat(time, 2), np.column_stack([low, high]).ravel()
    return {
        "n": len(history),
        "rows_a_part": each,
        "shows_motion": is_shown,
        "time": packed_single(time),
        "torque": packed_numbers(torque),
    }


def _shows_motion(history: pd.DataFrame) -> bool:
    """Whether the torque between two rows does not go far beyond them.

    What is faster than every other row would be drawn and heard as something slower.
    """
    if "torque_min" not in history:
        return True
    torque = history["torque"].to_numpy(float)
    low = np.fmin(history["torque_min"].to_numpy(float)[1:], torque[:-1])
    high = np.fmax(history["torque_max"].to_numpy(float)[1:], torque[:-1])
    return bool((high - low).sum() <= MOST_BETWEEN * np.abs(np.diff(torque)).sum())
