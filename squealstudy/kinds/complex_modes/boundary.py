"""A stability map whose points go where stability changes: a grid that is refined cell by cell.

The nodes are those of a virtual grid with (num - 1) 2^levels + 1 values for each sweep. The coarse
grid is solved first. A cell is halved in every direction, down to the spacing of the virtual grid,
where `CellRule` says that stability may change inside, or `PassingModes` that two modes pass each
other there and may lock in. All solved nodes of a cell that stays larger agree, those included that
smaller neighbours put on its faces. A change inside such a cell that neither damping nor the order
of modes at its corners shows is not on the map.

Which cells are halved follows from the finished nodes alone, round by round from the coarse grid:
a killed run finds the same points again.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.engine.plan import Plan
from squealstudy.engine.store import Store
from squealstudy.kinds.complex_modes.node_modes import FinishedNodes
from squealstudy.kinds.complex_modes.passing_modes import Node, PassingModes
from squealstudy.kinds.complex_modes.rows import read_roots
from squealstudy.modes.judged_roots import damping_ratios, unstable_roots
from squealstudy.root_pairs import partners
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.sampling import count_points


@dataclass(frozen=True)
class GridCell:
    """A box of the virtual grid, from its lowest node `corner`, with sides of `stride` steps."""

    corner: Node
    stride: int

    def nodes(self, step: int) -> Iterator[Node]:
        """Yield every `step`-th node in each direction, those on the cell's faces included."""
        offsets = range(0, self.stride + 1, step)
        for shift in itertools.product(offsets, repeat=len(self.corner)):
            yield tuple(c + s for c, s in zip(self.corner, shift, strict=True))

    def halves(self) -> list[GridCell]:
        """The 2^d cells of half the stride that fill this one."""
        half = self.stride // 2
        shifts = itertools.product((0, half), repeat=len(self.corner))
        return [
            GridCell(tuple(c + s for c, s in zip(self.corner, shift, strict=True)), half)
            for shift in shifts
        ]


@dataclass(frozen=True)
class BoundaryGrid:
    """The finest grid that a boundary design may reach, of which it solves some nodes.

    Attributes
    ----------
    names : tuple of str
        Names of the swept parameters.
    axes : tuple of tuple of float
        Values of each parameter, exactly those of a grid study of that resolution.
    levels : int
        How often a cell of the coarse grid may be halved.
    """

    names: tuple[str, ...]
    axes: tuple[tuple[float, ...], ...]
    levels: int

    @classmethod
    def of(cls, study: ResolvedStudy) -> BoundaryGrid:
        """The grid of a study with a boundary design."""
        n = study.definition.design.levels
        return cls(tuple(s.name for s in study.sweeps), tuple(s.halved(n) for s in study.sweeps), n)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each parameter."""
        return tuple(len(axis) for axis in self.axes)

    @property
    def stride(self) -> int:
        """Number of the virtual grid's steps in one step of the coarse grid."""
        return int(2**self.levels)

    def values(self, nodes: Sequence[Node]) -> np.ndarray:
        """Swept values (n, d) at some nodes."""
        coordinates = np.array(nodes).T
        return np.column_stack(
            [np.array(a)[i] for a, i in zip(self.axes, coordinates, strict=True)]
        )

    def node(self, values: Sequence[float]) -> Node:
        """The node with these swept values (d,); ValueError where there is none."""
        return tuple(axis.index(v) for axis, v in zip(self.axes, values, strict=True))

    def coarse_nodes(self) -> list[Node]:
        """Nodes of the coarse grid, the first parameter varying fastest."""
        return _ordered(itertools.product(*(range(0, n, self.stride) for n in self.shape)))

    def coarse_cells(self) -> list[GridCell]:
        """Cells of the coarse grid."""
        corners = itertools.product(*(range(0, n - 1, self.stride) for n in self.shape))
        return [GridCell(tuple(corner), self.stride) for corner in corners]


def refine(
    grid: BoundaryGrid,
    roots: Mapping[Node, np.ndarray | None],
    tolerance: float,
    passing: PassingModes | None = None,
) -> list[Node]:
    """The nodes to solve that follow from finished ones: the coarse grid, then each round's.

    Parameters
    ----------
    roots : mapping of node -> ndarray (m,) complex or None
        Roots [rad/s] of the finished nodes, as `read_roots` gives them; None for a failed node.
        Nodes that the refinement has not asked for are ignored.
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    passing : PassingModes or None
        Tells where modes pass each other; None: shapes of the nodes' modes are not known.
    """
    nodes, cells = grid.coarse_nodes(), grid.coarse_cells()
    rule = CellRule(grid.shape, tolerance)
    fresh = nodes
    while all(node in roots for node in fresh):
        rule.add({node: roots[node] for node in fresh})
        split = [c for c in cells if c.stride > 1 and _changes(c, rule, passing)]
        if not split:
            break
        existing, chosen = set(nodes), set(split)
        cells = [c for c in cells if c not in chosen] + [h for c in split for h in c.halves()]
        new = {node for c in split for node in c.nodes(c.stride // 2)} - existing
        fresh = _ordered(new)
        nodes = nodes + fresh
    return nodes


def _changes(cell: GridCell, rule: CellRule, passing: PassingModes | None) -> bool:
    if rule.changes_inside(cell.corner, cell.stride):
        return True
    return passing is not None and passing.inside(_edges(cell.corner, cell.stride))


def _ordered(nodes: object) -> list[Node]:
    return sorted(nodes, key=lambda node: node[::-1])  # type: ignore[call-overload]


UNKNOWN, FAILED = -1, -2
SAME_MODE = 0.05  # largest difference in log frequency at which two unstable modes are the same one
# changes of log frequency and of damping ratio that weigh alike when roots are paired
FREQUENCY_WINDOW, DAMPING_WINDOW = 0.05, 0.5
MIDDLE_OUTSIDE = (-0.125, 0.75, 0.375)  # weights of the values at -1, 0 and 1 in a parabola at 1/2


class CellRule:
    """Results at the nodes, and the rule by which they decide whether a cell is halved.

    A cell is to be halved where

    1. its solved nodes differ in the number of unstable modes, or some of them failed and others
       did not (a cell whose nodes all failed would only fail again);
    2. both ends of an edge have as many unstable modes, but with other frequencies: other modes;
    3. the damping ratio of a mode has another sign at the middle of an edge than at both its ends,
       on the parabola through these ends and the next node beyond.

    Roots of nodes are paired by frequency and damping; a wrong pair at most adds points.

    Parameters
    ----------
    shape : tuple of int
        Number of the virtual grid's nodes in each direction.
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    """

    def __init__(self, shape: tuple[int, ...], tolerance: float) -> None:
        self._tolerance = tolerance
        self._code = np.full(shape, UNKNOWN)  # number of unstable modes, FAILED or UNKNOWN
        self._roots: dict[Node, np.ndarray] = {}
        self._unstable_hz: dict[Node, np.ndarray] = {}
        self._partners: dict[tuple[Node, Node], np.ndarray] = {}

    def add(self, roots: Mapping[Node, np.ndarray | None]) -> None:
        """Add finished nodes: roots [rad/s] as `read_roots` gives them, None for a failed node."""
        for node, lam in roots.items():
            if lam is None:
                self._code[node] = FAILED
                continue
            unstable = unstable_roots(lam, self._tolerance)
            self._roots[node] = lam
            self._unstable_hz[node] = np.sort(np.abs(unstable))
            self._code[node] = len(unstable)

    def changes_inside(self, corner: Node, stride: int) -> bool:
        """Whether the cell from `corner`, `stride` steps wide, is to be halved."""
        box = self._code[tuple(slice(c, c + stride + 1) for c in corner)]
        codes = np.unique(box[box != UNKNOWN])
        if len(codes) > 1:
            return True
        if codes[0] == FAILED:
            return False
        edges = list(_edges(corner, stride))
        return any(self._other_modes(a, b) for a, b in edges) or any(
            self._dips(*line) for edge in edges for line in self._lines(*edge)
        )

    def _other_modes(self, a: Node, b: Node) -> bool:
        f, g = self._unstable_hz[a], self._unstable_hz[b]
        return bool((np.abs(np.log(f / g)) > SAME_MODE).any())

    def _lines(self, a: Node, b: Node) -> list[tuple[Node, Node, Node]]:
        """(beyond, near, far) for each direction of an edge in which the next node is solved."""
        node_lines = []
        for start, end in ((a, b), (b, a)):
            beyond = tuple(2 * n - f for n, f in zip(start, end, strict=True))
            if beyond in self._roots:
                node_lines.append((beyond, start, end))
        return node_lines

    def _dips(self, beyond: Node, near: Node, far: Node) -> bool:
        """Whether a mode's damping is predicted to change sign, and back, between near and far."""
        outer, inner = self._paired(near, beyond), self._paired(near, far)
        is_paired = (outer >= 0) & (inner >= 0)
        if not is_paired.any():
            return False
        zeta = [damping_ratios(self._roots[node]) for node in (beyond, near, far)]
        ends = zeta[0][outer[is_paired]], zeta[1][is_paired], zeta[2][inner[is_paired]]
        middle = sum(w * z for w, z in zip(MIDDLE_OUTSIDE, ends, strict=True))
        unstable_before, unstable_after = (z < -self._tolerance for z in ends[1:])
        dips_below = ~unstable_before & ~unstable_after & (middle < -self._tolerance)
        rises_above = unstable_before & unstable_after & (middle > self._tolerance)
        return bool((dips_below | rises_above).any())

    def _paired(self, a: Node, b: Node) -> np.ndarray:
        """Index, for each root of node a, of its partner among those of node b; -1 for none."""
        if (a, b) not in self._partners:
            self._partners[a, b] = _partners(self._roots[a], self._roots[b])
        return self._partners[a, b]


def _edges(corner: Node, stride: int) -> list[tuple[Node, Node]]:
    """Pairs of corners that share an edge of the cell."""
    d = len(corner)
    edges = []
    for axis in range(d):
        for sides in itertools.product((0, stride), repeat=d - 1):
            shift = [*sides[:axis], 0, *sides[axis:]]
            a = tuple(c + s for c, s in zip(corner, shift, strict=True))
            edges.append((a, (*a[:axis], a[axis] + stride, *a[axis + 1 :])))
    return edges


def _partners(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Pair roots (ma,) and (mb,) one to one, by changes of frequency and damping."""
    df = np.abs(np.log(np.abs(b)[None, :] / np.abs(a)[:, None])) / FREQUENCY_WINDOW
    dz = np.abs(damping_ratios(b)[None, :] - damping_ratios(a)[:, None]) / DAMPING_WINDOW
    return partners(df + dz, 1.0)


def extended_plan(plan: Plan, store: Store) -> Plan:
    """The plan with the nodes at which the boundary is to be refined next.

    The plan itself where some of its points are not finished, or no more are needed. The nodes
    depend only on the results of the plan's points.
    """
    while True:
        grid = BoundaryGrid.of(plan.study)
        ids = plan.tasks.ids.astype(str).tolist()
        tolerance, largest = plan.method.tolerance, plan.method.largest_error
        finished = read_roots(store, ids, tolerance=tolerance, largest_error=largest)
        if len(finished) < len(plan.tasks):
            break
        grid_nodes = [grid.node(values) for values in plan.swept.tolist()]
        roots = {node: finished[name] for node, name in zip(grid_nodes, ids, strict=True)}
        tolerance = plan.study.definition.modes.stability_tolerance
        modes = FinishedNodes(plan, store, grid_nodes)
        try:
            nodes = refine(grid, roots, tolerance, PassingModes(modes, tolerance))
        finally:
            modes.close()
        if len(nodes) == len(plan.tasks):
            break
        plan = Plan(plan.study, grid.values(nodes), plan.enriched)
    return plan


def most_points(study: ResolvedStudy) -> int:
    """Largest number of design points that a study may have in the end."""
    if not study.grows:
        return count_points(study)
    return math.prod(BoundaryGrid.of(study).shape)


def map_facts(plan: Plan) -> dict[str, Any]:
    """Facts for the manifest: a boundary design's virtual grid, and how much of it was solved."""
    grid = BoundaryGrid.of(plan.study)
    nodes = math.prod(grid.shape)
    return {
        "axes": dict(zip(grid.names, map(list, grid.axes), strict=True)),
        "levels": grid.levels,
        "points_solved": len(plan.tasks),
        "full_grid_points": nodes,
        "fraction": len(plan.tasks) / nodes,
    }
