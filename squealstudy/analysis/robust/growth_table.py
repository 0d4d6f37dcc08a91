"""Growth rates over the design points of a study: the largest of each point, and of each track."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from squealstudy.analysis.tables.mode_ranking import point_codes

LARGEST = 0  # in place of a track number


@dataclass(frozen=True)
class GrowthColumn:
    """One growth rate at every design point.

    Attributes
    ----------
    track : int
        LARGEST for the largest over the oscillating modes of a point.
    frequency_hz : float
        Mean over the points where the mode is unstable; NaN for LARGEST.
    growth : ndarray (n_points,)
        1/s; NaN where the point is not ok or the track has no mode.
    unstable : ndarray (n_points,) of bool
    """

    track: int
    frequency_hz: float
    growth: np.ndarray
    unstable: np.ndarray


def growth_columns(
    points: pd.DataFrame, modes: pd.DataFrame, top: int | None = None
) -> list[GrowthColumn]:
    """The largest growth of each point, then those of the tracks unstable anywhere.

    Parameters
    ----------
    points, modes : DataFrame
        Tables of a complex-mode study. Overdamped roots do not count.
    top : int or None
        Tracks to keep, those unstable at most points first, then by largest growth.
    """
    code = point_codes(points, modes)
    ok = (points["status"] == "ok").to_numpy(bool)
    oscillating = ~modes["overdamped"].to_numpy(bool) & ok[code]
    code = code[oscillating]
    growth = modes["growth_rate"].to_numpy(dtype=float)[oscillating]
    unstable = modes["unstable"].to_numpy(bool)[oscillating]
    track = modes["track"].to_numpy()[oscillating]
    hz = modes["frequency_hz"].to_numpy(dtype=float)[oscillating]
    n = len(points)
    columns = [_column(LARGEST, np.nan, n, code, growth, unstable)]
    seen = unstable & (track > 0)
    listed = pd.Series(growth[seen]).groupby(track[seen]).agg(["count", "max"])
    for number in listed.sort_values(["count", "max"], ascending=False).index[:top]:
        own = track == number
        frequency = float(hz[own & unstable].mean())
        columns.append(_column(int(number), frequency, n, code[own], growth[own], unstable[own]))
    return columns


def _column(
    track: int, hz: float, n: int, code: np.ndarray, growth: np.ndarray, unstable: np.ndarray
) -> GrowthColumn:
    largest = np.full(n, -np.inf)
    np.maximum.at(largest, code, growth)
    anywhere = np.zeros(n, dtype=bool)
    anywhere[code[unstable]] = True
    return GrowthColumn(track, hz, np.where(np.isfinite(largest), largest, np.nan), anywhere)
