"""Tracks of different branches of a tree that are of one mode."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from squealstudy.modes.tracking.labels import Tracks
from squealstudy.modes.tracking.pairing import DOUBTFUL, LOST, PAIR_FREQUENCY, pair_modes
from squealstudy.modes.tracking.ragged import Ragged
from squealstudy.modes.tracking.steps import Shapes

ENOUGH = 20  # neighbours that are asked about two tracks
Pair = tuple[int, int]


def join_tracks(tracks: Tracks, lams: Ragged, edges: np.ndarray, shapes: Shapes) -> Tracks:
    """Give one number to tracks that neighbouring points show to be of one mode.

    A mode that comes into the band on several lines of a grid gets a number on each of them. Two
    tracks are joined where neighbours of different branches pair them without doubt, and where no
    point has both; those that most neighbours pair come first.

    Parameters
    ----------
    tracks : Tracks
    lams : Ragged
        Roots of each point, rad/s.
    edges : ndarray (e, 2) of int
        Neighbouring points that the tree does not connect.
    shapes : Shapes
    """
    votes: Counter[Pair] = Counter()
    asked: Counter[Pair] = Counter()
    for a, b in edges[_differ(tracks.labels, edges)].tolist():
        near = _may_join(lams[a], tracks.labels[a], lams[b], tracks.labels[b])
        if any(asked[pair] < ENOUGH for pair in near):
            asked.update(near)
            votes.update(_votes(a, b, tracks, lams, shapes))
    if not votes:
        return tracks
    number = _joined(votes, tracks.labels)
    return replace(tracks, labels=tracks.labels.with_flat(number[tracks.labels.flat]))


def _differ(labels: Ragged, edges: np.ndarray) -> np.ndarray:
    """Edges (e,) at both ends of which there are not the same tracks."""
    a, b = edges.T
    counts = labels.counts
    ordered = labels.with_flat(labels.flat[np.lexsort((labels.flat, labels.owner))])
    differ: np.ndarray = counts[a] != counts[b]
    for count in np.unique(counts[a[~differ]]):
        same = np.flatnonzero(~differ & (counts[a] == count))
        sides = (ordered.flat[ordered.block(x[same], int(count))] for x in (a, b))
        differ[same[(next(sides) != next(sides)).any(axis=1)]] = True
    return differ


def _may_join(
    lam_a: np.ndarray, labels_a: np.ndarray, lam_b: np.ndarray, labels_b: np.ndarray
) -> list[Pair]:
    """Tracks that one of two points lacks, with those that the other lacks, near in frequency."""
    a = np.flatnonzero(~np.isin(labels_a, labels_b))
    b = np.flatnonzero(~np.isin(labels_b, labels_a))
    ratio = np.abs(lam_a[a])[:, None] / np.abs(lam_b[b])
    i, j = np.nonzero(np.abs(np.log(ratio)) < LOST * PAIR_FREQUENCY)
    return _ordered(labels_a[a[i]], labels_b[b[j]])


def _ordered(one: np.ndarray, other: np.ndarray) -> list[Pair]:
    """Pairs of tracks, the lower number first."""
    return [(min(p), max(p)) for p in zip(one.tolist(), other.tolist(), strict=True)]


def _votes(a: int, b: int, tracks: Tracks, lams: Ragged, shapes: Shapes) -> list[Pair]:
    """Pairs of tracks that two points show to be one."""
    at_a, at_b = (found[0] for found in shapes.of(np.array([a]), np.array([b])))
    pairs = pair_modes(lams[a], at_a, lams[b], at_b)
    i = np.flatnonzero((pairs.partner >= 0) & ~pairs.ambiguous & (pairs.trust > DOUBTFUL))
    one, other = tracks.labels[a][i], tracks.labels[b][pairs.partner[i]]
    apart = ~np.isin(one, tracks.labels[b]) & ~np.isin(other, tracks.labels[a])
    return _ordered(one[apart], other[apart])


def _joined(votes: Counter[Pair], labels: Ragged) -> np.ndarray:
    """New number of each track, without gaps and in the order of the old ones."""
    most = int(labels.flat.max(initial=0))
    order = np.argsort(labels.flat, kind="stable")
    ends = np.searchsorted(labels.flat[order], np.arange(most + 2))
    points = labels.owner[order]
    there = {t: points[ends[t] : ends[t + 1]] for pair in votes for t in pair}  # ascending
    stands_for = np.arange(most + 1)
    for (one, other), _ in sorted(votes.items(), key=lambda item: (-item[1], item[0])):
        a, b = sorted((int(stands_for[one]), int(stands_for[other])))
        both = np.sort(np.concatenate([there[a], there[b]]))
        if a == b or (both[1:] == both[:-1]).any():
            continue
        there[a] = both
        stands_for[stands_for == b] = a
    number: np.ndarray = np.unique(stands_for, return_inverse=True)[1].reshape(-1)
    return number
