"""Fills the grid of a boundary design, so that its map, ranking and shares count every node.

The design solves nodes near stability boundaries only. Each other node gets the results of a solved
neighbour.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError
from squealstudy.tables.mode_ranking import unstable_groups
from squealstudy.tables.point_rows import ROW, point_codes
from squealstudy.tables.stability import is_uncertain

FILLED = (
    "~"  # in the id of a filled node: between id of the solved neighbour and number of the node
)


def full_points(
    points: pd.DataFrame, axes: Mapping[str, Sequence[float]], levels: int
) -> tuple[pd.DataFrame, np.ndarray]:
    """The points table with one row for each node of the full grid, the first parameter fastest.

    The row of a node that was not solved is that of the nearest corner of its cell, with the
    corner's `point_id`, but the node's parameter values. All solved nodes of such a cell agree in
    which modes are unstable.

    Parameters
    ----------
    points : DataFrame
        Points of a study with a boundary design.
    axes : mapping of parameter -> values
        Values of each parameter on the full grid.
    levels : int
        Largest number of times that cells of the coarse grid were halved.

    Returns
    -------
    table : DataFrame (n_nodes,)
    solved : ndarray (n_nodes,) of bool
        The nodes that are points of the study and did not fail.

    Raises
    ------
    ResultsError
        Points that are not those of a boundary design.
    """
    rows = _node_rows(points, axes)
    row_of_node = _filled_rows(rows, 2**levels)
    table = points.iloc[row_of_node.ravel(order="F")].reset_index(drop=True)
    grids = np.meshgrid(*axes.values(), indexing="ij")
    values = {n: g.ravel(order="F") for n, g in zip(axes, grids, strict=True)}
    solved = (rows.ravel(order="F") >= 0) & (table["status"] == "ok").to_numpy(bool)
    return table.assign(**values), solved


def full_tables(
    points: pd.DataFrame, modes: pd.DataFrame, axes: Mapping[str, Sequence[float]], levels: int
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tables of points and modes on the full grid, for a ranking.

    Ids of points are unique. Modes of tracks that are stable everywhere are left out, except modes
    whose stability is uncertain. The column ROW of a mode is the row of its node.
    """
    table = full_points(points, axes, levels)[0]
    group = unstable_groups(modes)
    track = modes["track"].to_numpy()
    is_ranked = (group != 0) | np.isin(track, group[group > 0]) | is_uncertain(modes)
    rows = np.flatnonzero(is_ranked)
    code = point_codes(points, modes)[rows]
    rows, code = (a[np.argsort(code, kind="stable")] for a in (rows, code))
    row_of_node = pd.Index(points["point_id"]).get_indexer(pd.Index(table["point_id"]))
    first, last = (np.searchsorted(code, row_of_node, side=s) for s in ("left", "right"))
    count = last - first
    positions = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    chosen = rows[np.repeat(first, count) + positions]
    repeated = table["point_id"].duplicated().to_numpy()
    number = np.arange(len(table)).astype(str)
    ids = table["point_id"].to_numpy(dtype=object)
    ids = np.where(repeated, ids + FILLED + number, ids)
    spread = modes.iloc[chosen].assign(**{ROW: np.repeat(np.arange(len(table)), count)})
    if "point_id" in spread:
        spread["point_id"] = np.repeat(ids, count)
    return table.assign(point_id=ids), spread.reset_index(drop=True)


def _node_rows(points: pd.DataFrame, axes: Mapping[str, Sequence[float]]) -> np.ndarray:
    """Row in `points` of each node of the full grid, -1 where it was not solved."""
    rows = np.full([len(values) for values in axes.values()], -1)
    indices = []
    for name, values in axes.items():
        index = pd.Index(values).get_indexer(pd.Index(points[name]))
        if (index < 0).any():
            raise ResultsError(f"the points table has values of '{name}' that are not on the map")
        indices.append(index)
    rows[tuple(indices)] = np.arange(len(points))
    return rows


def _filled_rows(rows: np.ndarray, stride: int) -> np.ndarray:
    """Row in `points` that stands for each node: its own, else a corner of its smallest cell."""
    cells = sorted(_unhalved_cells(rows, stride), key=lambda leaf: leaf[1])
    row_of_node = rows.copy()
    for corner, size in cells:
        box = tuple(slice(c, c + size + 1) for c in corner)
        nearer_node = np.where(2 * np.arange(size + 1) > size, size, 0)
        nearest = rows[np.ix_(*(c + nearer_node for c in corner))]
        if (nearest < 0).any():
            raise ResultsError("the points table lacks corners of cells of its map")
        row_of_node[box] = np.where(row_of_node[box] < 0, nearest, row_of_node[box])
    return row_of_node


def _unhalved_cells(rows: np.ndarray, stride: int) -> Iterator[tuple[tuple[int, ...], int]]:
    """Lowest node and stride of each cell that was not halved, as its middle was not solved."""
    pending = [
        (corner, stride)
        for corner in itertools.product(*(range(0, n - 1, stride) for n in rows.shape))
    ]
    while pending:
        corner, size = pending.pop()
        half = size // 2
        if size == 1 or rows[tuple(c + half for c in corner)] < 0:
            yield corner, size
            continue
        shifts = itertools.product((0, half), repeat=len(corner))
        pending += [(tuple(c + s for c, s in zip(corner, t, strict=True)), half) for t in shifts]
