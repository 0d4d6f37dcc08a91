"""Tracks that begin on several branches of the tree, though they are of one mode."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from squealstudy.modes.tracking.labels import Tracks
from squealstudy.modes.tracking.pairing import FREQUENCY_WINDOW, LOST, pair_modes
from squealstudy.modes.tracking.refinement import DOUBTFUL

ENOUGH = 20  # neighbours that are asked about two tracks
Pair = tuple[int, int]


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
    i, j = np.nonzero(np.abs(np.log(ratio)) < LOST * FREQUENCY_WINDOW)
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
