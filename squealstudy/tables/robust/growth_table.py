"""Growth rates over the design points of a study: the largest of each point, and of each track."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from squealstudy.tables.mode_ranking import DIVERGENCE, point_codes
from squealstudy.tables.stability import is_uncertain

LARGEST = 0  # in place of a track number


@dataclass(frozen=True)
class GrowthColumn:
    """One growth rate at every design point.

    Attributes
    ----------
    track : int
        LARGEST for the largest of a point, DIVERGENCE for that of its real, growing roots.
    frequency_hz : float
        Mean over the points where the mode is unstable; NaN for LARGEST and DIVERGENCE.
    growth : ndarray (n_points,)
        1/s; NaN where the point is not ok or the track has no mode.
    unstable : ndarray (n_points,) of bool
    surely, maybe : ndarray (n_points,) of bool
        Unstable whatever the errors of the modes, and unstable if these want it.
    absent : ndarray (n_points,) of bool
        Points without a mode of the track at which it is known to be none of the oscillating modes
        of the band: all of these have tracks that stand beside this one at other points.
    """

    track: int
    frequency_hz: float
    growth: np.ndarray
    unstable: np.ndarray
    surely: np.ndarray
    maybe: np.ndarray
    absent: np.ndarray


def growth_columns(
    points: pd.DataFrame, modes: pd.DataFrame, top: int | None = None
) -> list[GrowthColumn]:
    """The largest growth of each point, then those of static divergence and unstable tracks.

    Parameters
    ----------
    points, modes : DataFrame
        Tables of a complex-mode study. Overdamped roots count where they grow: that is static
        divergence, an instability without oscillation.
    top : int or None
        Tracks to keep, those unstable at most points first, then by largest growth.
    """
    code, n = point_codes(points, modes), len(points)
    counted = (points["status"] == "ok").to_numpy(bool)[code]
    code, modes = code[counted], modes[counted]
    growth = modes["growth_rate"].to_numpy(dtype=float)
    unstable, real = (modes[name].to_numpy(bool) for name in ("unstable", "overdamped"))
    uncertain = is_uncertain(modes)
    track = np.where(real, DIVERGENCE, modes["track"].to_numpy())
    hz = modes["frequency_hz"].to_numpy(dtype=float)
    judged, diverging = ~real | unstable, real & unstable
    everywhere = np.ones(n, dtype=bool)  # a solved point without such a root has none

    def column(
        number: int, own: np.ndarray, of: np.ndarray, absent: np.ndarray, mean_hz: float
    ) -> GrowthColumn:
        marks = unstable, unstable & ~uncertain, unstable | uncertain
        at = [np.bincount(code[of & mark], minlength=n) > 0 for mark in marks]
        largest = np.full(n, -np.inf)
        np.maximum.at(largest, code[own], growth[own])
        present = np.isfinite(largest)
        shown = np.where(present, largest, np.nan)
        return GrowthColumn(number, mean_hz, shown, at[0], at[1], at[2], absent & ~present)

    columns = [column(LARGEST, judged, np.ones(len(code), dtype=bool), everywhere, np.nan)]
    if diverging.any():
        columns.append(column(DIVERGENCE, diverging, real, everywhere, np.nan))
    seen = unstable & (track > 0)
    listed = pd.Series(growth[seen]).groupby(track[seen]).agg(["count", "max"])
    standing = _Standing(n, code[~real], track[~real])
    for number in listed.sort_values(["count", "max"], ascending=False).index[:top]:
        own = track == number
        absent = standing.absent(int(number))
        columns.append(column(int(number), own, own, absent, float(hz[own & unstable].mean())))
    return columns


class _Standing:
    """Which tracks stand at which points, from the oscillating modes' points and tracks (m,)."""

    def __init__(self, n: int, code: np.ndarray, track: np.ndarray) -> None:
        self._tracks, place = np.unique(track, return_inverse=True)
        self._here = np.zeros((n, len(self._tracks)), dtype=bool)
        self._here[code, place] = True

    def absent(self, number: int) -> np.ndarray:
        """Points (n,) at which a track is certainly none of the modes: each is another one.

        Two tracks at one point are two modes. A mode without a track, or of a track that never
        stands beside this one, may be the mode that is sought under another number.
        """
        own = self._here[:, np.searchsorted(self._tracks, number)]
        beside = self._here[own].any(axis=0) & (self._tracks > 0)
        return np.logical_not(self._here[:, ~beside].any(axis=1))
