"""Pairings of all steps of a tree of design points, many at a time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from squealstudy.modes.tracking.pairing import PASSING_TRUST, Band, Pairing, pair_many
from squealstudy.modes.tracking.ragged import Ragged

AT_ONCE = 16_384  # entries of the tables of costs that are made together: they fit a cache


class Shapes(Protocol):
    """Shapes of the modes of design points, two points of a step in common coordinates."""

    def sort(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """A number for each step (n,): those of one number have as many coordinates."""
        ...

    def of(self, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Shapes (n, ma, k) and (n, mb, k) at both ends of steps of one sort and equal counts."""
        ...


class Pairings:
    """Pairings of steps, each of them known by the point that it leads to.

    Parameters
    ----------
    parents : ndarray (n,) of int
        Where each point's step begins, -1 where none leads to it.
    counts : ndarray (n,) of int
        Modes of each point.

    Attributes
    ----------
    partner, mac, ambiguous, trust : Ragged
        As of a Pairing: a row a point, with an entry for each mode of its parent.
    source : ndarray (N,) of int
        Mode of the parent that each mode of each point continues, -1 where there is none.
    """

    def __init__(self, parents: np.ndarray, counts: np.ndarray) -> None:
        steps = np.where(parents >= 0, counts[parents], 0)
        total = int(steps.sum())
        self.partner = Ragged(np.full(total, -1, dtype=np.int32), steps)
        self.mac = self.partner.with_flat(np.full(total, np.nan))
        self.ambiguous = self.partner.with_flat(np.zeros(total, dtype=bool))
        self.trust = self.partner.with_flat(np.full(total, np.inf))
        self.source = np.full(int(counts.sum()), -1, dtype=np.int32)
        self._first = np.cumsum(counts) - counts  # mode of each point

    def __getitem__(self, point: int) -> Pairing:
        """The pairing of the step to a point."""
        parts = (self.partner, self.mac, self.ambiguous, self.trust)
        return Pairing(*(part[point] for part in parts))

    def enter(self, points: np.ndarray, pairing: Pairing, count: int) -> np.ndarray:
        """Write pairings (r, ma) of steps to points with `count` modes; which partners changed."""
        rows = self.partner.block(points, pairing.partner.shape[1])
        changed: np.ndarray = (self.partner.flat[rows] != pairing.partner).any(axis=1)
        parts = (self.partner, self.mac, self.ambiguous, self.trust)
        for part, values in zip(parts, pairing, strict=True):
            part.flat[rows] = values
        self.source[self._first[points][:, None] + np.arange(count)] = -1
        i, a = np.nonzero(pairing.partner >= 0)
        self.source[self._first[points[i]] + pairing.partner[i, a]] = a
        return changed

    def unresolved(self, refined: np.ndarray) -> None:
        """Mark doubtful pairs as ambiguous, except on the `refined` steps.

        What `refinement.unresolved` does for one pairing.
        """
        settled = np.zeros(len(self.partner), dtype=bool)
        settled[refined] = True
        self.ambiguous.flat[self._doubtful() & ~np.repeat(settled, self.partner.counts)] = True

    def count_unresolved(self) -> int:
        """Number of pairs that are ambiguous where nothing is refined."""
        return int((self.ambiguous.flat | self._doubtful()).sum())

    def _doubtful(self) -> np.ndarray:
        doubtful: np.ndarray = (self.trust.flat <= PASSING_TRUST) & (self.partner.flat >= 0)
        return doubtful


class Stepper:
    """Pairs the modes of points with those of their parents.

    Where the line of a tree goes on straight, roots are expected to do so too, by the pairing of
    the step before. All steps are paired together, each supposing that modes keep their places on
    the step before; where that turns out wrong, the step after is paired again. What remains is
    what pairing in order would have found.

    Parameters
    ----------
    parents : ndarray (n,) of int
    step : ndarray (n,)
        Share of the last change of the roots that is expected to go on; 0 off a straight line.
    lams : Ragged
        Roots of each point, rad/s.
    shapes : Shapes
    band : (low, high) or None
        Of the roots, as of `pair_modes`.
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
        self._after = straight[np.argsort(parents[straight], kind="stable")]

    def all(self) -> Pairings:
        """The pairings of all steps."""
        pairings = Pairings(self._parents, self._lams.counts)
        steps = np.flatnonzero(self._parents >= 0)
        before, after = self._lams.counts[self._parents[steps]], self._lams.counts[steps]
        for count in np.unique(np.minimum(before, after)):
            points = steps[np.minimum(before, after) == count]
            own_numbers = np.broadcast_to(np.arange(count, dtype=np.int32), (len(points), count))
            pairings.partner.flat[pairings.partner.block(points, int(count))] = own_numbers
            pairings.source[self._lams.block(points, int(count))] = own_numbers
        self.pair(pairings, steps, np.zeros(0, dtype=int))
        return pairings

    def again(self, pairings: Pairings, changed: np.ndarray, refined: np.ndarray) -> None:
        """Pair the steps after changed pairings again, except the `refined` ones."""
        self.pair(pairings, np.setdiff1d(self._followers(changed), refined), refined)

    def pair(self, pairings: Pairings, points: np.ndarray, refined: np.ndarray) -> None:
        """Pair the steps to points, and those after them again where the pairing has changed."""
        while len(points):
            batches = self._paired(pairings, points)
            changed = [
                batch[pairings.enter(batch, pairing, count)] for batch, pairing, count in batches
            ]
            points = np.setdiff1d(self._followers(np.concatenate(changed)), refined)

    def expected(self, pairings: Pairings, points: np.ndarray) -> np.ndarray:
        """Where the roots of the parents are expected at points (r, ma), rad/s.

        Points of equal counts at their parents.
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
        """Points on straight lines one step after others, ascending."""
        parents = self._parents[self._after]
        first, last = (np.searchsorted(parents, points, side) for side in ("left", "right"))
        count = last - first
        positions = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
        return np.sort(self._after[positions])

    def _paired(
        self, pairings: Pairings, points: np.ndarray
    ) -> Iterator[tuple[np.ndarray, Pairing, int]]:
        """Batches of steps of equal counts of modes, their pairings, and the count at the end."""
        parents = self._parents[points]
        counts = self._lams.counts[parents], self._lams.counts[points]
        sizes = np.column_stack([*counts, self._shapes.sort(parents, points)])
        kinds, which = np.unique(sizes, axis=0, return_inverse=True)
        which = which.reshape(-1)
        ordered = np.argsort(which, kind="stable")
        ends = np.cumsum(np.bincount(which, minlength=len(kinds)))
        for (before, after, _), step_rows in zip(kinds, np.split(ordered, ends[:-1]), strict=True):
            together = max(1, AT_ONCE // int(before * after))
            for start in range(0, len(step_rows), together):
                batch = points[step_rows[start : start + together]]
                p = self._parents[batch]
                at_a, at_b = self._shapes.of(p, batch)
                expected = self.expected(pairings, batch)
                lams = (
                    self._lams.flat[self._lams.block(*x)] for x in ((p, before), (batch, after))
                )
                lam_a, lam_b = lams
                yield batch, pair_many(lam_a, at_a, lam_b, at_b, expected, self._band), int(after)
