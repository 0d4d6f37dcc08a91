"""Whether stability may change inside a cell of a boundary design."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np

from squealstudy.kinds.complex_modes.counts import damping_ratios, unstable_roots
from squealstudy.root_pairs import partners

Node = tuple[int, ...]
UNKNOWN, FAILED = -1, -2
SAME_MODE = 0.05  # relative: farther apart in frequency, two unstable modes are not the same one
FREQUENCY_WINDOW, DAMPING_WINDOW = 0.05, 0.5  # changes that weigh alike when roots are paired
MIDDLE_OUTSIDE = (-0.125, 0.75, 0.375)  # parabola through places -1, 0 and 1, taken at 1/2


class CellRule:
    """What is known at the nodes, and what it says of a cell.

    A cell is to be halved where

    1. its known nodes differ in the number of unstable modes, or some of them failed and others
       did not (a cell whose nodes all failed would only fail again);
    2. two of its corners have as many, but of other frequencies: other modes;
    3. the damping ratio of a mode, on the parabola through both ends of an edge and the next node
       beyond, has the other sign at the middle of the edge than at both ends.

    Roots are paired between nodes by frequency and damping: a wrong pair costs points at most.

    Parameters
    ----------
    shape : tuple of int
        Of the virtual grid.
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
        """Take in finished nodes: roots [rad/s] as `read_roots` gives them, None if one failed."""
        for node, lam in roots.items():
            if lam is None:
                self._code[node] = FAILED
                continue
            unstable = unstable_roots(lam, self._tolerance)
            self._roots[node] = lam
            self._unstable_hz[node] = np.sort(np.abs(unstable))
            self._code[node] = len(unstable)

    def changes_inside(self, corner: Node, stride: int) -> bool:
        """Whether the cell from `corner` over `stride` nodes is to be halved."""
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
        """(beyond, near, far) for both directions of an edge in which the next node is known."""
        found = []
        for near, far in ((a, b), (b, a)):
            beyond = tuple(2 * n - f for n, f in zip(near, far, strict=True))
            if beyond in self._roots:
                found.append((beyond, near, far))
        return found

    def _dips(self, beyond: Node, near: Node, far: Node) -> bool:
        """Whether a mode's damping is predicted to change sign between near and far, and back."""
        outer, inner = self._paired(near, beyond), self._paired(near, far)
        known = (outer >= 0) & (inner >= 0)
        if not known.any():
            return False
        zeta = [damping_ratios(self._roots[node]) for node in (beyond, near, far)]
        ends = zeta[0][outer[known]], zeta[1][known], zeta[2][inner[known]]
        middle = sum(w * z for w, z in zip(MIDDLE_OUTSIDE, ends, strict=True))
        unstable_before, unstable_after = (z < -self._tolerance for z in ends[1:])
        lost = ~unstable_before & ~unstable_after & (middle < -self._tolerance)
        gained = unstable_before & unstable_after & (middle > self._tolerance)
        return bool((lost | gained).any())

    def _paired(self, a: Node, b: Node) -> np.ndarray:
        """Index among the roots of b of the partner of each root of a, -1 for none."""
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
    """One-to-one pairing of roots (ma,), (mb,) within FREQUENCY_WINDOW."""
    df = np.abs(np.log(np.abs(b)[None, :] / np.abs(a)[:, None])) / FREQUENCY_WINDOW
    dz = np.abs(damping_ratios(b)[None, :] - damping_ratios(a)[:, None]) / DAMPING_WINDOW
    return partners(df + dz, 1.0)
