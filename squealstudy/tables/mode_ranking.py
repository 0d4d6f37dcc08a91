"""The ranking: which modes are unstable, at how many points, how strongly, from which value on."""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError
from squealstudy.tables.families import (
    NOT_LOCATED,
    RENUMBERED,
    families,
    pairs_growing_together,
    same_mode_pairs,
)
from squealstudy.tables.point_rows import point_codes
from squealstudy.tables.ranking_query import rows_that_count
from squealstudy.tables.stability import (
    BELOW_RANGE,
    BRACKETED,
    BROKEN,
    CROSSING,
    CUBIC,
    FIRST_SEEN,
    INTO,
    REFINED,
    line_crossings,
    unstable_bounds,
)
from squealstudy.tables.worst_points import ANY, worst_settings
from squealstudy.wording import amount, did_you_mean, in_digits

HEAD = ("point_id", "status", "message", "wall_s")  # of points, then parameters
# first column of `points` after the parameters, for studies of modes, of motion, of cycles
FIRST_RESULT = ("n_modes", "class", "verdict")
AT_DIGITS = 4  # digits on the screen of the values in the column `at`
# numbers of rows that are no track: one row for overdamped roots; rows for modes without a track in
# groups of near frequency, -2 for the lowest
OVERDAMPED_GROUP, FIRST_UNTRACKED_GROUP = -1, -2
GROUP_REL_GAP = 0.05  # a wider relative gap in frequency separates two of these groups
ORDER = {  # column by which rows are sorted, and whether ascending
    "share": ("unstable_share", False),
    "growth": ("max_growth_rate", False),
    "damping": ("min_damping_ratio", True),
    "threshold": ("threshold", True),
    "frequency": ("frequency_hz", True),
    "probability": ("unstable_share", False),
    "worst": ("max_growth_rate", False),
    "mean_growth": ("mean_growth_rate", False),
}
COLUMNS = (
    {"track": "int64", "kind": "str", "frequency_hz": "f8", "frequency_min_hz": "f8"}
    | {"frequency_max_hz": "f8", "unstable_share": "f8", "unstable_points": "int64"}
    | {"points": "int64"}
    | {"max_growth_rate": "f8", "mean_growth_rate": "f8", "min_damping_ratio": "f8"}
    | {"at": "str", "threshold": "f8"}
    | {"threshold_kind": "str", "main_component": "str", "main_share": "f8"}
    | {"second_component": "str", "second_share": "f8", "ambiguous": "bool"}
    | {"unstable_points_low": "int64", "unstable_points_high": "int64", "taken_over": "bool"}
    | {"family": "int64", "family_modes": "int64", "family_points": "int64"}
)
RANKED = (  # columns of `modes` that a ranking needs, beside energies
    *("track", "track_ambiguous", "frequency_hz", "growth_rate", "damping_ratio"),
    *("unstable", "stability", "overdamped"),
)
SUMMARISED = ("frequency_hz", "growth_rate", "damping_ratio", "track_ambiguous")


def rank_modes(
    points: pd.DataFrame,
    modes: pd.DataFrame,
    along: str | None = None,
    by: str = "share",
    top: int | None = None,
    where: str | None = None,
    onsets: pd.DataFrame | None = None,
    scattered: bool = False,
) -> pd.DataFrame:
    """Rank the unstable modes of a study: one row for each track that is unstable anywhere.

    Parameters
    ----------
    points, modes : DataFrame
        Tables of a study.
    along : str or None
        Parameter whose threshold is wanted.
    by : str
        share, growth, damping, threshold, frequency or energy_<component>: worst first. Of random
        designs share is a `probability`, growth the `worst` case, and `mean_growth` the mean.
    top : int or None
        Rows to keep.
    where : str or None
        A condition on columns of both tables (`condition.conditions`); names with dots or brackets
        may be in backticks or not. Of the conditions that `and` joins, those on columns of `points`
        only select the points that count, the others the unstable modes that count.
    onsets : DataFrame or None
        Table of onsets along `along`. A refined onset replaces the interpolated threshold.
    scattered : bool
        Whether the points are those of a random design, in which no line has a first point.

    Returns
    -------
    DataFrame
        COLUMNS. A row of `kind` "mode" is a track. It has the frequency at which the track grows
        fastest, and mean energies over the unstable points. The row of track -1, "non-oscillating",
        is of overdamped unstable roots. Rows of track -2 and below, "untracked", are of unstable
        modes without a track: each row has all modes of a range of frequency without a gap wider
        than GROUP_REL_GAP, and frequency, growth, damping and energies of its fastest mode.
        `points` is the number of points that count; failed points do not. At `unstable_points` of
        them the mode is unstable, a share of `unstable_share`. `unstable_points_low` are points at
        which it is unstable whatever the error, `unstable_points_high` points at which it may be.
        Tracks of one `family`, named by its least track number, are one mode (`families`).
        `mean_growth_rate` is over all points that count, zero where the mode is not unstable.
        `threshold` is the smallest value of `along` at which the damping ratio crosses zero,
        on lines of constant other parameters. `threshold_kind` is "crossing" (interpolated),
        "refined" (to 1e-4) or "below range" (unstable at the first value of a line; NaN). Three
        kinds are upper bounds: "bracketed" (the mode before has no damping, the onset could not be
        located, or the points are `scattered`), "first seen" (the track begins unstable) and
        "broken" (the track begins unstable where another ends, and may be unstable before).
        `taken_over` tells that at a smaller value on some line the track takes over an unstable
        mode from another track, which is no onset.

    Raises
    ------
    ResultsError
        For an unknown `by` or `along`, or a query that cannot be used.
    """
    (key, ascending), code = _order(points, modes, along, by), point_codes(points, modes)
    points_selected, modes_selected = rows_that_count(points, modes, code, where)
    counted = points_selected & (points["status"] == "ok").to_numpy(bool)
    group = np.where(modes_selected & counted[code], unstable_groups(modes), 0)
    table = _summary(points, modes, group, code, int(counted.sum()))
    table = table.join(unstable_bounds(modes, group, code, modes_selected & counted[code]))
    names = parameter_columns(points, varied=True)
    pairs = same_mode_pairs(table.index, onsets, modes, code, points, names, scattered)
    table = table.join(families(table.index, pairs, group, code, pairs_growing_together(onsets)))
    if along is not None and len(table):
        track = modes["track"].to_numpy()
        listed = np.isin(track, table.index[table.index > 0]) & counted[code]
        group = np.where(listed & (group >= 0), track, np.minimum(group, 0))
        rows = np.flatnonzero(group)
        line, x = line_codes(points, along), points[along].to_numpy(float)
        start = _starts(points[along], line, points_selected)
        start = np.full(len(points), np.nan) if scattered else start
        refined = _refined_onsets(points, onsets)
        thresholds = _thresholds(
            modes[["damping_ratio", "unstable"]].iloc[rows],
            *(group[rows], code[rows]),
            x,
            start,
            line,
            refined,
            scattered,
        )
        table["threshold"] = thresholds["value"]
        table["threshold_kind"] = thresholds["kind"].reindex(table.index).fillna("")
        table["taken_over"] = table.index.isin(thresholds.index[thresholds["taken_over"]])
        at_start = (table.index < 0) & (table["threshold"] <= pd.Series(start).min())  # no order
        table.loc[at_start, "threshold_kind"] = BELOW_RANGE
    table["order"] = table[key]
    table["threshold"] = table["threshold"].mask(table["threshold_kind"] == BELOW_RANGE)
    table = table.sort_values(["order", "frequency_hz"], ascending=[ascending, True])
    return table.reset_index()[list(COLUMNS)].astype(COLUMNS).iloc[:top]


def parameter_columns(points: pd.DataFrame, varied: bool = False) -> list[str]:
    """Names of the parameters of a points table; if `varied`, of those with more than one value.

    They are the columns between HEAD and the first result.
    """
    columns = [str(c) for c in points.columns]
    end = min((columns.index(c) for c in FIRST_RESULT if c in columns), default=len(columns))
    names = [c for c in columns[:end] if c not in HEAD]
    return [c for c in names if not varied or _varies(points[c])]


def _varies(column: pd.Series) -> bool:
    """Whether there is more than one value; all NaN are one."""
    values = column.to_numpy()
    if values.dtype.kind != "f":
        return bool((~column.duplicated()).sum() > 1)
    first = values[:1]
    has_first = first == first
    return bool(((values != first) & ((values == values) | has_first)).any())


def line_codes(points: pd.DataFrame, along: str) -> np.ndarray:
    """Number of the line of constant other parameters on which each point lies, (n_points,)."""
    others = [c for c in parameter_columns(points, varied=True) if c != along]
    if not others:
        return np.zeros(len(points), dtype=int)
    return points.groupby(others, dropna=False).ngroup().to_numpy()


def unstable_groups(modes: pd.DataFrame) -> np.ndarray:
    """Number of the row of the ranking to which each mode belongs; 0 for stable modes."""
    track = modes["track"].to_numpy()
    unstable, overdamped = (modes[n].to_numpy(bool) for n in ("unstable", "overdamped"))
    group = np.where(overdamped, OVERDAMPED_GROUP, track)
    untracked_rows = np.flatnonzero(unstable & ~overdamped & (track <= 0))
    hz = modes["frequency_hz"].to_numpy(float)[untracked_rows]
    order = np.argsort(hz, kind="stable")
    is_separate = np.diff(hz[order]) > GROUP_REL_GAP * hz[order][:-1]
    group[untracked_rows[order]] = FIRST_UNTRACKED_GROUP - np.cumsum(
        np.append(False, is_separate)[: len(order)]
    )
    return np.where(unstable, group, 0)


def group_kind(group: int) -> str:
    """The `kind` of a row of the ranking, by its number from `unstable_groups`."""
    if group > 0:
        return "mode"
    return "non-oscillating" if group == OVERDAMPED_GROUP else "untracked"


def frequency_text(row: Mapping[Hashable, Any]) -> str:
    """Frequency of a row of the ranking in Hz; of modes without a track their range."""
    hz = in_digits(row["frequency_hz"]) if row["frequency_hz"] == row["frequency_hz"] else ""
    low, high = (in_digits(row[f"frequency_{end}_hz"]) for end in ("min", "max"))
    return (
        f"{low} to {high}"
        if row["kind"] == group_kind(FIRST_UNTRACKED_GROUP) and low != high
        else hz
    )


def settings_text(values: Mapping[Hashable, Any]) -> str:
    """Names and values of a design point as rankings have them, ``friction=0.5, ...``."""
    return ", ".join(f"{n}={x if x == ANY else format(x, 'g')}" for n, x in values.items())


def settings_of(settings: object, units: Mapping[str, str]) -> dict[str, str]:
    """Values with their units by name, from what `settings_text` has written."""
    parts = [part.rpartition("=") for part in str(settings).split(", ") if "=" in part]
    shown = partial(amount, digits=AT_DIGITS)
    return {n: v if v == ANY else shown(float(v), units.get(n, "")) for n, _, v in parts}


def energy_columns(columns: Iterable[str]) -> list[str]:
    """Columns of elastic energy shares, of a table or of their names."""
    return [c for c in columns if c.startswith("energy_")]


def _order(
    points: pd.DataFrame, modes: pd.DataFrame, along: str | None, by: str
) -> tuple[str, bool]:
    """Column by which rows are sorted and whether ascending; ResultsError for other keys."""
    choices = [*ORDER, *energy_columns(modes.columns)]
    if by not in choices:
        text = f"modes cannot be ranked by '{by}', expected {', '.join(choices)}"
        raise ResultsError(text + did_you_mean(by, choices))
    if along is not None and along not in (names := parameter_columns(points)):
        raise ResultsError(
            f"'{along}' is no parameter of the study, expected {', '.join(names)}"
            + did_you_mean(along, names)
        )
    if by == "threshold" and along is None:
        raise ResultsError("ranking by threshold needs the parameter along which it is sought")
    return ORDER.get(by, (by, False))


def _summary(
    points: pd.DataFrame, modes: pd.DataFrame, group: np.ndarray, code: np.ndarray, n_points: int
) -> pd.DataFrame:
    """Ranking without thresholds: one row for each group of unstable modes, by `track`."""
    rows = np.flatnonzero(group)
    energies = energy_columns(modes.columns)
    needed = [*energies, *SUMMARISED]
    unstable = modes[needed].iloc[rows].assign(track=group[rows], point=code[rows])
    by_track = unstable.groupby("track")
    table = by_track[energies].mean() if energies else pd.DataFrame(index=by_track.size().index)
    table["frequency_min_hz"] = by_track["frequency_hz"].min()
    table["frequency_max_hz"] = by_track["frequency_hz"].max()
    table["kind"] = [group_kind(int(track)) for track in table.index]
    table["points"] = n_points
    table["unstable_points"] = by_track["point"].nunique()
    table["unstable_share"] = table["unstable_points"] / max(n_points, 1)
    table["max_growth_rate"] = by_track["growth_rate"].max()
    largest = unstable.groupby(["track", "point"])["growth_rate"].max()
    table["mean_growth_rate"] = largest.groupby(level="track").sum() / max(n_points, 1)
    table["min_damping_ratio"] = by_track["damping_ratio"].min()
    table["ambiguous"] = by_track["track_ambiguous"].any()
    table["threshold"], table["threshold_kind"], table["taken_over"] = np.nan, "", False
    worst = unstable.sort_values("growth_rate").drop_duplicates("track", keep="last")
    table["frequency_hz"] = worst.set_index("track")["frequency_hz"]
    alone = worst[worst["track"].to_numpy() < 0].set_index("track")  # no mean over different modes
    table.loc[alone.index, energies] = alone[energies]
    table.loc[alone.index, "min_damping_ratio"] = alone["damping_ratio"]
    table.loc[table.index == OVERDAMPED_GROUP, "frequency_hz"] = np.nan  # it does not oscillate
    names = parameter_columns(points, varied=True) or parameter_columns(points)
    designs = [settings_text(row) for row in worst_settings(points, unstable, worst, names)]
    table["at"] = pd.Series(designs, index=worst["track"].to_numpy(), dtype="str")
    return table.join(main_components(table[energies]))


def main_components(energies: pd.DataFrame) -> pd.DataFrame:
    """The two components with most elastic energy, in each row of energy columns."""
    table = pd.DataFrame(index=energies.index)
    shares = energies.rename(columns=lambda c: c.removeprefix("energy_"))
    by_component = shares.melt(
        ignore_index=False, var_name="component", value_name="share"
    ).dropna()
    ranked = by_component.sort_values("share", ascending=False, kind="stable").groupby(level=0)
    for rank, name in enumerate(("main", "second")):
        chosen = ranked.nth(rank).reindex(table.index)
        table[f"{name}_component"] = chosen["component"].fillna("")
        table[f"{name}_share"] = chosen["share"]
    return table


def _thresholds(
    modes: pd.DataFrame,
    group: np.ndarray,
    code: np.ndarray,
    x: np.ndarray,
    start: np.ndarray,
    line: np.ndarray,
    refined: dict[tuple[int, int, int], float],
    scattered: bool,
) -> pd.DataFrame:
    """Smallest x [`value`, -inf below the range] at which each group turns unstable, and `kind`.

    On a line of scattered points neighbours may be far apart. The value of the unstable neighbour
    is then an upper bound.
    """
    zeta, unstable = modes["damping_ratio"].to_numpy(), modes["unstable"].to_numpy(bool)
    crossings = line_crossings(group, line[code], x[code], start[code], zeta, unstable)
    crossings = crossings[crossings["direction"] == INTO]
    crossed = crossings["kind"].isin([CROSSING, BRACKETED]).to_numpy()
    renumbered = crossings[:0]
    if refined and crossed.any():
        ends = (code[crossings.loc[crossed, side].to_numpy()] for side in ("before", "after"))
        keys = zip(crossings.loc[crossed, "track"], *ends, strict=True)
        pairs = zip(crossings.index[crossed], keys, strict=True)
        better = pd.Series({row: refined[key] for row, key in pairs if key in refined}, dtype=float)
        renumbered = crossings.loc[better.index[better.isna()]]
        crossings = crossings.drop(renumbered.index)
        better = better.dropna()
        located = np.isfinite(better)
        unstable_end = x[code[crossings.loc[better.index, "after"].to_numpy()]]
        crossings.loc[better.index, "value"] = better.where(located, unstable_end)
        crossings.loc[better.index, "kind"] = np.where(located, REFINED, BRACKETED)
    if scattered:
        between = (crossings["kind"] == CROSSING).to_numpy()
        crossings.loc[between, "value"] = x[code[crossings.loc[between, "after"].to_numpy()]]
        crossings.loc[between, "kind"] = BRACKETED
    first_seen = np.flatnonzero(crossings["kind"] == FIRST_SEEN)
    ends = code[crossings["after"].to_numpy()[first_seen]]
    keys = zip(crossings["track"].to_numpy()[first_seen], itertools.repeat(-1), ends)
    lows = np.array([refined.get(key, np.inf) for key in keys], dtype=float)
    at_break = first_seen[np.isnan(lows)]
    crossings.loc[crossings.index[first_seen[np.isfinite(lows)]], "kind"] = BRACKETED
    crossings["value"] = crossings["value"].mask(crossings["kind"] == BELOW_RANGE, -np.inf)
    unsure = crossings["track"].isin(crossings["track"].to_numpy()[at_break])
    unsure &= crossings["kind"] != BELOW_RANGE  # the least over all lines is an upper bound
    crossings["kind"] = crossings["kind"].mask(unsure, BROKEN)
    crossings = crossings.sort_values("value", kind="stable").drop_duplicates("track")
    crossings = crossings.set_index("track")
    renumbered_at = (
        pd.Series(x[code[renumbered["after"].to_numpy()]], renumbered["track"].to_numpy())
        .groupby(level=0)
        .min()
        .reindex(crossings.index)
    )
    crossings["taken_over"] = renumbered_at <= crossings["value"]
    return crossings


def _starts(x: pd.Series, line: np.ndarray, selected: np.ndarray) -> np.ndarray:
    """Least x of the selected points, failed ones too, on each point's line; NaN for one value."""
    by_line = x.where(selected).groupby(line)
    start = by_line.transform("min").where(by_line.transform("nunique") > 1)
    return start.to_numpy(dtype=float)


def _refined_onsets(
    points: pd.DataFrame, onsets: pd.DataFrame | None
) -> dict[tuple[int, int, int], float]:
    """Refined onsets by track and rows in `points` of both ends; NaN where the mode has no onset.

    An onset that could not be located is infinite. For a track that begins where another ends, the
    first row is -1 and the value `bracket_low`.
    """
    if onsets is None:
        return {}
    with_onset = [REFINED, CUBIC, RENUMBERED, BROKEN, NOT_LOCATED]
    refined = onsets[onsets["status"].isin(with_onset) & (onsets["direction"] == INTO)]
    values = refined["onset"].mask(refined["status"] == NOT_LOCATED, np.inf)
    is_broken = refined["status"] == BROKEN
    values = values.mask(is_broken, refined.get("bracket_low", np.nan))
    before, index = refined["point_before"].mask(is_broken, ""), pd.Index(points["point_id"])
    ends = (index.get_indexer(pd.Index(ids)) for ids in (before, refined["point_after"]))
    return dict(zip(zip(refined["track"], *ends, strict=True), values, strict=True))
