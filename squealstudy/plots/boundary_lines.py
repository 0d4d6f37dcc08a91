"""The boundary of stability in a plane of two parameters, between design points."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pandas as pd

from squealstudy.plots.plane import StudyPlane
from squealstudy.plots.style import Quantity
from squealstudy.tables.point_rows import largest_by_code
from squealstudy.tables.stability import INTO, REFINED_ONSETS

# damping of a stable point, over the growing mode's, below which it counts as none
DAMPING_ROUND_OFF_RATIO = 1e-9
StabilityEdge = tuple[int, int]  # indices of a stable and an unstable design point of the plane


class Boundary(NamedTuple):
    """Boundary of stability in a plane.

    Attributes
    ----------
    lines : list of ndarray (k, 2)
        Its lines in values as drawn, with the unstable side on the right. They are straight between
        crossings, where nothing was solved.
    solved : ndarray (m, 2)
        Crossings on these lines that are refined onsets.
    crossings : int
        Number of pairs of neighbouring design points, on lines along the onsets' parameter, between
        which the boundary passes.
    refined : int
        Number of these pairs with a refined onset.
    """

    lines: list[np.ndarray]
    solved: np.ndarray
    crossings: int
    refined: int


def stability_boundary(
    plane: StudyPlane, onsets: pd.DataFrame | None, along: str | None
) -> Boundary:
    """The boundary of stability between neighbouring design points of a plane.

    On a line along the onsets' parameter it passes through the refined onset of the mode that turns
    unstable first; from line to line it is straight. Where there is no such onset, the least
    damping ratio is interpolated to zero. Where no stable point of the line has damping, the
    boundary passes through the middle.

    Parameters
    ----------
    plane : StudyPlane
        The plane of two parameters.
    onsets : DataFrame or None
        The study's table of onsets.
    along : str or None
        The parameter of the onsets.
    """
    finder = _Crossings(plane, onsets, along)
    segments: dict[StabilityEdge, StabilityEdge] = {}
    for polygon in plane.polygons():
        segments |= dict(_segments(polygon, plane.unstable))
    chains = list(_chains(segments))
    lines = [np.array([finder.place(edge) for edge in chain]) for chain in chains]
    solved = [finder.place(edge) for chain in chains for edge in chain if finder.is_refined(edge)]
    solved_points = np.array(solved).reshape(-1, 2)
    return Boundary(lines, solved_points, len(finder.on_lines), finder.refined)


def _segments(
    polygon: np.ndarray, unstable: np.ndarray
) -> Iterator[tuple[StabilityEdge, StabilityEdge]]:
    """Edges before and after each stretch of a polygon's unstable corners, counterclockwise."""
    state = unstable[polygon]
    n = len(polygon)
    for k in np.flatnonzero(~state & np.roll(state, -1)):
        last = next(i for i in range(k + 1, k + n + 1) if not state[(i + 1) % n])
        inside, beyond = polygon[last % n], polygon[(last + 1) % n]
        yield (
            (int(polygon[k]), int(polygon[(k + 1) % n])),
            (int(beyond), int(inside)),
        )


def _chains(segments: dict[StabilityEdge, StabilityEdge]) -> Iterator[list[StabilityEdge]]:
    """Join segments from edge to edge: first open lines, then closed ones."""
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
    """Places where the boundary crosses edges of a plane."""

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

    def place(self, edge: StabilityEdge) -> tuple[float, float]:
        """Point on an edge (x, y), as drawn."""
        a, b = (self._xy[i] for i in edge)
        x, y = a + self._part(edge) * (b - a)
        return float(self._plane.across.uneven(x)), float(self._plane.up.uneven(y))

    def is_refined(self, edge: StabilityEdge) -> bool:
        """Whether an edge has a refined onset."""
        return self._along is not None and self._refined_at(edge) is not None

    def _refined_at(self, edge: StabilityEdge) -> float | None:
        """Coordinate of the refined onset on an edge; None if it has none, as unsolved nodes."""
        stable, unstable = (self._plane.point_ids[i] for i in edge)
        onset = self._onset.get((stable, unstable))
        ends = sorted(self._xy[list(edge), self._along or 0].tolist())
        return onset if onset is not None and ends[0] <= onset <= ends[1] else None

    def _line_crossings(self) -> list[StabilityEdge]:
        """Edges along the onsets' parameter that the boundary crosses."""
        if self._along is None or not self._plane.gridded:
            return []
        other = self._xy[:, 1 - self._along]
        order = np.lexsort((self._xy[:, self._along], other))
        a, b = order[:-1], order[1:]
        state, is_solved = self._plane.unstable, self._plane.solved
        crossed = (other[a] == other[b]) & is_solved[a] & is_solved[b] & (state[a] != state[b])
        pairs = zip(a[crossed].tolist(), b[crossed].tolist(), strict=True)
        return [(j, i) if state[i] else (i, j) for i, j in pairs]

    def _distances(self) -> np.ndarray:
        """Distance (n,) of each point to the nearest crossing on its line, negative if unstable."""
        distance = np.full(len(self._xy), np.nan)
        if self._along is None:
            return distance
        along, other = self._xy[:, self._along], self._xy[:, 1 - self._along]
        crossings_by_line = defaultdict(list)
        for edge in self.on_lines:
            a, b = along[list(edge)]
            crossings_by_line[other[edge[0]]].append(a + self._part_on_line(edge) * (b - a))
        order = np.argsort(other, kind="stable")
        for line, crossings in crossings_by_line.items():
            first, last = (np.searchsorted(other, line, side, order) for side in ("left", "right"))
            group_rows = order[first:last]
            distance[group_rows] = np.abs(along[group_rows][:, None] - np.array(crossings)).min(
                axis=1
            )
        return np.where(self._plane.unstable, -distance, distance)

    def _part(self, edge: StabilityEdge) -> float:
        """Position on an edge, from 0 at the stable point to 1 at the unstable one."""
        if self._along is None or self._xy[edge[0], self._along] != self._xy[edge[1], self._along]:
            return self._part_on_line(edge)
        stable, unstable = (float(self._distance[i]) for i in edge)
        if np.isfinite(stable - unstable) and stable > unstable:
            return stable / (stable - unstable)
        return self._part_by_damping(edge)

    def _part_on_line(self, edge: StabilityEdge) -> float:
        onset = None if self._along is None else self._refined_at(edge)
        if onset is None:
            return self._part_by_damping(edge)
        a, b = self._xy[list(edge), self._along]
        return float((onset - a) / (b - a))

    def _part_by_damping(self, edge: StabilityEdge) -> float:
        """Share of an edge at which damping vanishes, by linear interpolation; else the middle."""
        stable, unstable = (float(self._plane.damping_ratio[i]) for i in edge)
        if (
            not unstable < 0
            or not self._highest_damping(edge) > DAMPING_ROUND_OFF_RATIO * -unstable
        ):
            return 0.5
        if stable != stable:  # none of its modes oscillates in the band
            return 0.5
        stable = max(stable, 0.0)
        return stable / (stable - unstable)

    def _highest_damping(self, edge: StabilityEdge) -> float:
        """Highest of the least damping ratios of stable points on the edge's line.

        An undamped model has none before a lock-in. -inf where no point has an oscillating mode.
        """
        a, b = edge
        if not self._plane.gridded:
            return self._most_damped
        axis = 0 if self._xy[a, 0] == self._xy[b, 0] else 1
        return float(self._highest[axis][a])

    @cached_property
    def _stable_damping(self) -> np.ndarray:
        """Least damping ratio of each stable point (n,), -inf of others."""
        stable = self._plane.solved & ~self._plane.unstable & ~np.isnan(self._plane.damping_ratio)
        return np.where(stable, self._plane.damping_ratio, -np.inf)

    @cached_property
    def _most_damped(self) -> float:
        return float(self._stable_damping.max(initial=-np.inf))

    @cached_property
    def _highest(self) -> list[np.ndarray]:
        """Largest of these on each point's line (n,) of constant x, and on that of constant y."""
        largest = []
        for column in self._xy.T:
            values, line = np.unique(column, return_inverse=True)
            largest.append(largest_by_code(self._stable_damping, line, len(values))[line])
        return largest


def _refined(onsets: pd.DataFrame, along: Quantity) -> dict[tuple[str, str], float]:
    """Coordinates of refined onsets between two points each, of the mode that is unstable first."""
    refined = onsets[onsets["status"].isin(REFINED_ONSETS)]
    values = along.even(along.scaled(refined["onset"]))
    ends = zip(refined["point_before"], refined["point_after"], refined["direction"], strict=True)
    onset_between: dict[tuple[str, str], float] = {}
    for (before, after, direction), onset in zip(ends, values.tolist(), strict=True):
        pair = (before, after) if direction == INTO else (after, before)
        first = min if direction == INTO else max
        onset_between[pair] = first(onset_between.get(pair, onset), onset)
    return onset_between
