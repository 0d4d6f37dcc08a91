"""An order of elimination for sparse matrices of symmetric pattern, by nested dissection.

A separator cuts the graph of the matrix in two, which are eliminated before it, each in the same
way (George 1973). Vertices are sorted by their distances from two that lie far apart, or by the
difference of both: its level sets are nearly plane. All parts of one depth are cut at once. Rows
of one pattern, as of a node's displacements, are one vertex.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

LEAF_ROWS = 120  # that are eliminated together without another cut
MIN_BALANCE = 0.1  # least share of a part that a cut may leave on one side, where there is a choice
EVEN_BALANCE = 0.4  # and from which on cuts count as even
UNEVEN_COST = 10.0  # of a cut per balance that is lacking, beside a cost of 1
HUB_FACTOR = 10.0  # neighbours, in square roots of the number of vertices, of one eliminated last
MIN_HUB_NEIGHBOURS = 100
MAX_DEPTH = 100  # of cuts: what is left then is eliminated together


@dataclass(frozen=True)
class Front:
    """Rows that are eliminated together.

    Attributes
    ----------
    start, stop : int
        Their places in the order of elimination.
    boundary : ndarray (b,) of int
        Places of later rows that their columns of the factor reach, ascending.
    children : tuple of int
        Fronts whose boundaries begin in this one.
    """

    start: int
    stop: int
    boundary: np.ndarray
    children: tuple[int, ...]


@dataclass(frozen=True)
class EliminationTree:
    """An order of elimination, and the fronts that it is done by.

    Attributes
    ----------
    order : ndarray (n,) of int
        Rows in the order of elimination.
    fronts : tuple of Front
        Children before parents; their rows are consecutive.
    """

    order: np.ndarray
    fronts: tuple[Front, ...]

    @property
    def factor_entries(self) -> int:
        """Entries of a triangular factor, the square of each front's own rows included."""
        return sum((f.stop - f.start) * (f.stop - f.start + len(f.boundary)) for f in self.fronts)


def elimination_tree(A: sp.csr_matrix) -> EliminationTree:
    """The order of elimination of a sparse A (n, n) of symmetric pattern."""
    vertex = _vertices(A)
    weight = np.bincount(vertex)
    count = len(weight)
    first = np.unique(vertex, return_index=True)[1]
    rows = A[first]
    source = np.repeat(np.arange(count), np.diff(rows.indptr))
    ones = np.ones(len(source), dtype=np.int8)
    graph = sp.csr_matrix((ones, (source, vertex[rows.indices])), shape=(count, count))
    graph.sum_duplicates()
    parts, parents = _Dissection(graph, weight).parts()
    return _tree(graph, weight, vertex, parts, parents)


def _vertices(A: sp.csr_matrix) -> np.ndarray:
    """A number for each row (n,): the same for rows of the same pattern."""
    n = A.shape[0]
    signature = np.random.default_rng(0).integers(2**62, size=n, dtype=np.uint64)
    sums = np.concatenate([[np.uint64(0)], np.cumsum(signature[A.indices], dtype=np.uint64)])
    pattern = sums[A.indptr[1:]] - sums[A.indptr[:-1]]  # modulo 2^64
    empty = np.diff(A.indptr) == 0
    pattern[empty] = signature[empty]
    vertex: np.ndarray = np.unique(pattern, return_inverse=True)[1]
    return vertex


class _Dissection:
    """Cuts a graph (m, m) of weighted vertices, all its parts of one depth at a time."""

    def __init__(self, graph: sp.csr_matrix, weight: np.ndarray) -> None:
        self._weight = weight
        self._parts: list[np.ndarray] = []
        self._parents: list[int] = []
        self._vertices = np.arange(len(weight))  # those that are in no part yet
        self._parent = np.full(len(weight), -1)  # by vertex: the part that cut it off
        source = np.repeat(self._vertices, np.diff(graph.indptr))
        across = source != graph.indices
        self._source, self._target = source[across], graph.indices[across].astype(int)

    def parts(self) -> tuple[list[np.ndarray], list[int]]:
        """Vertices of each part, and the part that has cut it from others; -1 for none."""
        degree = np.bincount(self._source, minlength=len(self._weight))
        hubs = degree > max(MIN_HUB_NEIGHBOURS, HUB_FACTOR * len(self._weight) ** 0.5)
        if hubs.any():
            self._end(hubs, np.zeros(len(hubs), dtype=int))
        for depth in range(MAX_DEPTH + 1):
            if not len(self._vertices):
                break
            links = (np.ones(len(self._source), np.int8), (self._source, self._target))
            m = len(self._vertices)
            label = connected_components(sp.csr_matrix(links, shape=(m, m)), directed=False)[1]
            whole = self._small(label) | (depth == MAX_DEPTH)
            if whole[label].any():
                self._end_small(label, whole)
            if len(self._vertices):
                label = np.unique(label[~whole[label]], return_inverse=True)[1]
                self._end(self._separators(label), label)
        return self._parts, self._parents

    def _small(self, label: np.ndarray) -> np.ndarray:
        """Which of the connected components are not cut."""
        rows = np.bincount(label, self._weight[self._vertices])
        return (rows <= LEAF_ROWS) | (np.bincount(label) == 1)

    def _end_small(self, label: np.ndarray, whole: np.ndarray) -> None:
        """End components that are not cut, small ones of one parent together."""
        rows = np.bincount(label, self._weight[self._vertices])
        parent = np.zeros(len(rows), dtype=int)
        parent[label] = self._parent[self._vertices]
        joined, last, filled = np.arange(len(rows)), -1, 0.0
        for one in np.flatnonzero(whole)[np.argsort(parent[whole], kind="stable")]:
            if last >= 0 and parent[one] == parent[last] and filled + rows[one] <= LEAF_ROWS:
                joined[one], filled = last, filled + rows[one]
            else:
                last, filled = one, rows[one]
        self._end(whole[label], joined[label])

    def _end(self, ending: np.ndarray, label: np.ndarray) -> None:
        """Make parts of vertices (m,), those of one label together; others lie below them."""
        made = np.full(int(label.max(initial=0)) + 1, -1)
        members = np.flatnonzero(ending)
        members = members[np.argsort(label[members], kind="stable")]
        for part in np.split(members, np.flatnonzero(np.diff(label[members])) + 1):
            made[label[part[0]]] = len(self._parts)
            self._parts.append(self._vertices[part])
            self._parents.append(int(self._parent[self._vertices[part[0]]]))
        below = made[label]
        self._parent[self._vertices[below >= 0]] = below[below >= 0]
        stays = ~ending
        number = np.cumsum(stays) - 1
        inside = stays[self._source] & stays[self._target]
        self._source = number[self._source[inside]]
        self._target = number[self._target[inside]]
        self._vertices = self._vertices[stays]

    def _separators(self, label: np.ndarray) -> np.ndarray:
        """Which vertices (m,) cut each of the connected components of a label."""
        m, count = len(label), int(label.max()) + 1
        by_source = np.argsort(self._source, kind="stable")
        target = self._target[by_source]
        starts = np.concatenate([[0], np.cumsum(np.bincount(self._source, minlength=m))])
        rows = self._weight[self._vertices].astype(float)
        least, separator = np.full(count, np.inf), np.ones(m, dtype=bool)
        for key in _keys(starts, target, label, count):
            for side in (1, -1):
                cost, cuts = _best_cuts(side * key, starts, target, label, rows)
                better = cost < least
                separator = np.where(better[label], cuts, separator)
                least = np.where(better, cost, least)
        return separator


def _keys(
    starts: np.ndarray, target: np.ndarray, label: np.ndarray, count: int
) -> Iterator[np.ndarray]:
    """Integers (m,) that sort the vertices of each component from one end to another."""
    anywhere = np.unique(label, return_index=True)[1]
    one = _farthest(_distances(starts, target, anywhere), label, count)
    from_one = _distances(starts, target, one)
    other = _farthest(from_one, label, count)
    from_other = _distances(starts, target, other)
    yield from_one - from_other
    yield from_one
    third = _farthest(np.minimum(from_one, from_other), label, count)
    from_third = _distances(starts, target, third)
    fourth = _farthest(from_third, label, count)
    yield from_third - _distances(starts, target, fourth)
    yield from_third


def _distances(starts: np.ndarray, target: np.ndarray, sources: np.ndarray) -> np.ndarray:
    """Edges (m,) to the nearest of some vertices; all can be reached from one of them."""
    distance = np.full(len(starts) - 1, -1)
    mark = np.empty_like(distance)
    distance[sources], front, step = 0, sources, 0
    while len(front):
        step += 1
        degree = starts[front + 1] - starts[front]
        skipped = starts[front] - np.cumsum(degree) + degree
        near = target[np.repeat(skipped, degree) + np.arange(degree.sum())]
        near = near[distance[near] < 0]
        distance[near] = step
        mark[near] = np.arange(len(near))
        front = near[mark[near] == np.arange(len(near))]  # each once
    return distance


def _farthest(distance: np.ndarray, label: np.ndarray, count: int) -> np.ndarray:
    """A vertex of the largest distance in each component (count,)."""
    order = np.lexsort((distance, label))
    last: np.ndarray = order[np.searchsorted(label[order], np.arange(count), side="right") - 1]
    return last


def _best_cuts(
    key: np.ndarray, starts: np.ndarray, target: np.ndarray, label: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The best separator by a key: cost (count,) by component, vertices (m,).

    Those up to a level whose neighbours lie beyond it; every level of the key is tried.
    """
    count = int(label.max()) + 1
    lowest, highest = np.full(count, np.iinfo(int).max), np.full(count, np.iinfo(int).min)
    np.minimum.at(lowest, label, key)
    np.maximum.at(highest, label, key)
    levels = highest - lowest + 2
    ends = np.cumsum(levels)
    place = (ends - levels - lowest)[label] + key  # in a row of all components' levels
    reach = np.maximum.reduceat(place[target], starts[:-1])
    ahead = reach > place
    change = np.bincount(place[ahead], rows[ahead], ends[-1])
    change -= np.bincount(reach[ahead], rows[ahead], ends[-1])
    cut = np.cumsum(change)  # rows of the separator at each level
    component = np.repeat(np.arange(count), levels)
    total = np.bincount(label, rows)[component]
    before = np.concatenate([[0.0], np.cumsum(np.bincount(label, rows))])[component]
    up_to = np.cumsum(np.bincount(place, rows, ends[-1])) - before
    balance = np.minimum(up_to - cut, total - up_to) / total
    cost = cut * (1.0 + UNEVEN_COST * np.maximum(0.0, EVEN_BALANCE - balance))
    cost = np.where(balance >= MIN_BALANCE, cost, total * (2.0 - balance))
    cost[balance <= 0.0] = np.inf
    order = np.lexsort((cost, component))
    best = order[np.searchsorted(component[order], np.arange(count))]
    level = best[label]
    return cost[best], (place <= level) & (reach > level)


def _tree(
    graph: sp.csr_matrix,
    weight: np.ndarray,
    vertex: np.ndarray,
    parts: list[np.ndarray],
    parents: list[int],
) -> EliminationTree:
    """Parts as fronts in the order of elimination, with what they reach."""
    below: list[list[int]] = [[] for _ in parts]
    waiting: list[int] = []
    for part, parent in enumerate(parents):
        (below[parent] if parent >= 0 else waiting).append(part)
    backwards = []
    while waiting:
        part = waiting.pop()
        backwards.append(part)
        waiting += below[part]
    order = backwards[::-1]
    number = {part: i for i, part in enumerate(order)}
    place = np.empty(len(weight), dtype=int)  # of the vertices
    place[np.concatenate([parts[part] for part in order])] = np.arange(len(weight))
    starts = np.concatenate([[0], np.cumsum(weight[np.argsort(place)])])
    fronts: list[Front] = []
    reached: list[np.ndarray] = []
    stop = 0
    for part in order:
        children = tuple(sorted(number[child] for child in below[part]))
        start, stop = stop, stop + len(parts[part])
        near = [graph.indices[graph.indptr[v] : graph.indptr[v + 1]] for v in parts[part]]
        beyond = np.unique(
            np.concatenate([place[np.concatenate(near)], *(reached[c] for c in children)])
        )
        beyond = beyond[beyond >= stop]
        reached.append(beyond)
        rows = [np.arange(starts[v], starts[v + 1]) for v in beyond]
        boundary = np.concatenate([*rows, np.zeros(0, dtype=int)])
        fronts.append(Front(int(starts[start]), int(starts[stop]), boundary, children))
    return EliminationTree(np.argsort(place[vertex], kind="stable"), tuple(fronts))
