"""Modes that pass each other between two nodes of a map, and may lock in unseen between them.

Where two frequencies cross, a coupling that is not symmetric, as friction makes it, locks the two
modes in. The weaker the coupling, the narrower is the range in which they are locked. Damping at
the nodes on both sides does not show it, but the order of the frequencies has changed, as shapes
tell. For two modes with roots lam and unit shapes x

    growth <= largest eigenvalue of [[-d1, h], [h, -d2]],  d = -Re lam,
    h = |lam1 - lam2| c / (2 sqrt(1 - c^2)),  c = |x1^H x2|,

the numerical abscissa of the matrix that has these roots and shapes (Trefethen & Embree 2005). In
coordinates in which modes without friction are orthogonal, h is the part of their coupling that is
not conservative. It hardly changes on the way to the crossing.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from squealstudy.modes.tracking.pairing import mac
from squealstudy.root_pairs import least_assignment

Node = tuple[int, ...]
# factor by which the coupling at the crossing may exceed that at both nodes; with 1.0 no node of 90
# random maps was wrong either, and 7 % fewer points were solved
COUPLING_CHANGE = 1.3
SHAPE_REL_ROUND_OFF = 1e-6  # relative round-off of c: shapes are stored in single precision
# least difference of MAC sums by which shapes tell the order of two modes; below it the modes may
# have passed each other
MIN_ORDER_CERTAINTY = 0.3
MAX_NODES_IN_MEMORY = 4096  # nodes whose modes are held


class NodeModes(NamedTuple):
    """Oscillating modes of a node.

    Attributes
    ----------
    lam : ndarray (m,) complex
        Roots, rad/s.
    shapes : ndarray (m, k) complex
        Shapes of any scale, in coordinates in which modes without friction and damping are
        orthogonal.
    seen : ndarray (m, s) complex
        The same shapes in coordinates that all nodes share, to compare them between nodes.
    """

    lam: np.ndarray
    shapes: np.ndarray
    seen: np.ndarray


class PassingModes:
    """Tells whether modes may lock in inside a cell though no corner shows it.

    Parameters
    ----------
    modes_of : callable
        Returns the NodeModes of a solved node; None where it failed or is inaccurate.
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    """

    def __init__(self, modes_of: Callable[[Node], NodeModes | None], tolerance: float) -> None:
        self._modes = lru_cache(maxsize=MAX_NODES_IN_MEMORY)(modes_of)
        self._coupling = lru_cache(maxsize=MAX_NODES_IN_MEMORY)(self._couplings_at)
        self._tolerance = tolerance
        self._edges: dict[tuple[Node, Node], bool] = {}

    def inside(self, edges: list[tuple[Node, Node]]) -> bool:
        """Whether two modes that may lock in pass each other on one of a cell's edges."""
        return any(self._on(a, b) for a, b in edges)

    def _on(self, a: Node, b: Node) -> bool:
        if (a, b) not in self._edges:
            self._edges[a, b] = self._may_lock_in(a, b)
        return self._edges[a, b]

    def _couplings_at(self, node: Node) -> np.ndarray:
        """Non-conservative coupling h (m, m) between all modes of a node, rad/s."""
        modes = self._modes(node)
        assert modes is not None
        c2 = mac(modes.shapes, modes.shapes).astype(float)
        c = np.maximum(np.sqrt(c2) - SHAPE_REL_ROUND_OFF, 0.0)
        distances = np.abs(modes.lam[:, None] - modes.lam)
        h: np.ndarray = distances * c / (2.0 * np.sqrt(np.maximum(1.0 - c2, SHAPE_REL_ROUND_OFF)))
        return h

    def _may_lock_in(self, a: Node, b: Node) -> bool:
        """Whether two modes may pass each other between two nodes and lock in between."""
        at_a, at_b = self._modes(a), self._modes(b)
        if at_a is None or at_b is None or min(len(at_a.lam), len(at_b.lam)) < 2:
            return False
        h_a, h_b = self._coupling(a), self._coupling(b)
        decay_a, decay_b = (
            self._tolerance * np.abs(modes.lam) - modes.lam.real for modes in (at_a, at_b)
        )
        if not (_may_change(h_a, decay_a).any() or _may_change(h_b, decay_b).any()):
            return False
        likeness = mac(at_a.seen, at_b.seen)
        rows, columns = least_assignment(-likeness)
        like = likeness[np.ix_(rows, columns)]
        diagonal = np.diagonal(like)
        sure = diagonal[:, None] + diagonal - like - like.T > MIN_ORDER_CERTAINTY
        size_a, size_b = np.abs(at_a.lam)[rows], np.abs(at_b.lam)[columns]
        passed = (size_a[:, None] - size_a) * (size_b[:, None] - size_b) < 0
        h = np.maximum(h_a[np.ix_(rows, rows)], h_b[np.ix_(columns, columns)])
        lesser_decay = np.minimum(np.abs(decay_a[rows]), np.abs(decay_b[columns]))
        decay = np.where(
            decay_a[rows] * decay_b[columns] > 0, lesser_decay * np.sign(decay_a[rows]), 0.0
        )
        locked = _locked(at_a.lam[rows]) | _locked(at_b.lam[columns])
        may_lock_in = (passed | ~sure) & ~locked & _may_change(h, decay)
        return bool(may_lock_in.any())


def _locked(lam: np.ndarray) -> np.ndarray:
    """Pairs (m, m) of a growing and a decaying mode that are nearer in frequency than in growth.

    They are locked in already: the number of unstable modes shows where that ends.
    """
    differences = lam[:, None] - lam
    opposite = lam.real[:, None] * lam.real < 0
    locked: np.ndarray = opposite & (np.abs(differences.imag) < np.abs(differences.real))
    return locked


def _may_change(h: np.ndarray, decay: np.ndarray) -> np.ndarray:
    """Whether pairs (m, m) of modes may change their stability.

    `h` (m, m) is the coupling of each pair and `decay` (m,) the decay rate of each mode, both in
    rad/s. Two modes that both decay, or both grow, may where h^2 exceeds the product of these
    rates. A growing and a decaying mode may where h exceeds half the difference of the rates.
    """
    product = decay[:, None] * decay
    may_change: np.ndarray = (COUPLING_CHANGE * h) ** 2 > np.maximum(product, 0.0)
    opposite = product < 0
    may_change[opposite] = (COUPLING_CHANGE * h > np.abs(decay[:, None] - decay) / 2)[opposite]
    np.fill_diagonal(may_change, False)
    return may_change
