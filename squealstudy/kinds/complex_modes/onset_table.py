"""First onsets of a grid of many designs: rows are values of one parameter, columns of the others.

For few designs `design_table` tells more, with a row for each.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from rich.console import RenderableType

from squealstudy.kinds.complex_modes.design_lines import GRID, MOST_DESIGNS
from squealstudy.screen import grid, notes
from squealstudy.shown_units import prefixed
from squealstudy.tables.mode_ranking import parameter_columns
from squealstudy.tables.stability import (
    BRACKETED,
    BROKEN,
    CROSSING,
    FIRST_SEEN,
    INEXACT,
    INTO,
    OUT_OF,
    REFINED_ONSETS,
)
from squealstudy.wording import amount

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

MOST_ROWS, MOST_COLUMNS = 13, 6  # of the table; of more rows some are shown, of more columns none
BELOW, NEVER = -np.inf, np.inf  # in place of an onset
BOUNDS = (FIRST_SEEN.replace(" ", "_"), BRACKETED)  # status of onsets put at an unstable point


def onset_table(results: ResultTables) -> list[RenderableType]:
    """Table of the first onset of each design; empty where designs are few, or columns too many."""
    along = results.along
    if not along or results.design != GRID or results.boundary is not None:
        return []
    if "onsets" not in results.tables:
        return []
    first = first_onsets(results, along)
    names = [str(name) for name in first.index.names]
    if len(first) <= MOST_DESIGNS or (first["onset"] == BELOW).all():
        return []  # the answer says that all are unstable at the least value
    units, top = results.units, float(results.points[along].max())
    unit = units.get(along, "")
    ends = last_ends(results, along).reindex(first.index)
    pairs = zip(first.to_numpy(), ends.to_numpy(), strict=True)
    onsets = pd.Series(
        [_cell(onset, mark, end, bound, top, unit) for (onset, mark), (end, bound) in pairs],
        first.index,
    )
    counts = {name: first.index.get_level_values(name).nunique() for name in names}
    down = max(names, key=counts.__getitem__)
    others = [name for name in names if name != down]
    table = onsets.unstack(others) if others else onsets.to_frame("")  # noqa: PD010 - of a grid
    if table.shape[1] > MOST_COLUMNS:
        return []
    every = len(table)
    table = table.iloc[np.unique(np.linspace(0, every - 1, MOST_ROWS).round().astype(int))]
    largest = float(np.abs(table.index.to_numpy(float)).max())
    shown_unit, factor = prefixed(units.get(down, ""), largest)
    digits = 4 if factor * largest < 1e4 else 6
    numbers = [f"{factor * number:.{digits}g}" for number in table.index]
    if len(set(numbers)) < len(numbers):
        numbers = [f"{factor * number:.9g}" for number in table.index]
    shown = grid(
        f"value:{down} {shown_unit}".rstrip(),
        *(f"value:{_title(column, others, units, along)}" for column in table.columns),
        rows=([number, *row] for number, row in zip(numbers, table.to_numpy(), strict=True)),
    )
    shown_marks = set(first["mark"])
    fewer = f"; {len(table)} of {every} values of {down}" if len(table) < every else ""
    columns = f" at each {', '.join(others)}, a column each" if others else ""
    return [
        shown,
        notes(
            f"least {along} at which a mode turns unstable{columns}{fewer}",
            "~: interpolated between two design points, or put at a point that grows by less than "
            "its error; not refined"
            if INEXACT[CROSSING] in shown_marks
            else "",
            f"<=: the least {along} of a solved point at which some mode is unstable"
            if INEXACT[FIRST_SEEN] in shown_marks
            else "",
            f"to: unstable from the least {along} up to there, and at no larger one"
            if ends["end"].notna().any()
            else "",
            "to <=: the end is between this value and the solved one before"
            if ends["mark"].any()
            else "",
        ),
    ]


def first_onsets(results: ResultTables, along: str) -> pd.DataFrame:
    """First `onset` of each design and its `mark`, indexed by the other varied parameters.

    `onset` is BELOW where a mode is unstable at the least value, NEVER where all points are solved
    and surely stable, and NaN where it is not known. It is the value of an unstable point, an upper
    bound with the mark of one, where a mode grows at a smaller value than that of any onset (real
    roots have none), and where an onset is only bracketed or first seen there. Other onsets that
    are not refined are marked too.
    """
    points = results.points
    names = [n for n in parameter_columns(points, varied=True) if n != along]
    if not names:
        nowhere = pd.MultiIndex.from_arrays([[]], names=[""])
        return pd.DataFrame({"onset": [], "mark": []}, index=nowhere)
    quiet = (points["status"] == "ok") & (points["n_unstable_high"] == 0).fillna(False)
    designs = [points[name] for name in names]
    surely_quiet = quiet.astype(bool).groupby(designs).all()
    start_values = points[along].groupby(designs).min()
    unstable = ((points["status"] == "ok") & (points["n_unstable"] > 0)).fillna(False)
    least_unstable = points[along].where(unstable.astype(bool)).groupby(designs).min()
    into = results.table("onsets")
    into = into[(into["direction"] == INTO).to_numpy(bool) & into["onset"].notna().to_numpy(bool)]
    into = into.sort_values("onset", kind="stable").drop_duplicates(names).set_index(names)
    first = into[["onset", "status"]].reindex(surely_quiet.index)
    exact = first["status"].isin(REFINED_ONSETS) | first["onset"].isna()
    is_beyond = ~(first["onset"] <= least_unstable) & least_unstable.notna()
    is_bound = is_beyond | first["status"].isin(BOUNDS)
    onset = first["onset"].where(~is_beyond, least_unstable)
    is_below = least_unstable == start_values
    onset = onset.where(~is_below, BELOW)
    onset = onset.where(onset.notna() | ~surely_quiet, NEVER)
    of_points = np.where(exact, "", INEXACT[CROSSING])
    mark = np.where(is_bound, INEXACT[FIRST_SEEN], of_points)
    return pd.DataFrame({"onset": onset, "mark": np.where(np.isfinite(onset), mark, "")})


def last_ends(results: ResultTables, along: str) -> pd.DataFrame:
    """The `end` beyond which no mode of a design is unstable, and its `mark`, as `first_onsets`.

    Of designs unstable at the least value and up to there; NaN of others, and where it is not
    refined. Where a track ends unstable it is the first stable value, with the mark of a bound.
    """
    points = results.points
    names = [n for n in parameter_columns(points, varied=True) if n != along]
    onsets = results.table("onsets")
    is_end = (onsets["direction"] == OUT_OF) & onsets["status"].isin([*REFINED_ONSETS, BROKEN])
    of_end = onsets[is_end.to_numpy(bool)]
    values = of_end["onset"].where(of_end["status"] != BROKEN, of_end.get("bracket_high"))
    is_broken = (of_end["status"] == BROKEN).to_numpy(bool)
    ends: dict[Any, float] = {}
    marks: dict[Any, str] = {}
    for design, rows in points.sort_values(along, kind="stable").groupby(names):
        settings, ok = rows[along].to_numpy(float), (rows["status"] == "ok").to_numpy(bool)
        unstable = ok & (rows["n_unstable"] > 0).fillna(False).to_numpy(bool)
        quiet = ok & (rows["n_unstable_high"] == 0).fillna(False).to_numpy(bool)
        n = int(unstable.sum())
        key = design if len(names) > 1 else design[0] if isinstance(design, tuple) else design
        ends[key], marks[key] = np.nan, ""
        if 0 < n < len(rows) and unstable[:n].all() and quiet[n:].all():
            same = np.logical_and.reduce([of_end[p].to_numpy() == rows[p].iloc[0] for p in names])
            at = values.to_numpy(float)
            inside = same & (settings[n - 1] <= at) & (at <= settings[n])
            inside &= ~is_broken | (at > settings[n - 1])
            ends[key] = at[inside].max() if inside.any() else np.nan
            marks[key] = INEXACT[BROKEN] * bool(is_broken[inside].any())
    keys: list[Any] = list(ends)
    index = pd.MultiIndex.from_tuples(keys, names=names) if len(names) > 1 else pd.Index(keys)
    return pd.DataFrame({"end": list(ends.values()), "mark": list(marks.values())}, index)


def _title(column: object, others: list[str], units: dict[str, str], along: str) -> str:
    """Title of a column: the values of the other parameters; without any, what it shows."""
    if not others:
        return f"first onset {along}"
    values = column if isinstance(column, tuple) else (column,)
    shown = zip(others, map(float, values), strict=True)
    if len(others) == 1:
        return f"{others[0]} {amount(float(values[0]), units.get(others[0], ''))}"
    return ", ".join(amount(number, units.get(name, "")) for name, number in shown)


def _cell(onset: float, mark: str, end: float, end_mark: str, top: float, unit: str) -> str:
    if onset == BELOW:
        return f"to {end_mark}{amount(end, unit)}" if end == end else "below range"
    if onset == NEVER:
        return f"none up to {amount(top, unit)}"
    return f"{mark}{amount(onset, unit)}" if onset == onset else "-"
