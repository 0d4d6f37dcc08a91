"""The complex modes of each design point, paired with those of its parent in the tracking tree.

A step of the tree leads from a parent to a point. Tracks of modes are made from these pairings
(`labels.TrackingTree`). Many steps are paired in one call, which is far faster than one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from squealstudy.modes.tracking.pairing import PASSING_TRUST, Band, Pairing, pair_many
from squealstudy.modes.tracking.ragged import Ragged

# most mode pairs whose costs are computed in one call, so that tables fit the processor cache
MAX_PAIRS_PER_CALL = 16_384


class Shapes(Protocol):
    """Source of the mode shapes at both ends of a step, in the same coordinates."""

    def coordinate_system(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Number (n,) of the coordinates of each step from point a to point b.

        Steps of one number have shapes of the same length k, so that they fit one array.
        """
        ...

    def of(self, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Shapes (n, ma, k) at points a and (n, mb, k) at points b of steps with one number."""
        ...


class Pairings:
    """Pairings of steps; a step is named by the point that it leads to.

    Parameters
    ----------
    parents : ndarray (n,) of int
        Point at which the step to each point begins, -1 where no step leads to it.
    counts : ndarray (n,) of int
        Number of modes of each point.

    Attributes
    ----------
    partner, mac, ambiguous, trust : Ragged
        The arrays of `Pairing`: one row for each point, with an entry for each mode of its parent.
    source : ndarray (N,) of int
        Index of the parent's mode that each mode of each point continues; -1 where there is none.
    """

    def __init__(self, parents: np.ndarray, counts: np.ndarray) -> None:
        steps = np.where(parents >= 0, counts[parents], 0)
        total = int(steps.sum())
        self.partner = Ragged(np.full(total, -1, dtype=np.int32), steps)
        self.mac = self.partner.with_flat(np.full(total, np.nan))
        self.ambiguous = self.partner.with_flat(np.zeros(total, dtype=bool))
        self.trust = self.partner.with_flat(np.full(total, np.inf))
        self.source = np.full(int(counts.sum()), -1, dtype=np.int32)
        self._first = np.cumsum(counts) - counts  # index of each point's first mode in `source`

    def __getitem__(self, point: int) -> Pairing:
        """The pairing of the step to a point."""
        parts = (self.partner, self.mac, self.ambiguous, self.trust)
        return Pairing(*(part[point] for part in parts))

    def enter(self, points: np.ndarray, pairing: Pairing, count: int) -> np.ndarray:
        """Store pairings (r, ma) of steps to points with `count` modes; mask (r,) of new ones."""
        rows = self.partner.block(points, pairing.partner.shape[1])
        changed: np.ndarray = (self.partner.flat[rows] != pairing.partner).any(axis=1)
        parts = (self.partner, self.mac, self.ambiguous, self.trust)
        for part, values in zip(parts, pairing, strict=True):
            part.flat[rows] = values
        self.source[self._first[points][:, None] + np.arange(count)] = -1
        i, a = np.nonzero(pairing.partner >= 0)
        self.source[self._first[points[i]] + pairing.partner[i, a]] = a
        return changed

    def mark_unresolved(self, refined: np.ndarray) -> None:
        """Mark doubtful pairs as ambiguous, except on the `refined` steps.

        `refinement.unresolved` does the same for one pairing.
        """
        settled = np.zeros(len(self.partner), dtype=bool)
        settled[refined] = True
        self.ambiguous.flat[self._doubtful() & ~np.repeat(settled, self.partner.counts)] = True

    def count_unresolved(self) -> int:
        """Number of pairs that are ambiguous if no step is refined."""
        return int((self.ambiguous.flat | self._doubtful()).sum())

    def _doubtful(self) -> np.ndarray:
        """Flags of all pairs in flat order: modes that pass each other in frequency too closely."""
        doubtful: np.ndarray = (self.trust.flat <= PASSING_TRUST) & (self.partner.flat >= 0)
        return doubtful


class Stepper:
    """Pairs the modes of design points with those of their parents in the tracking tree.

    Along a straight branch of the tree, the roots at a point are predicted: the last change of each
    mode's root continues. The prediction needs the pairing of the previous step. To pair all steps
    together, modes are first assumed to have the same order at both ends of every previous step.
    Where that assumption is wrong, the next step is paired again. The final pairings equal those of
    pairing one step after the other.

    Parameters
    ----------
    parents : ndarray (n,) of int
        Point at which the step to each point begins, -1 where no step leads to it.
    step : ndarray (n,)
        Part of the last change of the roots that is predicted to follow once more on the step to
        each point; 0 where the step does not continue a straight line.
    lams : Ragged
        Roots of each point, rad/s.
    shapes : Shapes
        Shapes of the modes in the order of `lams`.
    band : (low, high) or None
        Band of the roots, rad/s (`pair_modes`).
    """

    def __init__(
        self,
        parents: np.ndarray,
        step: np.ndarray,
        lams: Ragged,
        shapes: Shapes,
        band: Band | None = None,
    ) -> None:
        self._parents, self._step, self._lams, self._shapes = parents, step, lams, shapes
        self._band = band
        straight = np.flatnonzero(step)
        self._straight_by_parent = straight[np.argsort(parents[straight], kind="stable")]

    def pair_all(self) -> Pairings:
        """Pair all steps of the tree."""
        pairings = Pairings(self._parents, self._lams.counts)
        steps = np.flatnonzero(self._parents >= 0)
        before, after = self._lams.counts[self._parents[steps]], self._lams.counts[steps]
        for count in np.unique(np.minimum(before, after)):
            points = steps[np.minimum(before, after) == count]
            same_order = np.broadcast_to(np.arange(count, dtype=np.int32), (len(points), count))
            pairings.partner.flat[pairings.partner.block(points, int(count))] = same_order
            pairings.source[self._lams.block(points, int(count))] = same_order
        self.pair(pairings, steps, np.zeros(0, dtype=int))
        return pairings

    def pair_followers(self, pairings: Pairings, changed: np.ndarray, refined: np.ndarray) -> None:
        """Pair again the steps that continue steps to `changed` points, except `refined` steps."""
        self.pair(pairings, np.setdiff1d(self._followers(changed), refined), refined)

    def pair(self, pairings: Pairings, points: np.ndarray, refined: np.ndarray) -> None:
        """Pair the steps to points, then those after each step whose pairing has changed."""
        while len(points):
            batches = self._pair_in_batches(pairings, points)
            changed = [
                batch[pairings.enter(batch, pairing, count)] for batch, pairing, count in batches
            ]
            points = np.setdiff1d(self._followers(np.concatenate(changed)), refined)

    def expected(self, pairings: Pairings, points: np.ndarray) -> np.ndarray:
        """Predicted roots (r, ma) [rad/s] at points (r,) of their parents' modes.

        All parents must have the same number of modes.
        """
        p = self._parents[points]
        rows = self._lams.block(p, int(self._lams.counts[p[0]]))
        lam, source = self._lams.flat[rows], pairings.source[rows]
        follows = (source >= 0) & (self._step[points] != 0)[:, None]
        i, b = np.nonzero(follows)
        earlier = self._lams.flat[self._lams.starts[self._parents[p[i]]] + source[i, b]]
        lam[i, b] += self._step[points[i]] * (lam[i, b] - earlier)
        return lam

    def _followers(self, points: np.ndarray) -> np.ndarray:
        """Points of the next steps on the straight lines through some points, ascending."""
        parents = self._parents[self._straight_by_parent]
        first, last = (np.searchsorted(parents, points, side) for side in ("left", "right"))
        count = last - first
        positions = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
        return np.sort(self._straight_by_parent[positions])

    def _pair_in_batches(
        self, pairings: Pairings, points: np.ndarray
    ) -> Iterator[tuple[np.ndarray, Pairing, int]]:
        """Pair steps in batches of arrays; yield each batch, its pairings and the modes of a point.

        All steps of a batch have the same numbers of modes at their start and at their end.
        """
        parents = self._parents[points]
        counts = self._lams.counts[parents], self._lams.counts[points]
        sizes = np.column_stack([*counts, self._shapes.coordinate_system(parents, points)])
        sizes_of_group, group = np.unique(sizes, axis=0, return_inverse=True)
        group = group.reshape(-1)
        ordered = np.argsort(group, kind="stable")
        ends = np.cumsum(np.bincount(group, minlength=len(sizes_of_group)))
        for (before, after, _), rows_of_group in zip(
            sizes_of_group, np.split(ordered, ends[:-1]), strict=True
        ):
            together = max(1, MAX_PAIRS_PER_CALL // int(before * after))
            for start in range(0, len(rows_of_group), together):
                batch = points[rows_of_group[start : start + together]]
                p = self._parents[batch]
                at_a, at_b = self._shapes.of(p, batch)
                expected = self.expected(pairings, batch)
                lams = (
                    self._lams.flat[self._lams.block(*x)] for x in ((p, before), (batch, after))
                )
                lam_a, lam_b = lams
                yield batch, pair_many(lam_a, at_a, lam_b, at_b, expected, self._band), int(after)
