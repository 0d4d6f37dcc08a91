"""Two parameters of a study: what is unstable at each of their design points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.tri import Triangulation

from squealstudy.analysis.tables.mode_ranking import parameter_columns
from squealstudy.errors import ResultsError
from squealstudy.plots.style import Quantity, quantity
from squealstudy.plots.tables import describe, oscillating, slice_points, worst_tracks

MEASURES = {"count": "Unstable modes", "growth": "Largest growth rate [1/s]"}
ROUNDING = 1e-9  # of a damping ratio
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
    damping_ratio : DataFrame (n, tracks)
        Of the tracks of fastest growth, NaN where a track has no mode.
    worst : DataFrame
        The row of largest growth of each of them.
    gridded : bool
        The points fill a grid.
    elsewhere : str
        What is fixed, or varies besides.
    others_vary : bool
        Points of the plane differ in other parameters too.
    """

    rows: np.ndarray
    across: Quantity
    up: Quantity
    x: np.ndarray
    y: np.ndarray
    value: np.ndarray
    damping_ratio: pd.DataFrame
    worst: pd.DataFrame
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

    def triangles(self, values: np.ndarray) -> Triangulation | None:
        """Triangles between the points with a value; None where they span no area."""
        known = np.isfinite(values)
        place = [q.stretched(v[known]) for q, v in ((self.across, self.x), (self.up, self.y))]
        if self.others_vary or known.sum() < 3 or np.linalg.matrix_rank(_centred(place), 1e-6) < 2:
            return None
        return Triangulation(self.x[known], self.y[known], Triangulation(*place).triangles)


def _centred(place: list[np.ndarray]) -> np.ndarray:
    return np.array([p - p.mean() for p in place])


def study_plane(
    points: pd.DataFrame,
    modes: pd.DataFrame,
    along: tuple[str, str],
    fixed: Mapping[str, float] | None,
    units: Mapping[str, str] | None,
    measure: str,
    top: int,
) -> StudyPlane:
    """The plane of two parameters; of what `fixed` leaves open, that with most unstable modes.

    Scattered designs have no such planes: all their points are taken. Raises ResultsError.
    """
    if measure not in MEASURES:
        raise ResultsError(f"'{measure}' cannot be shown, expected {' or '.join(MEASURES)}")
    if along[0] == along[1]:
        raise ResultsError(f"a map needs two parameters, got '{along[0]}' twice")
    plane = slice_points(points, modes, along, fixed)
    counts = [plane[name].nunique() for name in along]
    gridded = min(counts) > 1 and len(plane) >= FILLED * counts[0] * counts[1]
    if not gridded:
        plane = slice_points(points, modes, tuple(parameter_columns(points, varied=True)), fixed)
    rows = modes[modes["point_id"].isin(plane["point_id"])]
    worst = worst_tracks(oscillating(rows), top)
    others = [n for n in parameter_columns(points, varied=True) if n not in along]
    vary = [name for name in others if name in parameter_columns(plane, varied=True)]
    held = describe(plane.iloc[0], points, [n for n in others if n not in vary], units)
    besides = f"also varied: {', '.join(vary)}" if vary else ""
    across, up = (quantity(name, points[name], units) for name in along)
    return StudyPlane(
        points.index.get_indexer(plane.index),
        across,
        up,
        across.scaled(plane[along[0]]),
        up.scaled(plane[along[1]]),
        _measured(plane, rows, measure),
        _damping(plane, rows, worst),
        worst,
        gridded,
        ", ".join(part for part in (held, besides) if part),
        bool(vary),
    )


def _measured(plane: pd.DataFrame, rows: pd.DataFrame, measure: str) -> np.ndarray:
    if measure == "count":
        found = rows[rows["unstable"].to_numpy(bool)].groupby("point_id").size()
        value = plane["point_id"].map(found).fillna(0.0)
    else:
        value = plane["point_id"].map(oscillating(rows).groupby("point_id")["growth_rate"].max())
    return value.where(plane["status"] == "ok").to_numpy(dtype=float)


def _damping(plane: pd.DataFrame, rows: pd.DataFrame, worst: pd.DataFrame) -> pd.DataFrame:
    """Of the worst tracks (n, tracks); where it is mere rounding `unstable` gives the sign."""
    tracked = rows[rows["track"].isin(worst["track"])]
    zeta, unstable = tracked["damping_ratio"], tracked["unstable"].astype(bool)
    tracked = tracked.assign(
        damping_ratio=zeta.clip(lower=ROUNDING).where(~unstable, zeta.clip(upper=-ROUNDING))
    )
    wide = tracked.pivot_table("damping_ratio", "point_id", "track", aggfunc="first")
    return wide.reindex(index=plane["point_id"], columns=worst["track"])
