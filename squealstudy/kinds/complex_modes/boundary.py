"""A stability map whose points go where stability changes: a grid that is refined cell by cell.

The nodes are those of a virtual grid of (num - 1) 2^levels + 1 values a sweep. The coarse grid is
solved first. A cell is halved in every direction where `CellRule` says that stability may change
inside, down to the spacing of the virtual grid. The known nodes of every cell that is left larger,
those that smaller neighbours put on its faces included, agree: the map is complete.

Which cells are halved follows from the finished nodes alone, round by round from the coarse grid:
a killed run finds the same points again.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from squealstudy.kinds.complex_modes.cell_rule import CellRule, Node
from squealstudy.study.definition import Study


@dataclass(frozen=True)
class Cell:
    """A box of the virtual grid, from its lowest node over `stride` nodes in each direction."""

    corner: Node
    stride: int

    def nodes(self, step: int) -> Iterator[Node]:
        """Nodes at every `step` of the stride, the cell's faces included."""
        offsets = range(0, self.stride + 1, step)
        for shift in itertools.product(offsets, repeat=len(self.corner)):
            yield tuple(c + s for c, s in zip(self.corner, shift, strict=True))

    def halves(self) -> list[Cell]:
        """The cells of half the stride."""
        half = self.stride // 2
        shifts = itertools.product((0, half), repeat=len(self.corner))
        return [
            Cell(tuple(c + s for c, s in zip(self.corner, shift, strict=True)), half)
            for shift in shifts
        ]


@dataclass(frozen=True)
class BoundaryGrid:
    """The virtual grid of a boundary design.

    Attributes
    ----------
    names : tuple of str
        Swept parameters.
    axes : tuple of tuple of float
        Values of each; exactly those of a grid study of that resolution.
    levels : int
        How often a cell of the coarse grid may be halved.
    """

    names: tuple[str, ...]
    axes: tuple[tuple[float, ...], ...]
    levels: int

    @classmethod
    def of(cls, study: Study) -> BoundaryGrid:
        """The grid of a study with a boundary design."""
        n = study.definition.design.levels
        return cls(tuple(s.name for s in study.sweeps), tuple(s.halved(n) for s in study.sweeps), n)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each parameter."""
        return tuple(len(axis) for axis in self.axes)

    @property
    def stride(self) -> int:
        """Nodes of the virtual grid in one step of the coarse grid."""
        return int(2**self.levels)

    def values(self, node: Node) -> dict[str, float]:
        """Swept values at a node."""
        return {n: a[i] for n, a, i in zip(self.names, self.axes, node, strict=True)}

    def node(self, values: Mapping[str, float]) -> Node:
        """The node of these swept values; ValueError where there is none."""
        return tuple(axis.index(values[n]) for n, axis in zip(self.names, self.axes, strict=True))

    def coarse_nodes(self) -> list[Node]:
        """Nodes of the coarse grid, the first parameter varying fastest."""
        return _ordered(itertools.product(*(range(0, n, self.stride) for n in self.shape)))

    def coarse_cells(self) -> list[Cell]:
        """Cells of the coarse grid."""
        corners = itertools.product(*(range(0, n - 1, self.stride) for n in self.shape))
        return [Cell(tuple(corner), self.stride) for corner in corners]


@dataclass(frozen=True)
class Refinement:
    """How far a boundary design has come.

    Attributes
    ----------
    nodes : list of tuple of int
        All nodes asked for so far: the coarse grid, then each round's, first index fastest.
    rounds : int
        Refinements among them.
    """

    nodes: list[Node]
    rounds: int


def refine(
    grid: BoundaryGrid, roots: Mapping[Node, np.ndarray | None], tolerance: float
) -> Refinement:
    """The nodes that follow from what is known.

    Parameters
    ----------
    roots : mapping of node -> ndarray (m,) complex or None
        Roots [rad/s] of the finished nodes as `read_roots` gives them, None where one failed.
        Nodes that the refinement has not asked for are not looked at.
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    """
    nodes, cells, rounds = grid.coarse_nodes(), grid.coarse_cells(), 0
    rule = CellRule(grid.shape, tolerance)
    fresh = nodes
    while all(node in roots for node in fresh):
        rule.add({node: roots[node] for node in fresh})
        split = [c for c in cells if c.stride > 1 and rule.changes_inside(c.corner, c.stride)]
        if not split:
            break
        known, chosen = set(nodes), set(split)
        cells = [c for c in cells if c not in chosen] + [h for c in split for h in c.halves()]
        new = {node for c in split for node in c.nodes(c.stride // 2)} - known
        fresh = _ordered(new)
        nodes = nodes + fresh
        rounds += 1
    return Refinement(nodes, rounds)


def _ordered(nodes: object) -> list[Node]:
    return sorted(nodes, key=lambda node: node[::-1])  # type: ignore[call-overload]
