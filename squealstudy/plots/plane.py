"""Design points over two parameters of a study, with their stability, for maps of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.tri import TriAnalyzer, Triangulation
from scipy.ndimage import maximum_filter

from squealstudy.errors import ResultsError
from squealstudy.plots.style import Quantity, joined, quantity, set_scales, set_ticks
from squealstudy.plots.tables import describe, slice_points
from squealstudy.study.sweeps import RANDOM_DESIGNS
from squealstudy.tables.mode_ranking import parameter_columns
from squealstudy.tables.point_rows import ROW, largest_by_code, rows_in
from squealstudy.wording import did_you_mean

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MEASURES = {"count": "Unstable modes", "growth": "Largest growth rate [1/s]"}
MOST_CELLS = (450, 300)  # cells of a picture, about 2 pixels each
N_CELLS = (150, 100)  # cells in which many scattered points are gathered
MOST_DOTS = 20_000  # scattered points that are drawn; more would cover one another
# points near a change of stability are those with points of both states within this many cells
POINTS_PER_CELL, N_NEIGHBOUR_CELLS = 8, 2  # (mean number of points in a cell)
MIN_INSCRIBED_RATIO = 0.01  # flatter triangles are left out: inscribed over circumscribed radius
MIN_GRID_SHARE = 0.5  # least share of cells with a design point in a plane that counts as a grid


@dataclass(frozen=True)
class Plane:
    """Rows of a table as points of a plane, over two columns of the table.

    Attributes
    ----------
    across, up : Quantity
        The two columns.
    x, y : ndarray (n,)
        Values of the columns in the units of the picture.
    """

    across: Quantity
    up: Quantity
    x: np.ndarray
    y: np.ndarray

    def cells(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ascending x (nx,) and y (ny,), and values as a table (ny, nx); NaN without a point."""
        x, i = np.unique(self.x, return_inverse=True)
        y, j = np.unique(self.y, return_inverse=True)
        table = np.full((len(y), len(x)), np.nan)
        table[j, i] = values
        return x, y, table

    def frame(self, axes: Axes, table: pd.DataFrame) -> None:
        """Set scales and ticks of the axes for a table, before anything is drawn."""
        set_scales(axes, self.across, self.up)
        for axis, shown in ((axes.xaxis, self.across), (axes.yaxis, self.up)):
            set_ticks(axis, shown, table[shown.name])

    def draw_cells(self, axes: Axes, values: np.ndarray, **style: Any) -> ScalarMappable:
        """Draw cells coloured by values (n,), hatched where there is no value.

        Where several cells are drawn as one (`merged`), their largest value is shown.
        """
        axes.patch.set(hatch="///", edgecolor="0.75", facecolor="white")
        x, y, table = self.cells(values)
        edges = [self.across.edges(x), self.up.edges(y)]
        for axis, n_merged in enumerate(self.merged):
            starts = np.arange(0, table.shape[1 - axis], n_merged)
            table = np.fmax.reduceat(table, starts, axis=1 - axis)
            edges[axis] = np.append(edges[axis][starts], edges[axis][-1])
        return axes.pcolormesh(*edges, np.ma.masked_invalid(table), **style)

    @cached_property
    def merged(self) -> tuple[int, int]:
        """Numbers of columns and of rows of a large grid that are drawn as one."""
        counts = (len(np.unique(v)) for v in (self.x, self.y))
        across, up = (-(-n // most) for n, most in zip(counts, MOST_CELLS, strict=True))
        return across, up

    def draw_bins(self, axes: Axes, values: np.ndarray, **style: Any) -> ScalarMappable:
        """Draw equal cells coloured by the largest of the values (n,) of the points inside."""
        finite = np.isfinite(values)
        bin_numbers = np.zeros(int(finite.sum()), dtype=np.int64)
        edges = []
        for shown, drawn, count in (
            (self.up, self.y, N_CELLS[1]),
            (self.across, self.x, N_CELLS[0]),
        ):
            even = shown.even(drawn[finite])
            ends = np.linspace(even.min(), even.max(), count + 1)
            inside = np.clip(np.searchsorted(ends, even, "right") - 1, 0, count - 1)
            bin_numbers = bin_numbers * count + inside
            edges.append(shown.uneven(ends))
        table = largest_by_code(values[finite], bin_numbers, N_CELLS[0] * N_CELLS[1]).reshape(
            N_CELLS[1], N_CELLS[0]
        )
        return axes.pcolormesh(edges[1], edges[0], np.ma.masked_invalid(table), **style)


@dataclass(frozen=True)
class StudyPlane(Plane):
    """Design points of one plane, with their stability.

    Attributes
    ----------
    rows : ndarray (n,) of int
        Rows of the design points, or nodes, in their table.
    value : ndarray (n,)
        The measure that is shown; NaN where the point failed.
    point_ids : ndarray (n,) of str
        Ids of the points.
    solved, unstable : ndarray (n,) of bool
        Points that were solved; points at which a mode is unstable.
    damping_ratio : ndarray (n,)
        Least damping ratio of a point's oscillating modes; NaN where there is none.
    gridded : bool
        Whether the points fill a grid.
    elsewhere : str
        Text on the values of fixed parameters, why these were chosen, and which parameters vary.
    others_vary : bool
        Whether points of the plane differ in other parameters too.
    """

    rows: np.ndarray
    value: np.ndarray
    point_ids: np.ndarray
    solved: np.ndarray
    unstable: np.ndarray
    damping_ratio: np.ndarray
    gridded: bool
    elsewhere: str
    others_vary: bool

    def polygons(self) -> Iterator[np.ndarray]:
        """Yield the points at the corners of each cell or triangle, counterclockwise.

        Cells and triangles with a failed corner, or whose corners agree in stability, are left out.
        """
        if self.gridded:
            _, _, cell_index = self.cells(np.arange(len(self.x)))
            corners = [
                cell_index[:-1, :-1],
                cell_index[:-1, 1:],
                cell_index[1:, 1:],
                cell_index[1:, :-1],
            ]
            corner_rows = np.stack([c.ravel() for c in corners], axis=1)
            corner_rows = corner_rows[np.isfinite(corner_rows).all(axis=1)].astype(int)
        else:
            rows = np.flatnonzero(self.near_changes)
            mesh = self.triangles(np.where(self.near_changes, 0.0, np.nan))
            corner_rows = np.zeros((0, 3), dtype=int) if mesh is None else rows[mesh.triangles]
        state = self.unstable[corner_rows]
        mixed = state.any(axis=1) & ~state.all(axis=1) & self.solved[corner_rows].all(axis=1)
        yield from corner_rows[mixed]

    @cached_property
    def near_changes(self) -> np.ndarray:
        """Mask (n,) of the solved points that can be corners of triangles of unlike stability.

        Of few points all count. Of very many those count that lie near the edge or near points of
        the other stability, at most N_NEIGHBOUR_CELLS cells away. Cells hold equal shares of the
        values on each axis.
        """
        is_solved, n_solved = self.solved, int(self.solved.sum())
        if n_solved <= MOST_DOTS:
            return is_solved
        count = int(np.sqrt(n_solved / POINTS_PER_CELL))
        ranks = [np.searchsorted(np.sort(v[is_solved]), v) for v in (self.x, self.y)]
        cell = [np.minimum(rank * count // n_solved, count - 1) for rank in ranks]
        is_cell_near = np.ones((count, count), dtype=bool)
        for state in (self.unstable, ~self.unstable):
            has_state = np.zeros_like(is_cell_near)
            has_state[tuple(c[is_solved & state] for c in cell)] = True
            is_cell_near &= maximum_filter(has_state, 2 * N_NEIGHBOUR_CELLS + 1)
        is_cell_near = np.pad(
            is_cell_near[
                N_NEIGHBOUR_CELLS:-N_NEIGHBOUR_CELLS, N_NEIGHBOUR_CELLS:-N_NEIGHBOUR_CELLS
            ],
            N_NEIGHBOUR_CELLS,
            constant_values=True,
        )
        is_near: np.ndarray = is_solved & is_cell_near[tuple(cell)]
        return is_near

    def triangles(self, values: np.ndarray) -> Triangulation | None:
        """Triangles between points with a value; None if there are none or other parameters vary.

        Very flat triangles along the edge are left out: their corners are no neighbours.
        """
        finite = np.isfinite(values)
        if self.others_vary or finite.sum() < 3:
            return None
        shifted = []
        for shown, drawn in ((self.across, self.x), (self.up, self.y)):
            even = shown.even(drawn[self.solved])  # one scale, whichever points have a value
            shifted.append((shown.even(drawn[finite]) - even.min()) / (np.ptp(even) or 1.0))
        if np.linalg.matrix_rank(np.array([p - p.mean() for p in shifted]), 1e-6) < 2:
            return None
        even_mesh = Triangulation(*shifted)
        flat = TriAnalyzer(even_mesh).get_flat_tri_mask(MIN_INSCRIBED_RATIO, rescale=False)
        not_flat = even_mesh.triangles[~flat]
        return Triangulation(self.x[finite], self.y[finite], not_flat) if len(not_flat) else None


def study_plane(
    results: Results,
    along: tuple[str, str],
    fixed: Mapping[str, float] | None = None,
    measure: str = "count",
) -> StudyPlane:
    """The design points in the plane of two parameters.

    Other parameters have the values `fixed`, else those of the plane with most unstable modes. A
    random design has no such planes: all its points are taken. ResultsError for an unknown
    parameter, value or measure.
    """
    if measure not in MEASURES:
        raise ResultsError(
            f"'{measure}' cannot be shown, expected {' or '.join(MEASURES)}"
            + did_you_mean(measure, MEASURES)
        )
    if along[0] == along[1]:
        raise ResultsError(f"a map needs two parameters, got '{along[0]}' twice")
    points, units = results.nodes[0], results.units
    solved_row = np.arange(len(points))
    if results.boundary is not None:  # filled nodes have the id of a solved neighbour
        solved_row = pd.Index(results.points["point_id"]).get_indexer(pd.Index(points["point_id"]))
    number, growth, damping = (values[solved_row] for values in _stability_of_points(results))
    plane, why = slice_points(points, number, along, fixed)
    counts = [plane[name].nunique() for name in along]
    gridded = min(counts) > 1 and len(plane) >= MIN_GRID_SHARE * counts[0] * counts[1]
    gridded &= results.design not in RANDOM_DESIGNS  # three points of Sobol indices look like one
    if not gridded:
        all_varied = tuple(parameter_columns(points, varied=True))
        plane, why = slice_points(points, number, all_varied, fixed)
    others = [n for n in parameter_columns(points, varied=True) if n not in along]
    vary = [name for name in others if name in parameter_columns(plane, varied=True)]
    fixed_text = describe(plane.iloc[0], points, [n for n in others if n not in vary], units)
    besides = f"also varied: {', '.join(vary)}" if vary else ""
    point_rows = rows_in(points, plane)
    ok = (plane["status"] == "ok").to_numpy(bool)
    count = np.where(ok, number[point_rows], np.nan)
    across, up = (quantity(name, points[name], units) for name in along)
    return StudyPlane(
        rows=point_rows,
        across=across,
        up=up,
        x=across.scaled(plane[along[0]]),
        y=up.scaled(plane[along[1]]),
        value=count if measure == "count" else np.where(ok, growth[point_rows], np.nan),
        point_ids=plane["point_id"].to_numpy(dtype=object),
        solved=np.isfinite(count),
        unstable=count > 0,
        damping_ratio=damping[point_rows],
        gridded=gridded,
        elsewhere=joined(fixed_text, why, besides, by=", "),
        others_vary=bool(vary),
    )


def _stability_of_points(results: Results) -> tuple[np.ndarray, ...]:
    """Number of unstable modes, largest growth rate and least damping ratio (n,) of each point.

    Growth rates are those of oscillating modes and of unstable roots, damping ratios those of
    oscillating modes; NaN where a point has none.
    """
    n = len(results.points)
    count, extremes = np.zeros(n, dtype=np.int64), [np.full(n, -np.inf) for _ in range(2)]
    columns = [ROW, "unstable", "overdamped", "growth_rate", "damping_ratio"]
    for modes in results.batches("modes", columns):
        code = modes[ROW].to_numpy()
        unstable, real = (modes[name].to_numpy(bool) for name in ("unstable", "overdamped"))
        growth, zeta = (modes[c].to_numpy(dtype=float) for c in ("growth_rate", "damping_ratio"))
        counted = ~real | unstable
        count += np.bincount(code[unstable], minlength=n)
        np.maximum.at(extremes[0], code[counted], growth[counted])
        np.maximum.at(extremes[1], code[~real], -zeta[~real])
    fastest, least_damping = (np.where(np.isfinite(values), values, np.nan) for values in extremes)
    return count, fastest, -least_damping
