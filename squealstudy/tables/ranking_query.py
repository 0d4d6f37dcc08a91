"""The points and modes that a query of a ranking counts."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

import numpy as np
import pandas as pd

from squealstudy.tables.condition import Condition, conditions
from squealstudy.tables.point_rows import row_parts


def selection(
    points: pd.DataFrame, modes: pd.DataFrame, code: np.ndarray, where: str | None
) -> tuple[np.ndarray, np.ndarray]:
    """Points that count (n_points,) and modes that are wanted (n_modes,), both bool."""
    points_selected, modes_selected = rows_that_count(points, modes, code, where)
    return points_selected & (points["status"] == "ok").to_numpy(bool), modes_selected


def rows_that_count(
    points: pd.DataFrame, modes: pd.DataFrame, code: np.ndarray, where: str | None
) -> tuple[np.ndarray, np.ndarray]:
    """Rows of `selection`, failed points too."""
    of_points, modes_selected = set(points.columns), np.ones(len(modes), dtype=bool)
    parts = query(where, points.columns, modes.columns)
    for condition in (
        condition_part for condition_part in parts if not condition_part.columns <= of_points
    ):
        mode_columns = modes[[c for c in modes if c in condition.columns - of_points]]
        for rows in row_parts(len(modes)):  # of very many all would be there at once
            used = {c: points[c].array.take(code[rows]) for c in condition.columns & of_points}
            modes_selected[rows] &= condition.holds(mode_columns.iloc[rows].assign(**used))
    return _points_that_count(points, parts), modes_selected


def _points_that_count(points: pd.DataFrame, conditions: Iterable[Condition]) -> np.ndarray:
    """Points (n,) of bool for which the conditions on columns of `points` alone hold."""
    selected = np.ones(len(points), dtype=bool)
    for condition in conditions:
        if condition.columns <= set(points.columns):
            selected &= condition.holds(points)
    return selected


def query(where: str | None, points: Collection[str], modes: Collection[str]) -> list[Condition]:
    """The conditions of a query on tables of such columns; ResultsError."""
    return [] if where is None else conditions(where, [*map(str, points), *map(str, modes)])


def counted_points(points: pd.DataFrame, modes: Collection[str], where: str | None) -> np.ndarray:
    """Points (n,) of bool that count within a query; `modes` are the names of that table."""
    selected = _points_that_count(points, query(where, points.columns, modes))
    return selected & (points["status"] == "ok").to_numpy(bool)


def within_query(
    where: str | None, points: Collection[str], modes: Collection[str], units: Mapping[str, str]
) -> str:
    """Words on a query and the units of its numbers, to follow others; empty without a query."""
    if where is None:
        return ""
    names = set().union(*(condition.columns for condition in query(where, points, modes)))
    texts = [f"{name} in {units[name]}" for name in sorted(names) if units.get(name)]
    return f" within the query, which has {', '.join(texts)}," if texts else " within the query"
