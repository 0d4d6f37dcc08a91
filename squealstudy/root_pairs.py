"""Bands and order of roots, one of each conjugate pair, and pairs of roots of two solutions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

LIGHT_DAMPING = 0.05  # errors are stated of modes with less damping, and of growing ones
MAX_PAIR_REL_DISTANCE = 0.05  # relative distance within which a full-order root has a partner
# distance of a full-order root from a band's edge within which its partner may be outside: over
# the largest distance of a pair, and at most, relative
EDGE_TO_DISTANCE, MOST_EDGE_REL_DISTANCE = 3.0, 1e-3
MIN_DISTANCE_TO_ERROR = 100.0  # distance, over the full-order root's error, that is an error itself
BAND_END_REL_TOLERANCE = 1e-9
RIGID_SHARE = 1e-5  # start of a band over its top, for a band from zero
# relative distance of moduli that count as equal, as of two modes that locked in
EQUAL_MODULUS_REL_DISTANCE = 1e-9


def angular_band(band_hz: tuple[float, float]) -> tuple[float, float]:
    """The band in rad/s, ends included.

    A band from 0 Hz begins at RIGID_SHARE of its top, to leave out rigid-body modes.
    """
    low, high = band_hz
    return 2 * np.pi * (low or RIGID_SHARE * high) * (
        1 - BAND_END_REL_TOLERANCE
    ), 2 * np.pi * high * (1 + BAND_END_REL_TOLERANCE)


def by_modulus(lam: np.ndarray, late: np.ndarray) -> np.ndarray:
    """Order (..., m) of roots lam (..., m): ascending in `late`, then in modulus.

    Among neighbours of equal modulus (EQUAL_MODULUS_REL_DISTANCE) the fastest growing one is last.
    Otherwise round-off, which differs between processors, would number modes.
    """
    size = np.abs(lam)
    order = np.lexsort((size, late), axis=-1)
    size, rank, grown = (
        np.take_along_axis(x, order, -1) for x in (size, np.asarray(late, dtype=int), lam.real)
    )
    is_distinct = (np.diff(size, axis=-1) > EQUAL_MODULUS_REL_DISTANCE * size[..., 1:]) | (
        np.diff(rank, axis=-1) > 0
    )
    if not is_distinct.all():
        group = np.zeros(size.shape, dtype=int)
        group[..., 1:] = np.cumsum(is_distinct, axis=-1)
        order = np.take_along_axis(order, np.lexsort((grown, group), axis=-1), -1)
    return order


def one_of_each_pair(
    lam: np.ndarray, psi: np.ndarray, band: tuple[float, float] = (0.0, np.inf)
) -> tuple[np.ndarray, np.ndarray]:
    """Roots of imaginary part >= 0 in a band of moduli, in ascending order, and unit vectors."""
    size = np.abs(lam)
    order = np.flatnonzero((lam.imag >= 0) & (size >= band[0]) & (size <= band[1]))
    order = order[np.argsort(size[order])]
    return lam[order], psi[:, order] / np.linalg.norm(psi[:, order], axis=0)


def least_assignment(cost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns, k = min(n, m) of each, of the pairs whose costs (n, m) have the least sum.

    Rows ascend. If the cheapest columns of all rows differ, they are the solution, as no sum can be
    less. Otherwise `scipy.optimize.linear_sum_assignment` is used, which is slow to import.
    """
    if len(cost) > cost.shape[1]:
        columns, rows = least_assignment(cost.T)
        order = np.argsort(rows)
        return rows[order], columns[order]
    if not cost.size:
        return np.arange(0), np.arange(0)
    cheapest = cost.argmin(axis=1)
    if len(np.unique(cheapest)) == len(cheapest) and not np.isnan(cost).any():
        return np.arange(len(cost)), cheapest

    from scipy.optimize import linear_sum_assignment

    rows, columns = linear_sum_assignment(cost)
    return rows, columns


def partners(distance: np.ndarray, limit: float = np.inf) -> np.ndarray:
    """Column (n,) of the partner of each row of distances (n, m); -1 for none.

    No two rows have the same partner. Distances beyond the `limit` make no pair and count as the
    limit. The sum of the square roots of distances is least, not that of distances: with that one
    missing mode could shift the partners of its neighbours by one each.
    """
    partner = np.full(len(distance), -1)
    if not distance.size:
        return partner
    rows, columns = least_assignment(np.sqrt(np.minimum(distance, limit)))
    is_near = distance[rows, columns] < limit
    partner[rows[is_near]] = columns[is_near]
    return partner


def partner_distances(lam: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Distance (m,) of each root to its partner among others; infinite where it has none."""
    distance = np.abs(lam[:, None] - others[None, :])
    partner = partners(distance)
    distances = np.full(len(lam), np.inf)
    paired = partner >= 0
    distances[paired] = distance[paired, partner[paired]]
    return distances


class FullOrderPairs(NamedTuple):
    """Lightly damped or growing full-order roots, with their partners among the roots of a point.

    Attributes
    ----------
    row : ndarray (k,) of int
        Indices of the partners among the roots of the point.
    lam, full : ndarray (k,) complex
        The partners and the full-order roots, rad/s.
    resolved : ndarray (k,) of bool
        Whether their distance is well above the error of the full-order root itself.
    missed : int
        Number of such full-order roots without a partner.
    """

    row: np.ndarray
    lam: np.ndarray
    full: np.ndarray
    resolved: np.ndarray
    missed: int

    @property
    def error(self) -> np.ndarray:
        """Distances (k,) of the partners, rad/s."""
        distance: np.ndarray = np.abs(self.lam - self.full)
        return distance

    @property
    def frequency_error(self) -> float:
        """Largest relative error of ``|lambda|``; infinite if all are missed, NaN without roots."""
        error = np.abs(np.abs(self.lam) / np.abs(self.full) - 1.0)
        return self._largest(error)

    @property
    def damping_error(self) -> float:
        """Largest error of the damping ratio; infinite if all are missed, NaN without roots."""
        zeta = [-roots.real / np.abs(roots) for roots in (self.lam, self.full)]
        return self._largest(np.abs(zeta[0] - zeta[1]))

    def _largest(self, error: np.ndarray) -> float:
        if len(error):
            return float(error.max())
        return np.inf if self.missed else np.nan


def paired_with_full_order(
    lam: np.ndarray,
    full: np.ndarray,
    error: np.ndarray | float = 0.0,
    band_hz: tuple[float, float] = (0.0, np.inf),
) -> FullOrderPairs:
    """Pair the roots lam (m,) of a point with full-order roots (n,), all in rad/s.

    `error` (n,) is the error of the full-order roots themselves. A root so near an edge of the band
    that its partner may be outside, by the distances of pairs, does not count as missed.
    """
    judged = (np.abs(full.real) < LIGHT_DAMPING * np.abs(full)) | (full.real > 0)
    full, errors = full[judged], np.broadcast_to(error, judged.shape)[judged]
    distance = np.abs(full[:, None] - lam[None, :])
    partner = partners(distance / np.abs(full)[:, None], MAX_PAIR_REL_DISTANCE)
    is_paired = partner >= 0
    alone = full[~is_paired]
    row, full, errors = partner[is_paired], full[is_paired], errors[is_paired]
    resolved = np.abs(full - lam[row]) > MIN_DISTANCE_TO_ERROR * errors
    largest_distance = float((np.abs(full - lam[row]) / np.abs(full)).max(initial=0.0))
    beyond = min(EDGE_TO_DISTANCE * largest_distance, MOST_EDGE_REL_DISTANCE)
    size = np.abs(alone)[:, None] / (2 * np.pi)
    at_edge = (np.abs(size - np.array(band_hz)) <= beyond * size).any(axis=1)
    return FullOrderPairs(
        row=row, lam=lam[row], full=full, resolved=resolved, missed=int((~at_edge).sum())
    )
