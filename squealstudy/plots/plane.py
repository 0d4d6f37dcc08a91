"""Two parameters of a study: what is unstable at each of their design points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.tri import Triangulation

from squealstudy.errors import ResultsError
from squealstudy.plots.style import Quantity, joined, quantity
from squealstudy.plots.tables import describe, oscillating, slice_points
from squealstudy.tables.mode_ranking import parameter_columns

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MEASURES = {"count": "Unstable modes", "growth": "Largest growth rate [1/s]"}
FILLED = 0.5  # share of the cells with a design point from which on a plane is a grid


@dataclass(frozen=True)
class StudyPlane:
    """Tables of one plane, one row a design point.

    Attributes
    ----------
    rows : ndarray (n,) of int
        Places of the design points in the points table.
    across, up : Quantity
        The two parameters.
    x, y : ndarray (n,)
        Their values as drawn.
    value : ndarray (n,)
        The measure, NaN where the point failed.
    point_ids : ndarray (n,) of str
    known, unstable : ndarray (n,) of bool
        Points that were solved, and those at which any mode is unstable.
    damping_ratio : ndarray (n,)
        The least of a point's oscillating modes, NaN where there is none.
    gridded : bool
        The points fill a grid.
    elsewhere : str
        What is fixed and why there, or varies besides.
    others_vary : bool
        Points of the plane differ in other parameters too.
    """

    rows: np.ndarray
    across: Quantity
    up: Quantity
    x: np.ndarray
    y: np.ndarray
    value: np.ndarray
    point_ids: np.ndarray
    known: np.ndarray
    unstable: np.ndarray
    damping_ratio: np.ndarray
    gridded: bool
    elsewhere: str
    others_vary: bool

    def cells(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Columns (nx,), rows (ny,) and values (ny, nx), NaN where there is no point."""
        x, i = np.unique(self.x, return_inverse=True)
        y, j = np.unique(self.y, return_inverse=True)
        table = np.full((len(y), len(x)), np.nan)
        table[j, i] = values
        return x, y, table

    def polygons(self) -> Iterator[np.ndarray]:
        """Rows of the design points at the corners of each cell or triangle, counterclockwise.

        Those with a failed corner are left out, and those whose corners agree in stability.
        """
        if self.gridded:
            _, _, place = self.cells(np.arange(len(self.x)))
            corners = [place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]]
            found = np.stack([c.ravel() for c in corners], axis=1)
            found = found[np.isfinite(found).all(axis=1)].astype(int)
        else:
            mesh = self.triangles(np.where(self.known, 0.0, np.nan))
            rows = np.flatnonzero(self.known)
            found = np.zeros((0, 3), dtype=int) if mesh is None else rows[mesh.triangles]
        state = self.unstable[found]
        mixed = state.any(axis=1) & ~state.all(axis=1) & self.known[found].all(axis=1)
        yield from found[mixed]

    def triangles(self, values: np.ndarray) -> Triangulation | None:
        """Triangles between the points with a value; None where they span no area."""
        known = np.isfinite(values)
        if self.others_vary or known.sum() < 3:
            return None
        place = [q.stretched(v[known]) for q, v in ((self.across, self.x), (self.up, self.y))]
        if np.linalg.matrix_rank(_centred(place), 1e-6) < 2:
            return None
        return Triangulation(self.x[known], self.y[known], Triangulation(*place).triangles)


def _centred(place: list[np.ndarray]) -> np.ndarray:
    return np.array([p - p.mean() for p in place])


def study_plane(
    results: Results,
    along: tuple[str, str],
    fixed: Mapping[str, float] | None = None,
    measure: str = "count",
) -> StudyPlane:
    """The plane of two parameters; of what `fixed` leaves open, that with most unstable modes.

    Scattered designs have no such planes: all their points are taken. Raises ResultsError.
    """
    if measure not in MEASURES:
        raise ResultsError(f"'{measure}' cannot be shown, expected {' or '.join(MEASURES)}")
    if along[0] == along[1]:
        raise ResultsError(f"a map needs two parameters, got '{along[0]}' twice")
    points, modes, units = results.nodes[0], results.modes, results.units
    plane, why = slice_points(points, modes, along, fixed)
    counts = [plane[name].nunique() for name in along]
    gridded = min(counts) > 1 and len(plane) >= FILLED * counts[0] * counts[1]
    if not gridded:
        every = tuple(parameter_columns(points, varied=True))
        plane, why = slice_points(points, modes, every, fixed)
    rows = modes[modes["point_id"].isin(plane["point_id"])]
    others = [n for n in parameter_columns(points, varied=True) if n not in along]
    vary = [name for name in others if name in parameter_columns(plane, varied=True)]
    held = describe(plane.iloc[0], points, [n for n in others if n not in vary], units)
    besides = f"also varied: {', '.join(vary)}" if vary else ""
    count = _measured(plane, rows, "count")
    across, up = (quantity(name, points[name], units) for name in along)
    return StudyPlane(
        rows=points.index.get_indexer(plane.index),
        across=across,
        up=up,
        x=across.scaled(plane[along[0]]),
        y=up.scaled(plane[along[1]]),
        value=count if measure == "count" else _measured(plane, rows, measure),
        point_ids=plane["point_id"].to_numpy(dtype=object),
        known=np.isfinite(count),
        unstable=count > 0,
        damping_ratio=_least_damping(plane, rows),
        gridded=gridded,
        elsewhere=joined(held, why, besides, by=", "),
        others_vary=bool(vary),
    )


def _measured(plane: pd.DataFrame, rows: pd.DataFrame, measure: str) -> np.ndarray:
    if measure == "count":
        found = rows[rows["unstable"].to_numpy(bool)].groupby("point_id").size()
        value = plane["point_id"].map(found).fillna(0.0)
    else:
        judged = rows[~rows["overdamped"].to_numpy(bool) | rows["unstable"].to_numpy(bool)]
        value = plane["point_id"].map(judged.groupby("point_id")["growth_rate"].max())
    return value.where(plane["status"] == "ok").to_numpy(dtype=float)


def _least_damping(plane: pd.DataFrame, rows: pd.DataFrame) -> np.ndarray:
    """Of the oscillating modes of each point (n,), NaN where there is none."""
    least = oscillating(rows).groupby("point_id")["damping_ratio"].min()
    return plane["point_id"].map(least).to_numpy(dtype=float)
