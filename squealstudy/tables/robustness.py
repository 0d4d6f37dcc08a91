"""How likely a scattered design is unstable: growth at each point, probabilities, worst case."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError
from squealstudy.tables.families import family_numbers, same_mode_pairs
from squealstudy.tables.mode_ranking import (
    OVERDAMPED_GROUP,
    parameter_columns,
    settings_text,
)
from squealstudy.tables.point_rows import ROW, point_codes
from squealstudy.tables.stability import is_uncertain

LARGEST_GROWTH_GROUP = 0  # in place of a track number
GROWTH = (  # columns of modes that are read
    *(ROW, "track", "frequency_hz", "growth_rate", "unstable", "stability", "overdamped"),
    *("track_ambiguous", "error_rung"),
)
# largest error of a root, over its modulus, up to which growth within it is none
NEUTRAL_REL_ERROR = 1e-4


@dataclass(frozen=True)
class GrowthColumn:
    """One growth rate at every design point.

    Attributes
    ----------
    track : int
        LARGEST_GROWTH_GROUP for the largest of a point, OVERDAMPED_GROUP for that of its real,
        growing roots. Among tracks of one mode (`families`) that with most unstable points.
    frequency_hz : float
        Frequency of the mode where it grows fastest; NaN for these two groups.
    growth : ndarray (n_points,)
        Growth rates, 1/s, 0 where they are within the errors of the method; NaN where the point is
        not ok or has no mode of the track.
    unstable : ndarray (n_points,) of bool
        Points at which it is unstable.
    surely, maybe : ndarray (n_points,) of bool
        Points at which it is unstable whatever the errors of the modes, and at which it may be.
    absent : ndarray (n_points,) of bool
        Points without a mode of the track at which it is certainly none of the oscillating modes of
        the band: at other points all of their tracks are found together with this one.
    tracks : tuple of int
        All tracks of this mode; growth is the largest where a point has several. Empty for the two
        groups.
    ambiguous : bool
        Whether one of them may have jumped to another mode between two points.
    """

    track: int
    frequency_hz: float
    growth: np.ndarray
    unstable: np.ndarray
    surely: np.ndarray
    maybe: np.ndarray
    absent: np.ndarray
    tracks: tuple[int, ...] = ()
    ambiguous: bool = False


def growth_columns(
    points: pd.DataFrame,
    modes: pd.DataFrame,
    top: int | None = None,
    onsets: pd.DataFrame | None = None,
) -> Iterator[GrowthColumn]:
    """The largest growth of each point, then that of non-oscillating roots and of unstable tracks.

    Columns are made one after the other: those of many tracks and points would fill the memory.

    Parameters
    ----------
    points, modes : DataFrame
        Tables of a complex-mode study. Overdamped roots count where they grow: an
        instability without oscillation.
    top : int or None
        Tracks to keep, those unstable at most points first, then by largest growth.
    onsets : DataFrame or None
        Onsets of the study, by which tracks of one mode are recognised.
    """
    code, n = point_codes(points, modes), len(points)
    counted = (points["status"] == "ok").to_numpy(bool)[code]
    code, modes = code[counted], modes[counted]
    growth = _growth(modes)
    unstable, real = (modes[name].to_numpy(bool) for name in ("unstable", "overdamped"))
    uncertain = is_uncertain(modes)
    track = np.where(real, OVERDAMPED_GROUP, modes["track"].to_numpy())
    hz = modes["frequency_hz"].to_numpy(dtype=float)
    judged, diverging = ~real | unstable, real & unstable
    everywhere = np.ones(n, dtype=bool)  # a solved point without such a root has none

    def column(
        number: int,
        members: np.ndarray,
        rows: np.ndarray,
        absent: np.ndarray,
        fastest_hz: float,
    ) -> GrowthColumn:
        marks = unstable, unstable & ~uncertain, unstable | uncertain
        has_mark = [np.bincount(code[rows & mark], minlength=n) > 0 for mark in marks]
        largest = np.full(n, -np.inf)
        np.maximum.at(largest, code[members], growth[members])
        present = np.isfinite(largest)
        shown = np.where(present, largest, np.nan)
        return GrowthColumn(
            track=number,
            frequency_hz=fastest_hz,
            growth=shown,
            unstable=has_mark[0],
            surely=has_mark[1],
            maybe=has_mark[2],
            absent=absent & ~present,
        )

    yield column(LARGEST_GROWTH_GROUP, judged, np.ones(len(code), dtype=bool), everywhere, np.nan)
    if diverging.any():
        yield column(OVERDAMPED_GROUP, diverging, real, everywhere, np.nan)
    by_points = _by_unstable_points(track, growth, unstable)
    names = parameter_columns(points, varied=True)
    pairs = same_mode_pairs(by_points, onsets, modes, code, points, names, scattered=True)
    family = pd.Series(family_numbers(by_points, pairs), dtype="int64")
    members = family.index.to_numpy()
    doubtful = np.unique(track[unstable & modes["track_ambiguous"].to_numpy(bool)])
    by_family = {least: members[family == least] for least in family.unique()}
    for tracks in by_family.values():  # most unstable points first, as `by_points` is
        track = np.where(np.isin(track, tracks), tracks[0], track)
    standing = _Standing(n, code[~real], track[~real])
    for number in _by_unstable_points(track, growth, unstable)[:top]:
        is_of_track = track == number
        fastest = np.flatnonzero(is_of_track & unstable)
        fastest = fastest[growth[fastest].argmax()]
        absent = standing.absent(number)
        tracks = by_family[family[number]]
        yield replace(
            column(number, is_of_track, is_of_track, absent, float(hz[fastest])),
            tracks=tuple(sorted(tracks.tolist())),
            ambiguous=bool(np.isin(tracks, doubtful).any()),
        )


def _growth(modes: pd.DataFrame) -> np.ndarray:
    """Growth rates (m,) [1/s] of the rows of modes; 0 of roots that only round-off moves."""
    growth = modes["growth_rate"].to_numpy(dtype=float)
    if "error_rung" not in modes:
        return growth
    error, size = (modes[n].to_numpy(dtype=float) for n in ("error_rung", "frequency_hz"))
    neutral = (np.abs(growth) <= error) & (error <= NEUTRAL_REL_ERROR * 2 * np.pi * size)
    return np.where(neutral, 0.0, growth)


def _by_unstable_points(track: np.ndarray, growth: np.ndarray, unstable: np.ndarray) -> list[int]:
    """Unstable tracks, those with most unstable points first, then by largest growth."""
    counted = unstable & (track > 0)
    listed = pd.Series(growth[counted]).groupby(track[counted]).agg(["count", "max"])
    numbers: list[int] = listed.sort_values(["count", "max"], ascending=False).index.tolist()
    return numbers


class _Standing:
    """The tracks at each point, from the points and tracks (m,) of oscillating modes."""

    def __init__(self, n: int, code: np.ndarray, track: np.ndarray) -> None:
        self._tracks, track_index = np.unique(track, return_inverse=True)
        self._here = np.zeros((n, len(self._tracks)), dtype=bool)
        self._here[code, track_index] = True

    def absent(self, number: int) -> np.ndarray:
        """Mask (n,) of points at which a track is certainly none of the modes.

        Two tracks at one point are two modes. But a mode without a track, or of a track that is
        never at a point together with this one, may be the same mode under another number.
        """
        with_track = self._here[:, np.searchsorted(self._tracks, number)]
        is_present = self._here[with_track].any(axis=0) & (self._tracks > 0)
        return np.logical_not(self._here[:, ~is_present].any(axis=1))


COLUMNS = (
    {"quantity": "str", "track": "int64", "frequency_hz": "f8", "points": "int64"}
    | {"failed_points": "int64", "present_points": "int64", "absent_points": "int64"}
    | {"unknown_points": "int64", "unstable_points": "int64"}
    | {"unstable_points_low": "int64", "unstable_points_high": "int64"}
    | {"probability": "f8", "probability_low": "f8", "probability_high": "f8"}
    | {"mean_growth_rate": "f8", "growth_mean": "f8", "growth_std": "f8"}
    | {"max_growth_rate": "f8", "at": "str", "tracks": "str", "ambiguous": "bool"}
)
QUANTITIES = {LARGEST_GROWTH_GROUP: "any", OVERDAMPED_GROUP: "divergence"}


def robust_table(
    points: pd.DataFrame,
    modes: pd.DataFrame,
    independent: np.ndarray | None = None,
    confidence: float = 0.95,
    onsets: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """Probability of instability and scatter of growth: of any mode, and of each unstable track.

    Parameters
    ----------
    points, modes : DataFrame
        Tables of a study with a random design: its points are draws of the parameters.
    independent : ndarray (n_points,) of bool or None
        The points that are draws independent of each other; None: all.
    confidence : float
        Confidence of the intervals.
    onsets : DataFrame or None
        Onsets of the study, by which tracks of one mode are recognised.

    Returns
    -------
    DataFrame
        COLUMNS, "any" mode (track 0) first, then "divergence" (track -1: real, growing roots) and
        each "track", those unstable at most points first. `tracks` are those that are this one
        mode, whose number changes; `ambiguous`: it may have jumped to another. `points` are solved;
        `failed_points` count neither as stable nor as unstable. Of the points without a mode of a
        track `absent_points` are those where it has left the band or does not oscillate any more:
        there it counts as not unstable (were it a real, growing root, that is "divergence").
        At `unstable_points_low` it is unstable whatever the errors of the modes, at
        `unstable_points_high` it may be.
        At `unknown_points` it may be one of the modes under another number: these count neither
        way, `probability` is over the others. The interval of
        `probability` is that of Clopper and Pearson, exact for independent draws; points of a
        Sobol sequence or Latin hypercube fill the space more evenly, it is then wider than it need
        be in all but contrived cases. `mean_growth_rate` is the mean over the same points with zero
        where the mode is not unstable; `growth_mean` and `growth_std` are of the growth rate itself
        where there is the mode, 1/s; `max_growth_rate` is the worst case of all solved points, no
        draws among them too, `at` its parameters.

    Raises
    ------
    ResultsError
        Tables in which every point failed.
    """
    drawn = np.ones(len(points), dtype=bool) if independent is None else independent
    is_ok = (points["status"] == "ok").to_numpy(bool)
    solved = drawn & is_ok
    if not solved.any():
        raise ResultsError("every design point failed: there is no probability to tell")
    names = parameter_columns(points, varied=True)
    rows = []
    for column in growth_columns(points, modes, None, onsets):
        if column.track == LARGEST_GROWTH_GROUP or (column.unstable & solved).any():
            row = _row(column, solved, confidence)
            worst = _worst(column, is_ok)
            row["at"] = (
                settings_text(points[names].iloc[worst].to_dict()) if worst is not None else ""
            )
            row["max_growth_rate"] = column.growth[worst] if worst is not None else np.nan
            row["failed_points"] = int(drawn.sum() - solved.sum())
            rows.append(row)
    table = pd.DataFrame(rows)
    tracks = table.iloc[1:].sort_values(["unstable_points", "max_growth_rate"], ascending=False)
    return pd.concat([table.iloc[:1], tracks], ignore_index=True)[list(COLUMNS)].astype(COLUMNS)


def probability_interval(unstable: int, points: int, confidence: float) -> tuple[float, float]:
    """Clopper-Pearson bounds of the probability of a case that `unstable` of `points` draws are."""
    from scipy.stats import binomtest

    interval = binomtest(unstable, points).proportion_ci(confidence, method="exact")
    return float(interval.low), float(interval.high)


def _row(column: GrowthColumn, solved: np.ndarray, confidence: float) -> dict[str, object]:
    """Row of the table of robustness, for one mode or for any mode."""
    unstable = column.unstable & solved
    growth = column.growth[solved & np.isfinite(column.growth)]
    absent = int((column.absent & solved).sum())
    n, k = len(growth) + absent, int(unstable.sum())
    low, high = probability_interval(k, n, confidence)
    return {
        "quantity": QUANTITIES.get(column.track, "track"),
        "track": column.track,
        "tracks": ", ".join(map(str, column.tracks)),
        "ambiguous": column.ambiguous,
        "frequency_hz": column.frequency_hz,
        "points": int(solved.sum()),
        "present_points": len(growth),
        "absent_points": absent,
        "unknown_points": int(solved.sum()) - n,
        "unstable_points": k,
        "unstable_points_low": int((column.surely & solved).sum()),
        "unstable_points_high": int((column.maybe & solved).sum()),
        "probability": k / n,
        "probability_low": low,
        "probability_high": high,
        "mean_growth_rate": float(column.growth[unstable].sum()) / n,
        "growth_mean": float(growth.mean()) if len(growth) else np.nan,
        "growth_std": float(growth.std(ddof=1)) if len(growth) > 1 else np.nan,
    }


def _worst(column: GrowthColumn, is_ok: np.ndarray) -> int | None:
    growth = np.where(is_ok, column.growth, np.nan)
    return None if np.isnan(growth).all() else int(np.nanargmax(growth))
