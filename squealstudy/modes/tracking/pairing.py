"""Pairing of the complex modes of one design point with those of the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from squealstudy.root_pairs import least_assignment

FREQUENCY_WINDOW = 0.2  # modes whose ln|lambda| differ by more are never paired
DAMPING_WINDOW = 0.5  # change of zeta that costs as much as the whole frequency window
UNPAIRED_COST = 1.0  # cost of leaving a mode without a partner
# cost of a unit of zeta, by which growth decides between two pairings of equal cost
TIE_COST = 1e-3
# another pairing is nearly as good if it costs less than this multiple of the chosen one
RIVAL_COST_RATIO = 1.5
LOW_MAC = 0.5  # a pair with a smaller MAC is ambiguous
# two modes without partner may be one mode if their distance (a cost) is less than this, also far
# from the edges of the band
LONE_MODES_DISTANCE = 0.8
# limits of `Pairing.trust`: a pair is ambiguous up to 1
# trust up to which the step is halved; a larger value halves steps sooner, 2 (MAC of 1) every step
HALVING_TRUST = 1.5
JOINING_TRUST = 1.5  # a pair with more trust shows that two tracks are one
PASSING_TRUST = 1.2  # largest trust of a pair whose frequency passes that of another,
CROSSING_MAC = 0.99  # unless its MAC is above this: then the two modes cross
# distance from an edge of the band within which a mode may come or go, over the largest change
BAND_END_CHANGE_FACTOR = 1.5
COST_ROUND_OFF = 1e-9  # for costs that differ by less the assignment problem is solved
# modes whose MAC is computed together: only pairs within the frequency window are needed
MODES_PER_BLOCK = 40


Band = tuple[float, float]


class Pairing(NamedTuple):
    """Partners of the modes of a point `a` among those of a point `b`.

    Attributes
    ----------
    partner : ndarray (ma,) of int
        Index of the mode of b that continues each mode of a; -1 where there is none.
    mac : ndarray (ma,)
        MAC of each pair, NaN without partner.
    ambiguous : ndarray (ma,) of bool
        Whether another pairing is nearly as good, or the MAC is low.
    trust : ndarray (ma,)
        How far a pair is from being ambiguous, which it is up to 1. It is the smaller of two
        ratios: cost of the next best pairing over RIVAL_COST_RATIO times its own, and MAC over
        LOW_MAC. It is at most PASSING_TRUST where two frequencies pass each other and the MAC is
        below CROSSING_MAC. For a mode without partner it is infinite, or 1 where a mode of b has
        none either and may be the same mode (`may_be_one`).
    """

    partner: np.ndarray
    mac: np.ndarray
    ambiguous: np.ndarray
    trust: np.ndarray


def mac(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Modal assurance criterion |a^H b|^2 / (|a|^2 |b|^2) of complex shapes.

    Parameters
    ----------
    a, b : ndarray (ma, k), (mb, k)
        Shapes in rows, as coordinates in an orthonormal basis.

    Returns
    -------
    ndarray (ma, mb)
        Between 0 and 1; zero where a shape vanishes.
    """
    return _mac(a, b, squares(a), squares(b))


def pair_macs(a: np.ndarray, b: np.ndarray, partner: np.ndarray) -> np.ndarray:
    """MAC (ma,) of shapes a (ma, k) with those of their partners in b (mb, k); NaN without one."""
    macs = np.full(len(partner), np.nan)
    paired = partner >= 0
    if paired.any():
        macs[paired] = mac(a, b)[paired, partner[paired]]
    return macs


def squares(a: np.ndarray) -> np.ndarray:
    """Squared 2-norm of each row (..., m)."""
    total: np.ndarray = np.einsum("...j,...j->...", a.real, a.real)
    return total + np.einsum("...j,...j->...", a.imag, a.imag)


def _mac(a: np.ndarray, b: np.ndarray, a2: np.ndarray, b2: np.ndarray) -> np.ndarray:
    product = a.conj() @ b.swapaxes(-1, -2)
    size = a2[..., :, None] * b2[..., None, :]
    macs: np.ndarray = product.real**2 + product.imag**2
    macs /= np.maximum(size, np.finfo(size.dtype).tiny, out=size)
    return np.minimum(macs, 1.0, out=macs)


def pair_modes(
    lam_a: np.ndarray,
    shapes_a: np.ndarray,
    lam_b: np.ndarray,
    shapes_b: np.ndarray,
    expected: np.ndarray | None = None,
    band: Band | None = None,
) -> Pairing:
    """One-to-one pairing of the modes of two neighbouring design points.

    A pair costs 1 - MAC, plus its distance in frequency over FREQUENCY_WINDOW and in damping over
    DAMPING_WINDOW. The pairing of least total cost is taken, in which a mode may have no partner.
    Where two modes coalesce their shapes are nearly parallel, and their distance in the complex
    plane decides.

    Parameters
    ----------
    lam_a, lam_b : ndarray (ma,), (mb,) complex
        Roots, rad/s.
    shapes_a, shapes_b : ndarray (ma, k), (mb, k) complex
        Shapes in rows, as coordinates in one orthonormal basis.
    expected : ndarray (ma,) complex or None
        The roots of a as they are expected at b; None where they are expected not to change.
    band : (low, high) or None
        Band of the roots, rad/s, at whose edges modes come and go; None if they come and go
        nowhere.
    """
    expected_lam = lam_a if expected is None else expected
    pairing_of_one = pair_many(
        lam_a[None], shapes_a[None], lam_b[None], shapes_b[None], expected_lam[None], band
    )
    return Pairing(*(part[0] for part in pairing_of_one))


def pair_many(
    lam_a: np.ndarray,
    shapes_a: np.ndarray,
    lam_b: np.ndarray,
    shapes_b: np.ndarray,
    expected: np.ndarray,
    band: Band | None = None,
) -> Pairing:
    """`pair_modes` of n pairs of design points, each with ma and mb modes: arrays (n, ...)."""
    n, count = lam_a.shape
    if not count or not lam_b.shape[1]:
        unpaired, unknown = np.full((n, count), -1), np.full((n, count), np.nan)
        return Pairing(unpaired, unknown, np.zeros((n, count), bool), np.full((n, count), np.inf))
    distance, tie = _distance(expected, lam_b)
    all_macs = _macs(shapes_a, shapes_b, distance < UNPAIRED_COST)
    cost = np.minimum(1.0 - all_macs + distance + tie, UNPAIRED_COST)
    partner = _partners(cost)
    paired = partner >= 0
    column = np.where(paired, partner, 0)
    macs = np.where(paired, _values_in_columns(all_macs, column).astype(float), np.nan)
    rival = np.where(paired, _rivals(cost, paired, column) / RIVAL_COST_RATIO, np.inf)
    ambiguous = paired & ((rival <= 1.0) | (macs < LOW_MAC))
    trust = np.where(paired, np.minimum(rival, macs / LOW_MAC), np.inf)
    passing = _passing(lam_a, np.take_along_axis(lam_b, column, axis=1), paired)
    trust = np.where(passing & (macs < CROSSING_MAC), np.minimum(trust, PASSING_TRUST), trust)
    if not paired.all():
        sizes = np.abs(lam_a), np.abs(lam_b)
        lost = may_be_one(*sizes, partner, band) | (
            may_be_one(*sizes, partner) & (distance < LONE_MODES_DISTANCE)
        )
        trust[lost.any(axis=2)] = 1.0
    return Pairing(partner, macs, ambiguous, trust)


def _values_in_columns(table: np.ndarray, column: np.ndarray) -> np.ndarray:
    """The value (n, ma) in each row of tables (n, ma, mb), in the column (n, ma) of that row."""
    return np.take_along_axis(table, column[:, :, None], axis=2)[:, :, 0]


def _distance(expected: np.ndarray, lam_b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of each pair (n, ma, mb) as a cost, and the term that decides between equal costs.

    At an undamped lock-in both pairings cost the same. A term far below all others then pairs the
    mode of lower frequency with the root of higher growth, so that rounding does not decide.
    """
    size_a, size_b = np.maximum(np.abs(expected), 1e-300), np.maximum(np.abs(lam_b), 1e-300)
    zeta_a, zeta_b = -expected.real / size_a, (-lam_b.real / size_b)[:, None, :]
    distance = np.abs(np.log(size_b)[:, None, :] - np.log(size_a)[:, :, None]) / FREQUENCY_WINDOW
    distance += np.abs(zeta_b - zeta_a[:, :, None]) / DAMPING_WINDOW
    share = size_a / size_a.max(axis=1, keepdims=True)
    return distance, share[:, :, None] * (-TIE_COST * zeta_b)


def _macs(a: np.ndarray, b: np.ndarray, candidates: np.ndarray) -> np.ndarray:
    """MAC (n, ma, mb) of the candidate pairs; for others the MAC or zero.

    Modes are roughly in order of frequency, so that a block of them needs only a part of the
    others.
    """
    a2, b2 = squares(a), squares(b)
    if a.shape[1] <= MODES_PER_BLOCK:
        return _mac(a, b, a2, b2)
    macs = np.zeros(candidates.shape, dtype=a2.dtype)
    for i in range(len(a)):
        for start in range(0, a.shape[1], MODES_PER_BLOCK):
            rows = slice(start, start + MODES_PER_BLOCK)
            near_columns = np.flatnonzero(candidates[i, rows].any(axis=0))
            if len(near_columns):
                columns = slice(near_columns[0], near_columns[-1] + 1)
                sides = a[i, rows], b[i, columns], a2[i, rows], b2[i, columns]
                macs[i, rows, columns] = _mac(*sides)
    return macs


def _partners(cost: np.ndarray) -> np.ndarray:
    """Column (n, ma) of each row in the assignment of least total cost, or -1.

    A row has -1 where all its costs reach `UNPAIRED_COST`. If the cheapest columns of all rows
    differ, and are the cheapest by more than rounding, they are the assignment: no other can be as
    cheap. The other tables are solved one by one.
    """
    lowest_cost, best = cost.min(axis=2), cost.argmin(axis=2)
    other_costs = cost.copy()
    np.put_along_axis(other_costs, best[:, :, None], UNPAIRED_COST, axis=2)
    is_unpaired = lowest_cost >= UNPAIRED_COST
    clear = is_unpaired | (other_costs.min(axis=2) - lowest_cost > COST_ROUND_OFF)
    rows = np.arange(cost.shape[1])
    partner = np.where(is_unpaired, -1, best)
    ordered = np.sort(np.where(is_unpaired, -1 - rows, best), axis=1)
    clear[:, 0] &= (np.diff(ordered, axis=1) != 0).all(axis=1)
    for i in np.flatnonzero(~clear.all(axis=1)):
        chosen_rows, columns = least_assignment(cost[i])
        taken = cost[i][chosen_rows, columns] < UNPAIRED_COST
        partner[i] = -1
        partner[i, chosen_rows[taken]] = columns[taken]
    return partner


def _rivals(cost: np.ndarray, paired: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Ratio (n, ma) of the cost of each pair's next best choice to its own cost.

    The next best choice exchanges partners with another pair, where the costs of both pairs count,
    or takes a mode that has no partner. Infinite where there is no other choice.
    """
    min_cost = 1e-300  # the cost of a pair that did not change is zero except for rounding
    n, count = column.shape
    swapped = np.take_along_axis(cost, np.broadcast_to(column[:, None, :], (n, count, count)), 2)
    pair_cost = np.einsum("nii->ni", swapped)
    ratio = swapped + swapped.transpose(0, 2, 1)
    ratio /= np.maximum(pair_cost[:, :, None] + pair_cost[:, None, :], min_cost)
    ratio[:, np.arange(count), np.arange(count)] = np.inf
    if not paired.all():
        ratio[np.broadcast_to(~paired[:, None, :], ratio.shape)] = np.inf
    best: np.ndarray = ratio.min(axis=2)
    free = np.ones((n, cost.shape[2]), dtype=bool)  # columns without a pair
    np.put_along_axis(free, column, False, axis=1)
    if not paired.all():
        i, row = np.nonzero(paired)
        free[:] = True
        free[i, column[i, row]] = False
        by_row = np.where(~paired[:, :, None] & (swapped < UNPAIRED_COST), swapped, np.inf).min(
            axis=1
        )
        best = np.minimum(best, by_row / np.maximum(pair_cost, min_cost))
    if free.any():
        others = np.where(free[:, None, :] & (cost < UNPAIRED_COST), cost, np.inf).min(axis=2)
        best = np.minimum(best, others / np.maximum(pair_cost, min_cost))
    return best


def _passing(lam_a: np.ndarray, lam_b: np.ndarray, paired: np.ndarray) -> np.ndarray:
    """Mask (n, ma) of the pairs whose frequency passes that of another pair.

    Shapes show only over a short step whether two modes cross or veer.
    """
    sizes = (np.where(paired, np.abs(lam), np.inf) for lam in (lam_a, lam_b))
    order_a, order_b = (size.argsort(axis=1, kind="stable") for size in sizes)
    rank = np.empty_like(order_b)
    np.put_along_axis(rank, order_b, np.arange(rank.shape[1])[None, :], axis=1)
    ranks = np.take_along_axis(rank, order_a, axis=1)  # ascending except for modes that pass
    least_after = np.minimum.accumulate(ranks[:, ::-1], axis=1)[:, ::-1]
    passing = (np.maximum.accumulate(ranks, axis=1) > ranks) | (least_after < ranks)
    is_passing = np.empty_like(passing)
    np.put_along_axis(is_passing, order_a, passing, axis=1)
    return is_passing & paired


def may_be_one(
    size_a: np.ndarray, size_b: np.ndarray, partner: np.ndarray, band: Band | None = None
) -> np.ndarray:
    """Pairs of a mode of a and a mode of b without partners that may be one and the same mode.

    Their distance does not matter, as a mode may move by any amount in a long step. Two modes that
    are both at an edge of the band are left out: one may have left the band, and the other have
    come in. A mode is at an edge if it is nearer to it than BAND_END_CHANGE_FACTOR times the
    largest change of ``ln|lambda|`` among the pairs.

    Parameters
    ----------
    size_a, size_b : ndarray (n, ma), (n, mb)
        ``|lambda|`` of the modes of n steps, rad/s.
    partner : ndarray (n, ma) of int
        `Pairing.partner` of each step.
    band : (low, high) or None
        Band of the roots, rad/s; None without edges.

    Returns
    -------
    ndarray (n, ma, mb) of bool
    """
    paired = partner >= 0
    is_unpaired = np.ones(size_b.shape, dtype=bool)
    i, row = np.nonzero(paired)
    is_unpaired[i, partner[i, row]] = False
    both_unpaired: np.ndarray = ~paired[:, :, None] & is_unpaired[:, None, :]
    if band is None or not both_unpaired.any():
        return both_unpaired
    log_a, log_b = (np.log(np.maximum(size, 1e-300)) for size in (size_a, size_b))
    change = np.zeros(size_a.shape)
    change[i, row] = np.abs(log_b[i, partner[i, row]] - log_a[i, row])
    largest = change.max(axis=1, initial=0.0)[:, None]
    at_a, at_b = (at_edge(size, largest, band) for size in (size_a, size_b))
    both_unpaired &= ~(at_a[:, :, None] & at_b[:, None, :])
    return both_unpaired


def at_edge(size: np.ndarray, change: np.ndarray | float, band: Band) -> np.ndarray:
    """Whether modes are so near to an edge of the band that a step may bring them out of it.

    Parameters
    ----------
    size : ndarray (..., m)
        ``|lambda|`` of the modes, rad/s.
    change : ndarray (..., 1) or float
        Change of ``ln|lambda|`` in a step.
    band : (low, high)
        Band of the roots, rad/s.

    Returns
    -------
    ndarray (..., m) of bool
    """
    edges = np.log(np.maximum(np.array(band), 1e-300))
    distance = np.abs(np.log(np.maximum(size, 1e-300))[..., None] - edges).min(axis=-1)
    near: np.ndarray = distance <= BAND_END_CHANGE_FACTOR * change
    return near


def broken(
    lam_a: np.ndarray,
    lam_b: np.ndarray,
    partner: np.ndarray,
    band: Band | None = None,
    lost: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Modes that end at a point a, and modes that begin at b, which may be the same modes.

    Parameters
    ----------
    lam_a, lam_b : ndarray (ma,), (mb,) complex
        Roots, rad/s.
    partner : ndarray (ma,) of int
        `Pairing.partner`.
    band : (low, high) or None
        Band of the roots, rad/s; None without edges.
    lost : ndarray (ma,) of bool or None
        Modes of a that may continue in b; None for all without partner.

    Returns
    -------
    ended, began : ndarray (ma,), (mb,) of bool
        Modes of a and modes of b that `may_be_one` joins.
    """
    (may_join,) = may_be_one(np.abs(lam_a)[None], np.abs(lam_b)[None], partner[None], band)
    if lost is not None:
        may_join &= lost[:, None]
    return may_join.any(axis=1), may_join.any(axis=0)
