"""Labels of modes along a tree of design points, from pairings of neighbours."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from squealstudy.modes.tracking.pairing import (
    DOUBTFUL,
    LOST,
    PAIR_FREQUENCY,
    Pairing,
    broken,
    pair_modes,
)
from squealstudy.modes.tracking.tree import levels

STRAIGHT = 0.999  # cosine above which two steps lie on one line
EXTRAPOLATED = 0.5  # share of the last change that is expected to go on: all of it overshoots where
# frequencies come together and lock in, none of it lags where they cross
LONGEST_STEP = 3.0  # extrapolated at most, in steps of the parent

Value = TypeVar("Value")
Indexed = Sequence[Value] | Mapping[int, Value] | np.ndarray
ENOUGH = 20  # neighbours that are asked about two tracks
Pair = tuple[int, int]


@dataclass(frozen=True)
class Tracks:
    """Labels of all modes of all points; one array a point, one entry a mode.

    Attributes
    ----------
    labels : list of ndarray of int
        Track numbers from 1, by frequency at the root; modes that turn up later are numbered on.
    macs : list of ndarray
        MAC with the same track's mode in the parent point, NaN where the track begins.
    ambiguous : list of ndarray of bool
        The pairing with the parent point is in doubt; or the track ends here, or begins, and may
        go on under another number at the next point (`broken`).
    """

    labels: list[np.ndarray]
    macs: list[np.ndarray]
    ambiguous: list[np.ndarray]


class TrackTree:
    """Which design points are compared, and in which order.

    Children of a point without modes attach to its nearest ancestor with modes; where there is
    none, to the first of them.

    Parameters
    ----------
    parents : sequence of int (n,)
        Parent of each point, -1 for a root.
    lams : sequence of ndarray (m,)
        Roots of each point [rad/s], empty for a failed one.
    coordinates : ndarray (n, p) or None
        Design points; with them roots are extrapolated along straight lines of the tree.

    Raises
    ------
    ValueError
        Where `parents` is no tree over the points.
    """

    def __init__(
        self,
        parents: Sequence[int],
        lams: Sequence[np.ndarray],
        coordinates: np.ndarray | None = None,
    ) -> None:
        if len(lams) != len(parents):
            raise ValueError(f"{len(parents)} parents, {len(lams)} sets of roots")
        self.lams = lams
        self.parents, self.levels = levels(parents, [len(lam) for lam in lams])
        self.step = np.zeros(len(parents))
        if coordinates is not None and len(parents):
            x = _normalised(np.asarray(coordinates, dtype=float))
            self.step = _steps(x, np.asarray(self.parents))

    @cached_property
    def children(self) -> list[int]:
        """Points that have a parent to be compared with, by depth."""
        return [i for level in self.levels for i in level if self.parents[i] >= 0]

    @cached_property
    def groups(self) -> list[list[int]]:
        """The children in lists that do not depend on each other, each in order.

        A pairing extrapolates from the pairing of its parent on straight lines only: they are
        the groups.
        """
        found: dict[int, list[int]] = {}
        first: dict[int, int] = {}
        for i in self.children:
            p = self.parents[i]
            first[i] = first[p] if self.step[i] and p in first else i
            found.setdefault(first[i], []).append(i)
        return list(found.values())

    def label(
        self, pairings: Mapping[int, Pairing], band: tuple[float, float] | None = None
    ) -> Tracks:
        """Labels of all points: a child inherits those of its parent. They depend on the tree.

        `band` is that of the roots, rad/s, at whose edges modes come and go (`broken`).
        """
        labels = [np.full(len(lam), -1) for lam in self.lams]
        macs = [np.full(len(lam), np.nan) for lam in self.lams]
        ambiguous = [np.zeros(len(lam), dtype=bool) for lam in self.lams]
        used = 0
        for level in self.levels:
            for i in level:
                p = self.parents[i]
                if p < 0:
                    continue
                pairs = pairings[i]
                a = np.flatnonzero(pairs.partner >= 0)
                b = pairs.partner[a]
                labels[i][b] = labels[p][a]
                macs[i][b] = pairs.mac[a]
                ambiguous[i][b] |= pairs.ambiguous[a]
                ended, began = broken(self.lams[p], self.lams[i], pairs.partner, band)
                ambiguous[p] |= ended
                ambiguous[i] |= began
            used += _number_newcomers(level, self.lams, labels, used)
        return Tracks(labels, macs, ambiguous)


def pair_points(
    order: Sequence[int],
    parents: Indexed[int],
    step: Indexed[float],
    lams: Indexed[np.ndarray],
    shapes: Callable[[int, int], tuple[np.ndarray, np.ndarray]],
    known: Mapping[int, Pairing],
) -> dict[int, Pairing]:
    """Pairings of points with their parents.

    Parameters
    ----------
    order : sequence of int
        Points, each after its parent where that one decides what is expected: a group of a
        TrackTree, or all its children.
    parents, step, lams : indexed by point
        As of TrackTree.
    shapes : callable
        Shapes (ma, k) and (mb, k) of two points in common coordinates.
    known : mapping of point -> Pairing
        What is not to be paired again.
    """
    found: dict[int, Pairing] = {}
    for i in order:
        p = parents[i]
        if i in known:
            found[i] = known[i]
            continue
        before = found.get(p) if step[i] else None
        lam_g = lams[parents[p]] if before is not None else None
        expected = expected_roots(lams[p], step[i], lam_g, before)
        at_p, at_i = shapes(p, i)
        found[i] = pair_modes(lams[p], at_p, lams[i], at_i, expected)
    return found


def expected_roots(
    lam: np.ndarray, step: float, earlier: np.ndarray | None, before: Pairing | None
) -> np.ndarray | None:
    """Where roots are expected at the next point of a line, (m,); None: where they are.

    Parameters
    ----------
    lam : ndarray (m,)
        Roots at a point.
    step : float
        Share of the last change that is expected to go on.
    earlier, before : ndarray (mg,) and Pairing, or None
        Roots at the point before, and its pairing with this one.
    """
    if earlier is None or before is None:
        return None
    a = np.flatnonzero(before.partner >= 0)
    b = before.partner[a]
    expected = lam.astype(complex)
    expected[b] += step * (lam[b] - earlier[a])
    return expected


def _normalised(x: np.ndarray) -> np.ndarray:
    span = np.ptp(x, axis=0)
    scaled: np.ndarray = x / np.where(span > 0, span, 1.0)
    return scaled


def _steps(x: np.ndarray, parents: np.ndarray) -> np.ndarray:
    """How much of the last change is expected to go on to each point; none off a line (n,)."""
    known = np.flatnonzero(parents >= 0)
    known = known[parents[parents[known]] >= 0]
    p, g = parents[known], parents[parents[known]]
    u, v = x[p] - x[g], x[known] - x[p]
    size_u, size_v = np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)
    straight = np.einsum("ij,ij->i", u, v) > STRAIGHT * size_u * size_v
    ratio = size_v / np.where(size_u > 0, size_u, 1.0)
    step = np.zeros(len(parents))
    step[known] = np.where(straight, EXTRAPOLATED * np.minimum(ratio, LONGEST_STEP), 0.0)
    return step


def _number_newcomers(
    level: Sequence[int], lams: Sequence[np.ndarray], labels: Sequence[np.ndarray], used: int
) -> int:
    """Number what has no label yet, oscillating modes first, by frequency. Returns how many."""
    new = [(i, j) for i in level for j in np.flatnonzero(labels[i] < 0)]
    new.sort(key=lambda ij: (lams[ij[0]][ij[1]].imag == 0, abs(lams[ij[0]][ij[1]]), ij))
    for number, (i, j) in enumerate(new, start=used + 1):
        labels[i][j] = number
    return len(new)


def join_tracks(
    tracks: Tracks,
    lams: Sequence[np.ndarray],
    edges: Iterable[Pair],
    shapes: Callable[[int, int], tuple[np.ndarray, np.ndarray]],
) -> Tracks:
    """Give one number to tracks that neighbouring points show to be of one mode.

    A mode that comes into the band on several lines of a grid gets a number on each of them. Two
    tracks are joined where neighbours of different branches pair them without doubt, and where no
    point has both; those that most neighbours pair come first.

    Parameters
    ----------
    tracks : Tracks
    lams : sequence of ndarray (m,)
        Roots of each point, rad/s.
    edges : iterable of (int, int)
        Neighbouring points that the tree does not connect.
    shapes : callable
        Shapes (ma, k) and (mb, k) of two points in common coordinates.
    """
    votes: Counter[Pair] = Counter()
    asked: Counter[Pair] = Counter()
    for a, b in edges:
        near = _may_join(lams[a], tracks.labels[a], lams[b], tracks.labels[b])
        if any(asked[pair] < ENOUGH for pair in near):
            asked.update(near)
            votes.update(_votes(a, b, tracks, lams, shapes))
    if not votes:
        return tracks
    number = _joined(votes, tracks.labels)
    return replace(tracks, labels=[number[labels] for labels in tracks.labels])


def _may_join(
    lam_a: np.ndarray, labels_a: np.ndarray, lam_b: np.ndarray, labels_b: np.ndarray
) -> list[Pair]:
    """Tracks that one of two points lacks, with those that the other lacks, near in frequency."""
    if np.array_equal(np.sort(labels_a), np.sort(labels_b)):
        return []
    a = np.flatnonzero(~np.isin(labels_a, labels_b))
    b = np.flatnonzero(~np.isin(labels_b, labels_a))
    ratio = np.abs(lam_a[a])[:, None] / np.abs(lam_b[b])
    i, j = np.nonzero(np.abs(np.log(ratio)) < LOST * PAIR_FREQUENCY)
    return _ordered(labels_a[a[i]], labels_b[b[j]])


def _ordered(one: np.ndarray, other: np.ndarray) -> list[Pair]:
    """Pairs of tracks, the lower number first."""
    return [(min(p), max(p)) for p in zip(one.tolist(), other.tolist(), strict=True)]


def _votes(
    a: int,
    b: int,
    tracks: Tracks,
    lams: Sequence[np.ndarray],
    shapes: Callable[[int, int], tuple[np.ndarray, np.ndarray]],
) -> list[Pair]:
    """Pairs of tracks that two points show to be one."""
    at_a, at_b = shapes(a, b)
    pairs = pair_modes(lams[a], at_a, lams[b], at_b)
    i = np.flatnonzero((pairs.partner >= 0) & ~pairs.ambiguous & (pairs.trust > DOUBTFUL))
    one, other = tracks.labels[a][i], tracks.labels[b][pairs.partner[i]]
    apart = ~np.isin(one, tracks.labels[b]) & ~np.isin(other, tracks.labels[a])
    return _ordered(one[apart], other[apart])


def _joined(votes: Counter[Pair], labels: Sequence[np.ndarray]) -> np.ndarray:
    """New number of each track, without gaps and in the order of the old ones."""
    most = max(int(label.max(initial=0)) for label in labels)
    there = np.zeros((most + 1, len(labels)), dtype=bool)
    for point, found in enumerate(labels):
        there[found, point] = True
    stands_for = np.arange(most + 1)
    for (one, other), _ in sorted(votes.items(), key=lambda item: (-item[1], item[0])):
        a, b = sorted((stands_for[one], stands_for[other]))
        if a == b or (there[a] & there[b]).any():
            continue
        there[a] |= there[b]
        stands_for[stands_for == b] = a
    number: np.ndarray = np.unique(stands_for, return_inverse=True)[1].reshape(-1)
    return number
