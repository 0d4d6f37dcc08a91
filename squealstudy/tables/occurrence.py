"""How often squeal occurs in bins of frequency and level, to lay beside what a test has counted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError


def occurrence(
    points: pd.DataFrame,
    squeals: pd.DataFrame,
    level: str,
    bins_hz: Sequence[float],
    bins: Sequence[float],
    weights: Sequence[float] | None = None,
) -> pd.DataFrame:
    """One row for each bin: the number of solved design points at which something squeals in it.

    A design point counts once in a bin however many of its modes are there, and in every bin that
    has one of them. A bin holds its lower edge and not its upper one.

    Parameters
    ----------
    points : DataFrame
        ``point_id`` and ``status``; only points that are ``ok`` count.
    squeals : DataFrame
        One row for each mode or vibration that squeals: ``point_id``, ``frequency_hz``, the level.
    level : str
        Column of `squeals`.
    bins_hz : sequence of float
        Edges of the bins of frequency, ascending, Hz.
    bins : sequence of float
        Edges of the bins of the level, ascending.
    weights : sequence of float or None
        How often each of the points occurs, on any scale; alike by default.

    Returns
    -------
    DataFrame
        ``frequency_low_hz``, ``frequency_high_hz``, ``level_low``, ``level_high``, ``n_points``,
        ``share`` of all solved points by weight. Unsolved ones are in ``attrs["n_unsolved"]``,
        squeals in no bin in ``attrs["n_outside"]``.

    Raises
    ------
    ResultsError
        Edges that do not ascend, fewer than two; weights that do not fit; no point that is solved.
    """
    hz_edges, level_edges = (_edges(name, e) for name, e in (("bins_hz", bins_hz), ("bins", bins)))
    weight = np.ones(len(points)) if weights is None else np.asarray(weights, dtype=float)
    if weight.shape != (len(points),) or not (weight >= 0).all():
        raise ResultsError(f"expected a weight of at least 0 for each of {len(points)} points")
    solved = (points["status"] == "ok").to_numpy(bool)
    total_weight = float(weight[solved].sum())
    if not total_weight > 0:
        raise ResultsError("no design point that counts is solved")
    by_id = pd.Series(weight[solved], index=points["point_id"].to_numpy()[solved])
    of_points = squeals[squeals["point_id"].isin(by_id.index).to_numpy(bool)]
    column = np.searchsorted(hz_edges, of_points["frequency_hz"].to_numpy(float), side="right") - 1
    row = np.searchsorted(level_edges, of_points[level].to_numpy(float), side="right") - 1
    inside = (
        (column >= 0) & (column < len(hz_edges) - 1) & (row >= 0) & (row < len(level_edges) - 1)
    )
    cells = pd.DataFrame({"column": column, "row": row, "id": of_points["point_id"].to_numpy()})
    points_of_cell = cells[inside].drop_duplicates().groupby(["column", "row"])["id"]
    counts, shares = (
        points_of_cell.count(),
        points_of_cell.agg(lambda ids: float(by_id.loc[ids].sum()) / total_weight),
    )
    rows = [
        {
            "frequency_low_hz": hz_edges[k],
            "frequency_high_hz": hz_edges[k + 1],
            "level_low": level_edges[j],
            "level_high": level_edges[j + 1],
            "n_points": int(counts.get((k, j), 0)),
            "share": float(shares.get((k, j), 0.0)),
        }
        for k in range(len(hz_edges) - 1)
        for j in range(len(level_edges) - 1)
    ]
    table = pd.DataFrame(rows)
    table.attrs |= {"n_unsolved": int((~solved).sum()), "n_outside": int((~inside).sum())}
    return table


def _edges(name: str, edges: Sequence[float]) -> np.ndarray:
    as_array = np.asarray(edges, dtype=float)
    if as_array.ndim != 1 or len(as_array) < 2 or not (np.diff(as_array) > 0).all():
        raise ResultsError(f"{name}: expected two or more edges that ascend, got {list(edges)}")
    return as_array
