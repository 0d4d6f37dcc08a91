"""Rows of a study's tables, as pictures show them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError
from squealstudy.plots.style import Quantity, quantity
from squealstudy.tables.mode_ranking import parameter_columns
from squealstudy.tables.point_rows import ROW, rows_in
from squealstudy.tables.stability import REFINED_ONSETS
from squealstudy.wording import did_you_mean, track_number

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MOST_FIRST_ONSETS = 3  # tracks whose onset is in a title


def oscillating(modes: pd.DataFrame) -> pd.DataFrame:
    """Modes that are not overdamped; the same table, not a copy, if none is."""
    overdamped = modes["overdamped"].to_numpy(bool)
    return modes[~overdamped] if overdamped.any() else modes


def unstable_counts(results: Results) -> np.ndarray:
    """Number (n,) of unstable modes of each row of `points`."""
    count = np.zeros(len(results.points), dtype=np.int64)
    for modes in results.batches("modes", [ROW, "unstable"]):
        rows = modes[ROW].to_numpy()[modes["unstable"].to_numpy(bool)]
        count += np.bincount(rows, minlength=len(count))
    return count


def worst_tracks(modes: pd.DataFrame, top: int | None = None) -> pd.DataFrame:
    """The mode of largest growth of each unstable track, fastest first; the first `top` of them."""
    unstable = modes[modes["unstable"].to_numpy(bool) & (modes["track"] > 0).to_numpy()]
    fastest = unstable.sort_values("growth_rate", ascending=False, kind="stable")
    return fastest.drop_duplicates("track").iloc[:top]


def slice_points(
    points: pd.DataFrame,
    unstable: np.ndarray,
    along: tuple[str, ...],
    fixed: Mapping[str, float] | None,
) -> tuple[pd.DataFrame, str]:
    """Points that differ only in the parameters `along`, and why these were chosen.

    Parameters
    ----------
    points : DataFrame
        Table of points.
    unstable : ndarray (n_points,) of int
        Number of unstable modes of each point.
    along : tuple of str
        Parameters that vary among the chosen points.
    fixed : mapping of parameter -> value or None
        Values of other parameters. Those not given are chosen so that most modes are unstable.

    Returns
    -------
    DataFrame
        Rows of the chosen points.
    str
        Why values that were not given were chosen, for a title; empty if there was no choice.

    Raises
    ------
    ResultsError
        For a parameter that the study does not vary or a value that it does not have.
    """
    varied = parameter_columns(points, varied=True)
    for name in along:
        if name not in varied:
            choices = ", ".join(varied) or "none"
            raise ResultsError(
                f"'{name}' is not varied in this study, expected one of: {choices}"
                + did_you_mean(name, varied)
            )
    chosen = points
    for name, fixed_value in (fixed or {}).items():
        if name not in parameter_columns(points):
            hint = did_you_mean(name, parameter_columns(points))
            raise ResultsError(f"'{name}' is no parameter of this study{hint}")
        chosen = chosen[np.isclose(chosen[name], fixed_value, rtol=1e-6, atol=0.0)]
        if not len(chosen):
            raise ResultsError(f"no design point has {name} = {fixed_value:g}")
    others = [name for name in varied if name not in along]
    if not others:
        return chosen, ""
    count = pd.Series(unstable[rows_in(points, chosen)], index=chosen.index)
    group = chosen.groupby(others, dropna=False).ngroup()
    totals, sizes = count.groupby(group).sum(), count.groupby(group).size()
    best = totals == totals.max()
    largest = sizes[best].idxmax()  # among equals that with most points, then the first
    kind = "lines" if len(along) == 1 else "slices"
    return chosen[(group == largest).to_numpy()], _reason(f"{len(totals)} {kind}", totals, best)


def _reason(of: str, totals: pd.Series, best: pd.Series) -> str:
    """Why one of several slices with these total numbers of unstable modes was chosen."""
    if len(totals) == 1:
        return ""
    if not totals.max() > 0:
        return f"one of {of}, none with an unstable mode"
    which = f"one of the {int(best.sum())}" if best.sum() > 1 else "the one"
    return f"of {of} {which} with most unstable modes"


def describe(
    point: pd.Series, points: pd.DataFrame, names: list[str], units: Mapping[str, str]
) -> str:
    """Values of a point's parameters with units, in one line."""
    return ", ".join(quantity(name, points[name], units).text(point[name]) for name in names)


def from_where(onsets: pd.DataFrame, shown: Quantity) -> str:
    """Where tracks first turn unstable, the first few: ``: T1 from friction 0.288, T4 from 0.29``.

    Empty where no onset is known. `onsets` has ``track``, ``x`` as drawn, and ``direction``.
    """
    turning = onsets[(onsets["direction"] == "in").to_numpy(bool)]
    first = turning.sort_values("x", kind="stable").drop_duplicates("track")
    pairs = zip(first["track"].tolist(), first["x"].tolist(), strict=True)
    listed = [f"{track_number(t)} from {x:.3g}" for t, x in pairs][:MOST_FIRST_ONSETS]
    if not listed:
        return ""
    listed[0] = listed[0].replace(" from ", f" from {shown.name} ") + f" {shown.unit}".rstrip()
    return f": {', '.join(listed)}{', ...' if len(first) > len(listed) else ''}"


def turns_in_words(onsets: pd.DataFrame) -> str:
    """Meaning of the bars on curves, by the directions that occur."""
    words = {"in": "onset", "out": "stable again"}
    return f"{' or '.join(words[d] for d in words if (onsets['direction'] == d).any())}, refined"


def refined_onsets(
    results: Results, shown: Quantity, line: pd.DataFrame, others: Sequence[str]
) -> pd.DataFrame:
    """Refined onsets on a line; none if the line is along another parameter than that of onsets."""
    columns = ["track", "x", "frequency_hz", "direction"]
    table = results.onsets if "onsets" in results.tables else None
    if table is None or shown.name != results.along or not {*others} <= {*table.columns}:
        return pd.DataFrame(columns=columns)
    is_located = (table["status"].isin(REFINED_ONSETS) & table["onset"].notna()).to_numpy(bool)
    for name in others:
        on_value = np.isclose(table[name].to_numpy(float), float(line[name].iloc[0]), rtol=1e-9)
        is_located = is_located & on_value  # a new array: pandas' own may be read-only
    on_line = table[is_located]
    return on_line.assign(x=shown.scaled(on_line["onset"]))[columns].reset_index(drop=True)
