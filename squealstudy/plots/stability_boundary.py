"""The line between design points at which no mode is unstable and those at which any is."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pandas as pd

from squealstudy.plots.plane import StudyPlane
from squealstudy.tables.mode_ranking import CUBIC, REFINED
from squealstudy.tables.stability import INTO

ROUNDING = 1e-9  # of the growing mode's damping ratio: below it a stable point has no damping
Edge = tuple[int, int]  # of the plane's design points: first the stable, then the unstable one


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
        axes = (plane.across, plane.up)
        self._log = [axis.log for axis in axes]
        self._xy = np.column_stack([self._scaled(k, v) for k, v in enumerate((plane.x, plane.y))])
        names = [axis.name for axis in axes]
        self._along = names.index(along) if along in names else None
        self._onset: dict[tuple[str, str], float] = {}
        if onsets is not None and self._along is not None:
            self._onset = self._refined(onsets, axes[self._along].factor)
        self.on_lines = self._line_crossings()
        self.refined = sum(self._refined_at(edge) is not None for edge in self.on_lines)
        self._distance = self._distances()

    def place(self, edge: Edge) -> tuple[float, float]:
        """Point on an edge (x, y), as drawn."""
        a, b = (self._xy[i] for i in edge)
        point = a + self._part(edge) * (b - a)
        return tuple(  # type: ignore[return-value]
            float(np.exp(v) if log else v) for v, log in zip(point, self._log, strict=True)
        )

    def _scaled(self, axis: int, drawn: np.ndarray) -> np.ndarray:
        """Drawn values as the axis spaces them."""
        scaled: np.ndarray = np.log(drawn) if self._log[axis] else np.asarray(drawn, dtype=float)
        return scaled

    def _refined(self, onsets: pd.DataFrame, factor: float) -> dict[tuple[str, str], float]:
        """Coordinate of the onset between two points: of the mode that is unstable first."""
        kept = onsets[onsets["status"].isin([REFINED, CUBIC])]
        values = self._scaled(self._along or 0, kept["onset"].to_numpy(float) * factor)
        ends = zip(kept["point_before"], kept["point_after"], kept["direction"], strict=True)
        found: dict[tuple[str, str], float] = {}
        for (before, after, direction), value in zip(ends, values.tolist(), strict=True):
            pair = (before, after) if direction == INTO else (after, before)
            first = min if direction == INTO else max
            found[pair] = first(found.get(pair, value), value)
        return found

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
        for line, found in places.items():
            here = np.flatnonzero(other == line)
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
        plane, (a, b) = self._plane, edge
        here = plane.known & ~plane.unstable
        if plane.gridded:
            shared = self._xy[a] == self._xy[b]
            here &= (self._xy[:, shared] == self._xy[a, shared]).all(axis=1)
        return float(np.nan_to_num(plane.damping_ratio[here], nan=-np.inf).max(initial=-np.inf))
