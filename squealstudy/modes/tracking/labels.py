"""Track numbers of modes along a tree of design points; tracks of the same mode are joined."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.modes.tracking.pairing import (
    FREQUENCY_WINDOW,
    JOINING_TRUST,
    LONE_MODES_DISTANCE,
    Band,
    broken,
    pair_modes,
)
from squealstudy.modes.tracking.ragged import Ragged
from squealstudy.modes.tracking.steps import Pairings, Shapes, Stepper
from squealstudy.modes.tracking.tree import tree_of_modes

MIN_STRAIGHT_COSINE = 0.999  # two steps lie on one line if their cosine is larger
# share of the last change by which roots are extrapolated: all of it would overshoot where
# frequencies come together and lock in, none of it would lag where they cross
EXTRAPOLATED_SHARE = 0.5
MAX_STEP_RATIO = 3.0  # longest step that is extrapolated, over the previous step


@dataclass(frozen=True)
class Tracks:
    """Labels of all modes of all points: one row for each point, one entry for each mode.

    Attributes
    ----------
    labels : Ragged of int
        Track numbers from 1, by frequency at the root of the tree; tracks that begin later have
        higher numbers.
    macs : Ragged
        MAC with the track's mode at the parent point, NaN where the track begins.
    ambiguous : Ragged of bool
        Whether the pairing with the parent point is in doubt, or the track ends or begins here and
        may continue under another number (`broken`).
    """

    labels: Ragged
    macs: Ragged
    ambiguous: Ragged


class TrackTree:
    """The design points that are compared, and their order.

    Children of a point without modes attach to its nearest ancestor with modes; without one, to the
    first point with modes below the same root (`tree_of_modes`).

    Parameters
    ----------
    parents : ndarray (n,) of int
        Parent of each point, -1 for a root.
    lams : Ragged
        Roots of each point [rad/s]; an empty row for a failed point.
    coordinates : ndarray (n, p) or None
        Coordinates of the points; with them roots are extrapolated along straight lines of the
        tree.
    band : (low, high) or None
        Band of the roots, rad/s, at whose edges modes come and go.

    Attributes
    ----------
    parents : ndarray (n,) of int
        Parents in the tree of the points that have modes.
    step : ndarray (n,)
        Share of the last change of the roots that is expected to continue to each point.

    Raises
    ------
    ValueError
        Where `parents` is no tree over the points.
    """

    def __init__(
        self,
        parents: np.ndarray,
        lams: Ragged,
        coordinates: np.ndarray | None = None,
        band: Band | None = None,
    ) -> None:
        if len(lams) != len(parents):
            raise ValueError(f"{len(parents)} parents, {len(lams)} sets of roots")
        self.lams, self.band = lams, band
        self.parents, self._depth = tree_of_modes(np.asarray(parents), lams.counts)
        self.step = np.zeros(len(parents))
        if coordinates is not None and len(parents):
            x = _normalised(np.asarray(coordinates, dtype=float))
            self.step = _steps(x, self.parents)

    def stepper(self, shapes: Shapes) -> Stepper:
        """The `Stepper` that pairs modes of points with those of their parents."""
        return Stepper(self.parents, self.step, self.lams, shapes, self.band)

    def label(self, pairings: Pairings) -> Tracks:
        """Labels of all modes: a mode inherits the label of the parent's mode that it continues."""
        lams, point = self.lams, self.lams.owner
        number = np.arange(len(point))
        parent = self.parents[point]
        inherits = (pairings.source >= 0) & (parent >= 0)
        mode, parent_point = number[inherits], parent[inherits]
        source_entry = pairings.partner.starts[point[mode]] + pairings.source[mode]
        macs = np.full(len(point), np.nan)
        macs[mode] = pairings.mac.flat[source_entry]
        ambiguous = lams.with_flat(np.zeros(len(point), dtype=bool))
        ambiguous.flat[mode] = pairings.ambiguous.flat[source_entry]
        for i in self._breaks(pairings).tolist():
            p = int(self.parents[i])
            is_lost = pairings.trust[i] <= 1.0  # above that, smaller steps have confirmed the end
            ended, began = broken(lams[p], lams[i], pairings.partner[i], self.band, is_lost)
            ambiguous[p][ended] = True
            ambiguous[i][began] = True
        origin = number.copy()  # the mode itself, or the mode of the parent that it continues
        origin[mode] = lams.starts[parent_point] + pairings.source[mode]
        labels = self._numbers(_roots(origin))
        return Tracks(lams.with_flat(labels), lams.with_flat(macs), ambiguous)

    def _breaks(self, pairings: Pairings) -> np.ndarray:
        """Points to which a step leads on which modes end and others begin."""
        paired = np.bincount(
            pairings.partner.owner[pairings.partner.flat >= 0], minlength=len(self.parents)
        )
        ends, begins = pairings.partner.counts - paired, self.lams.counts - paired
        broken_at: np.ndarray = np.flatnonzero((self.parents >= 0) & (ends > 0) & (begins > 0))
        return broken_at

    def _numbers(self, root: np.ndarray) -> np.ndarray:
        """Track number (N,) of each mode from `root` (N,), the mode at which its track begins.

        Tracks are numbered by the depth at which they begin; at the same depth oscillating modes
        come first, by frequency.
        """
        new = np.flatnonzero(root == np.arange(len(root)))
        lam, depth = self.lams.flat[new], self._depth[self.lams.owner[new]]
        order = np.lexsort((new, np.abs(lam), lam.imag == 0, depth))
        labels = np.zeros(len(root), dtype=np.int64)
        labels[new[order]] = np.arange(1, len(new) + 1)
        return labels[root]


def _roots(origin: np.ndarray) -> np.ndarray:
    """Last entry of each entry's chain: each has the index of the next one, the last its own."""
    while not np.array_equal(further := origin[origin], origin):
        origin = further
    return origin


def _normalised(x: np.ndarray) -> np.ndarray:
    span = np.ptp(x, axis=0)
    scaled: np.ndarray = x / np.where(span > 0, span, 1.0)
    return scaled


def _steps(x: np.ndarray, parents: np.ndarray) -> np.ndarray:
    """Share (n,) of the last change that is expected to continue to each point; 0 off a line."""
    with_grandparent = np.flatnonzero(parents >= 0)
    with_grandparent = with_grandparent[parents[parents[with_grandparent]] >= 0]
    p, g = parents[with_grandparent], parents[parents[with_grandparent]]
    u, v = x[p] - x[g], x[with_grandparent] - x[p]
    size_u, size_v = np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)
    straight = np.einsum("ij,ij->i", u, v) > MIN_STRAIGHT_COSINE * size_u * size_v
    ratio = size_v / np.where(size_u > 0, size_u, 1.0)
    step = np.zeros(len(parents))
    step[with_grandparent] = np.where(
        straight, EXTRAPOLATED_SHARE * np.minimum(ratio, MAX_STEP_RATIO), 0.0
    )
    return step


MAX_VOTES_ASKED = 20  # most pairs of neighbouring points at which two tracks are compared
Pair = tuple[int, int]


def join_tracks(tracks: Tracks, lams: Ragged, edges: np.ndarray, shapes: Shapes) -> Tracks:
    """Give one number to tracks that neighbouring points show to be of one mode.

    A mode that comes into the band on several lines of a grid gets a number on each of them. Two
    tracks are joined if neighbouring points of different branches pair them without doubt, and no
    point has both. Tracks that most neighbours pair are joined first.

    Parameters
    ----------
    tracks : Tracks
    lams : Ragged
        Roots of each point, rad/s.
    edges : ndarray (e, 2) of int
        Neighbouring points that the tree does not connect.
    shapes : Shapes
        Shapes of the modes of each point.
    """
    votes: Counter[Pair] = Counter()
    times_asked: Counter[Pair] = Counter()
    for a, b in edges[_differ(tracks.labels, edges)].tolist():
        candidate_pairs = _may_join(lams[a], tracks.labels[a], lams[b], tracks.labels[b])
        if any(times_asked[pair] < MAX_VOTES_ASKED for pair in candidate_pairs):
            times_asked.update(candidate_pairs)
            votes.update(_votes(a, b, tracks, lams, shapes))
    if not votes:
        return tracks
    number = _joined(votes, tracks.labels)
    return replace(tracks, labels=tracks.labels.with_flat(number[tracks.labels.flat]))


def _differ(labels: Ragged, edges: np.ndarray) -> np.ndarray:
    """Whether the ends of each edge (e,) have different tracks."""
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
    """Pairs of tracks that are near in frequency; each track is at only one of the two points."""
    a = np.flatnonzero(~np.isin(labels_a, labels_b))
    b = np.flatnonzero(~np.isin(labels_b, labels_a))
    ratio = np.abs(lam_a[a])[:, None] / np.abs(lam_b[b])
    i, j = np.nonzero(np.abs(np.log(ratio)) < LONE_MODES_DISTANCE * FREQUENCY_WINDOW)
    return _ordered(labels_a[a[i]], labels_b[b[j]])


def _ordered(tracks_a: np.ndarray, tracks_b: np.ndarray) -> list[Pair]:
    """Pairs of tracks, the lower number first."""
    return [(min(p), max(p)) for p in zip(tracks_a.tolist(), tracks_b.tolist(), strict=True)]


def _votes(a: int, b: int, tracks: Tracks, lams: Ragged, shapes: Shapes) -> list[Pair]:
    """Pairs of tracks whose modes at points a and b are paired without doubt."""
    at_a, at_b = (shapes_of_point[0] for shapes_of_point in shapes.of(np.array([a]), np.array([b])))
    pairs = pair_modes(lams[a], at_a, lams[b], at_b)
    i = np.flatnonzero((pairs.partner >= 0) & ~pairs.ambiguous & (pairs.trust > JOINING_TRUST))
    tracks_a, tracks_b = tracks.labels[a][i], tracks.labels[b][pairs.partner[i]]
    never_together = ~np.isin(tracks_a, tracks.labels[b]) & ~np.isin(tracks_b, tracks.labels[a])
    return _ordered(tracks_a[never_together], tracks_b[never_together])


def _joined(votes: Counter[Pair], labels: Ragged) -> np.ndarray:
    """New number of each track by its old one, without gaps and in the same order."""
    last_label = int(labels.flat.max(initial=0))
    order = np.argsort(labels.flat, kind="stable")
    ends = np.searchsorted(labels.flat[order], np.arange(last_label + 2))
    points = labels.owner[order]
    points_of_track = {
        t: points[ends[t] : ends[t + 1]] for pair in votes for t in pair
    }  # ascending
    joined_number = np.arange(last_label + 1)
    for (track_a, track_b), _ in sorted(votes.items(), key=lambda item: (-item[1], item[0])):
        a, b = sorted((int(joined_number[track_a]), int(joined_number[track_b])))
        points_of_both = np.sort(np.concatenate([points_of_track[a], points_of_track[b]]))
        if a == b or (points_of_both[1:] == points_of_both[:-1]).any():
            continue
        points_of_track[a] = points_of_both
        joined_number[joined_number == b] = a
    number: np.ndarray = np.unique(joined_number, return_inverse=True)[1].reshape(-1)
    return number
