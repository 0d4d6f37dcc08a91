"""Two parameters of a study: what is unstable at each design point, and the line between."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.tri import Triangulation

from squealstudy.errors import ResultsError
from squealstudy.plots.style import Quantity, joined, quantity, set_scales, set_ticks
from squealstudy.plots.tables import describe, slice_points
from squealstudy.tables.mode_ranking import CUBIC, REFINED, parameter_columns
from squealstudy.tables.point_rows import largest, point_codes, rows_in
from squealstudy.tables.stability import INTO

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MEASURES = {"count": "Unstable modes", "growth": "Largest growth rate [1/s]"}
MOST_CELLS = (450, 300)  # of a picture, about 2 pixels each
BINS = (150, 100)  # cells in which scattered points are gathered that would cover one another
FILLED = 0.5  # share of the cells with a design point from which on a plane is a grid
ROUNDING = 1e-9  # of the growing mode's damping ratio: below it a stable point has no damping
Edge = tuple[int, int]  # of the plane's design points: first the stable, then the unstable one


@dataclass(frozen=True)
class Plane:
    """Rows of a table over two of its columns.

    Attributes
    ----------
    across, up : Quantity
        The two columns.
    x, y : ndarray (n,)
        Their values as drawn.
    """

    across: Quantity
    up: Quantity
    x: np.ndarray
    y: np.ndarray

    def cells(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Columns (nx,), rows (ny,) and values (ny, nx), NaN where there is no point."""
        x, i = np.unique(self.x, return_inverse=True)
        y, j = np.unique(self.y, return_inverse=True)
        table = np.full((len(y), len(x)), np.nan)
        table[j, i] = values
        return x, y, table

    def frame(self, axes: Axes, table: pd.DataFrame) -> None:
        """Scales and ticks for the columns of a table; to be called before anything is drawn."""
        set_scales(axes, self.across, self.up)
        for axis, shown in ((axes.xaxis, self.across), (axes.yaxis, self.up)):
            set_ticks(axis, shown, table[shown.name])

    def draw_cells(self, axes: Axes, values: np.ndarray, **style: Any) -> ScalarMappable:
        """Cells coloured by values (n,), of several (`merged`) by the largest; hatched where none.

        An image would show some of very many cells and pass over their neighbours.
        """
        axes.patch.set(hatch="///", edgecolor="0.75", facecolor="white")
        x, y, table = self.cells(values)
        edges = [self.across.edges(x), self.up.edges(y)]
        for axis, together in enumerate(self.merged):
            places = np.arange(0, table.shape[1 - axis], together)
            table = np.fmax.reduceat(table, places, axis=1 - axis)
            edges[axis] = np.append(edges[axis][places], edges[axis][-1])
        return axes.pcolormesh(*edges, np.ma.masked_invalid(table), **style)

    @cached_property
    def merged(self) -> tuple[int, int]:
        """How many columns and rows of a grid are drawn as one: more than pixels show nothing."""
        counts = (len(np.unique(v)) for v in (self.x, self.y))
        across, up = (-(-n // most) for n, most in zip(counts, MOST_CELLS, strict=True))
        return across, up

    def draw_bins(self, axes: Axes, values: np.ndarray, **style: Any) -> ScalarMappable:
        """Equal cells coloured by the largest of the values (n,) of the points inside."""
        known = np.isfinite(values)
        place = np.zeros(int(known.sum()), dtype=np.int64)
        edges = []
        for shown, drawn, count in ((self.up, self.y, BINS[1]), (self.across, self.x, BINS[0])):
            even = shown.even(drawn[known])
            ends = np.linspace(even.min(), even.max(), count + 1)
            inside = np.clip(np.searchsorted(ends, even, "right") - 1, 0, count - 1)
            place = place * count + inside
            edges.append(shown.uneven(ends))
        table = largest(values[known], place, BINS[0] * BINS[1]).reshape(BINS[1], BINS[0])
        return axes.pcolormesh(edges[1], edges[0], np.ma.masked_invalid(table), **style)


@dataclass(frozen=True)
class StudyPlane(Plane):
    """Tables of one plane, one row a design point.

    Attributes
    ----------
    rows : ndarray (n,) of int
        Places of the design points in the points table.
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
    value: np.ndarray
    point_ids: np.ndarray
    known: np.ndarray
    unstable: np.ndarray
    damping_ratio: np.ndarray
    gridded: bool
    elsewhere: str
    others_vary: bool

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
        even = [q.even(v[known]) for q, v in ((self.across, self.x), (self.up, self.y))]
        place = [(e - e.min()) / (np.ptp(e) or 1.0) for e in even]
        if np.linalg.matrix_rank(np.array([p - p.mean() for p in place]), 1e-6) < 2:
            return None
        return Triangulation(self.x[known], self.y[known], Triangulation(*place).triangles)


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
    others = [n for n in parameter_columns(points, varied=True) if n not in along]
    vary = [name for name in others if name in parameter_columns(plane, varied=True)]
    held = describe(plane.iloc[0], points, [n for n in others if n not in vary], units)
    besides = f"also varied: {', '.join(vary)}" if vary else ""
    at = rows_in(results.points, plane)
    if results.boundary is not None:  # nodes that are not points have another one's id
        at = pd.Index(results.points["point_id"]).get_indexer(pd.Index(plane["point_id"]))
    marks = _marks(results.points, modes)
    count, growth, damping = (values[at] for values in marks)
    across, up = (quantity(name, points[name], units) for name in along)
    return StudyPlane(
        rows=points.index.get_indexer(plane.index),
        across=across,
        up=up,
        x=across.scaled(plane[along[0]]),
        y=up.scaled(plane[along[1]]),
        value=count if measure == "count" else growth,
        point_ids=plane["point_id"].to_numpy(dtype=object),
        known=np.isfinite(count),
        unstable=count > 0,
        damping_ratio=damping,
        gridded=gridded,
        elsewhere=joined(held, why, besides, by=", "),
        others_vary=bool(vary),
    )


def _marks(points: pd.DataFrame, modes: pd.DataFrame) -> tuple[np.ndarray, ...]:
    """Unstable modes, largest growth and least damping of oscillating modes of each point (n,).

    NaN where the point failed, or has no such mode.
    """
    code, n = point_codes(points, modes), len(points)
    unstable, real = (modes[name].to_numpy(bool) for name in ("unstable", "overdamped"))
    growth, zeta = (modes[name].to_numpy(dtype=float) for name in ("growth_rate", "damping_ratio"))
    judged = ~real | unstable
    ok = (points["status"] == "ok").to_numpy(bool)
    count = np.where(ok, np.bincount(code[unstable], minlength=n), np.nan)
    fastest = np.where(ok, largest(growth[judged], code[judged], n), np.nan)
    return count, fastest, -largest(-zeta[~real], code[~real], n)


class Boundary(NamedTuple):
    """Boundary of stability of a plane.

    Attributes
    ----------
    lines : list of ndarray (k, 2)
        In values as drawn, the unstable side on the right.
    crossings, refined : int
        Neighbouring design points on lines along the onsets' parameter between which it passes,
        and how many of these have a refined onset.
    """

    lines: list[np.ndarray]
    crossings: int
    refined: int


def stability_boundary(
    plane: StudyPlane, onsets: pd.DataFrame | None, along: str | None
) -> Boundary:
    """Where it passes between neighbouring design points of the plane.

    On a line along the onsets' parameter that is the refined onset of the mode that turns unstable
    first. From line to line it is straight. Where there is no such onset, the least damping ratio
    is interpolated to zero; where no stable point of the line has damping, the middle is taken.

    Parameters
    ----------
    plane : StudyPlane
    onsets : DataFrame or None
        Table of onsets of the study.
    along : str or None
        Their parameter.
    """
    finder = _Crossings(plane, onsets, along)
    segments: dict[Edge, Edge] = {}
    for polygon in plane.polygons():
        segments |= dict(_segments(polygon, plane.unstable))
    lines = [np.array([finder.place(edge) for edge in chain]) for chain in _chains(segments)]
    return Boundary(lines, len(finder.on_lines), finder.refined)


def _segments(polygon: np.ndarray, unstable: np.ndarray) -> Iterator[tuple[Edge, Edge]]:
    """Each stretch of unstable corners, counterclockwise: the edges by which one comes and goes."""
    state = unstable[polygon]
    n = len(polygon)
    for k in np.flatnonzero(~state & np.roll(state, -1)):
        last = next(i for i in range(k + 1, k + n + 1) if not state[(i + 1) % n])
        inside, beyond = polygon[last % n], polygon[(last + 1) % n]
        yield (
            (int(polygon[k]), int(polygon[(k + 1) % n])),
            (int(beyond), int(inside)),
        )


def _chains(segments: dict[Edge, Edge]) -> Iterator[list[Edge]]:
    """Segments from edge to edge joined to open lines, then to closed ones."""
    ends = set(segments.values())
    starts = [edge for edge in segments if edge not in ends]
    pending = dict(segments)
    while pending:
        edge = starts.pop() if starts else next(iter(pending))
        chain = [edge]
        while edge in pending:
            edge = pending.pop(edge)
            chain.append(edge)
        yield chain


class _Crossings:
    """Where the boundary crosses edges of a plane."""

    def __init__(self, plane: StudyPlane, onsets: pd.DataFrame | None, along: str | None) -> None:
        self._plane = plane
        axes = plane.across, plane.up
        self._xy = np.column_stack([axes[0].even(plane.x), axes[1].even(plane.y)])
        names = [axis.name for axis in axes]
        self._along = names.index(along) if along in names else None
        self._onset: dict[tuple[str, str], float] = {}
        if onsets is not None and self._along is not None:
            self._onset = _refined(onsets, axes[self._along])
        self.on_lines = self._line_crossings()
        self.refined = sum(self._refined_at(edge) is not None for edge in self.on_lines)
        self._distance = self._distances()

    def place(self, edge: Edge) -> tuple[float, float]:
        """Point on an edge (x, y), as drawn."""
        a, b = (self._xy[i] for i in edge)
        x, y = a + self._part(edge) * (b - a)
        return float(self._plane.across.uneven(x)), float(self._plane.up.uneven(y))

    def _refined_at(self, edge: Edge) -> float | None:
        """Coordinate of the refined onset on an edge; nodes that were filled in have none."""
        stable, unstable = (self._plane.point_ids[i] for i in edge)
        value = self._onset.get((stable, unstable))
        ends = sorted(self._xy[list(edge), self._along or 0].tolist())
        return value if value is not None and ends[0] <= value <= ends[1] else None

    def _line_crossings(self) -> list[Edge]:
        """Edges along the onsets' parameter that the boundary crosses."""
        if self._along is None or not self._plane.gridded:
            return []
        other = self._xy[:, 1 - self._along]
        order = np.lexsort((self._xy[:, self._along], other))
        a, b = order[:-1], order[1:]
        state, known = self._plane.unstable, self._plane.known
        crossed = (other[a] == other[b]) & known[a] & known[b] & (state[a] != state[b])
        pairs = zip(a[crossed].tolist(), b[crossed].tolist(), strict=True)
        return [(j, i) if state[i] else (i, j) for i, j in pairs]

    def _distances(self) -> np.ndarray:
        """Distance (n,) of each point to the nearest crossing on its line, negative if unstable."""
        distance = np.full(len(self._xy), np.nan)
        if self._along is None:
            return distance
        own, other = self._xy[:, self._along], self._xy[:, 1 - self._along]
        places = defaultdict(list)
        for edge in self.on_lines:
            a, b = own[list(edge)]
            places[other[edge[0]]].append(a + self._part_on_line(edge) * (b - a))
        order = np.argsort(other, kind="stable")
        for line, found in places.items():
            first, last = (np.searchsorted(other, line, side, order) for side in ("left", "right"))
            here = order[first:last]
            distance[here] = np.abs(own[here][:, None] - np.array(found)).min(axis=1)
        return np.where(self._plane.unstable, -distance, distance)

    def _part(self, edge: Edge) -> float:
        """Place on an edge, from 0 at the stable point to 1."""
        if self._along is None or self._xy[edge[0], self._along] != self._xy[edge[1], self._along]:
            return self._part_on_line(edge)
        stable, unstable = (float(self._distance[i]) for i in edge)
        if np.isfinite(stable - unstable) and stable > unstable:
            return stable / (stable - unstable)
        return self._part_by_damping(edge)

    def _part_on_line(self, edge: Edge) -> float:
        value = None if self._along is None else self._refined_at(edge)
        if value is None:
            return self._part_by_damping(edge)
        a, b = self._xy[list(edge), self._along]
        return float((value - a) / (b - a))

    def _part_by_damping(self, edge: Edge) -> float:
        stable, unstable = (float(self._plane.damping_ratio[i]) for i in edge)
        if not unstable < 0 or not self._highest_damping(edge) > ROUNDING * -unstable:
            return 0.5
        stable = max(stable, 0.0)
        return stable / (stable - unstable)

    def _highest_damping(self, edge: Edge) -> float:
        """Of the stable points on the edge's line; without one there may be none up to a lock-in.

        -inf where none of them has an oscillating mode.
        """
        a, b = edge
        if not self._plane.gridded:
            return float(self._stable_damping.max(initial=-np.inf))
        axis = 0 if self._xy[a, 0] == self._xy[b, 0] else 1
        return float(self._highest[axis][a])

    @cached_property
    def _stable_damping(self) -> np.ndarray:
        """Least damping ratio of each stable point (n,), -inf of others."""
        stable = self._plane.known & ~self._plane.unstable & ~np.isnan(self._plane.damping_ratio)
        return np.where(stable, self._plane.damping_ratio, -np.inf)

    @cached_property
    def _highest(self) -> list[np.ndarray]:
        """The largest of these on the line of each point (n,) on which x is the same, then y."""
        found = []
        for column in self._xy.T:
            values, line = np.unique(column, return_inverse=True)
            found.append(largest(self._stable_damping, line, len(values))[line])
        return found


def _refined(onsets: pd.DataFrame, along: Quantity) -> dict[tuple[str, str], float]:
    """Coordinate of the onset between two points: of the mode that is unstable first."""
    kept = onsets[onsets["status"].isin([REFINED, CUBIC])]
    values = along.even(along.scaled(kept["onset"]))
    ends = zip(kept["point_before"], kept["point_after"], kept["direction"], strict=True)
    found: dict[tuple[str, str], float] = {}
    for (before, after, direction), value in zip(ends, values.tolist(), strict=True):
        pair = (before, after) if direction == INTO else (after, before)
        first = min if direction == INTO else max
        found[pair] = first(found.get(pair, value), value)
    return found
