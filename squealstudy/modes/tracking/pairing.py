"""Which complex mode of one design point goes on as which mode of the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

PAIR_FREQUENCY = 0.2  # relative change of |lambda| from which on two modes are never paired
PAIR_DAMPING = 0.5  # change of zeta that weighs as much as the whole frequency window
UNPAIRED = 1.0  # cost of leaving a mode without partner
RIVAL = 1.5  # another pairing is nearly as good below this multiple of the chosen one's cost
LOW_MAC = 0.5
TIE = 1e-3  # what decides between two equal pairings, see `_cost`
LOST = 0.8  # distance within which two modes that both stay alone may be one, see `_lost`
DOUBTFUL = 1.5  # trust up to which a pairing is looked at again; ambiguous is up to 1
PASSING = 1.2  # trust in a pair whose frequency passes that of another
CLEAR = 0.99  # but for a MAC above this: a crossing
EDGE = 1.5  # a mode may come or go at an edge of the band within this times the largest change
BLOCK = 40  # modes whose MAC is taken together: only those within the frequency window count


class Pairing(NamedTuple):
    """Partners of the modes of a point `a` among those of a point `b`.

    Attributes
    ----------
    partner : ndarray (ma,) of int
        Mode of b that continues each mode of a; -1 where there is none.
    mac : ndarray (ma,)
        MAC of each pair, NaN without partner.
    ambiguous : ndarray (ma,) of bool
        Another pairing is nearly as good, or the MAC is low.
    trust : ndarray (ma,)
        How far a pair is from being ambiguous: cost of the next best pairing over RIVAL times its
        own, or MAC over LOW_MAC where that is less; ambiguous where not above 1. At most PASSING
        where two frequencies pass each other and the MAC is not CLEAR, 1 for a mode that stays
        alone near another that does.
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
        One shape a row, coordinates in an orthonormal basis.

    Returns
    -------
    ndarray (ma, mb)
        Between 0 and 1; zero where a shape vanishes.
    """
    return _mac(a, b, squares(a), squares(b))


def pair_macs(a: np.ndarray, b: np.ndarray, partner: np.ndarray) -> np.ndarray:
    """MAC of shapes (ma, k) with their partners' among (mb, k), NaN where there is none (ma,)."""
    value = np.full(len(partner), np.nan)
    paired = partner >= 0
    if paired.any():
        value[paired] = mac(a, b)[paired, partner[paired]]
    return value


def squares(a: np.ndarray) -> np.ndarray:
    """Squared 2-norm of each row (m,)."""
    total: np.ndarray = np.einsum("ij,ij->i", a.real, a.real)
    return total + np.einsum("ij,ij->i", a.imag, a.imag)


def _mac(a: np.ndarray, b: np.ndarray, a2: np.ndarray, b2: np.ndarray) -> np.ndarray:
    product = a.conj() @ b.T
    size = a2[:, None] * b2
    value: np.ndarray = product.real**2 + product.imag**2
    value /= np.maximum(size, np.finfo(size.dtype).tiny, out=size)
    return np.minimum(value, 1.0, out=value)


def pair_modes(
    lam_a: np.ndarray,
    shapes_a: np.ndarray,
    lam_b: np.ndarray,
    shapes_b: np.ndarray,
    expected: np.ndarray | None = None,
) -> Pairing:
    """One-to-one pairing of the modes of two neighbouring design points.

    A pair costs 1 - MAC, plus its distance in frequency and in damping as shares of
    FREQUENCY_WINDOW and DAMPING_WINDOW; the pairing of least total cost is taken, in which a mode
    may stay alone. Where two modes coalesce their shapes are near-parallel and their distance in
    the complex plane decides.

    Parameters
    ----------
    lam_a, lam_b : ndarray (ma,), (mb,) complex
        Roots, rad/s.
    shapes_a, shapes_b : ndarray (ma, k), (mb, k) complex
        One shape a row, coordinates in one orthonormal basis.
    expected : ndarray (ma,) complex or None
        Where the roots of a are expected at b; None: where they are at a.
    """
    from scipy.optimize import linear_sum_assignment

    partner = np.full(len(lam_a), -1)
    macs = np.full(len(lam_a), np.nan)
    trust = np.full(len(lam_a), np.inf)
    if not len(lam_a) or not len(lam_b):
        return Pairing(partner, macs, np.zeros(len(lam_a), dtype=bool), trust)
    far, tie = _distance(lam_a if expected is None else expected, lam_b)
    value = _mac_within(shapes_a, shapes_b, far < UNPAIRED)
    cost = np.minimum(1.0 - value + far + tie, UNPAIRED)
    rows, columns = linear_sum_assignment(cost)
    taken = cost[rows, columns] < UNPAIRED
    rows, columns = rows[taken], columns[taken]
    partner[rows], macs[rows] = columns, value[rows, columns]
    rival = _rival(cost, rows, columns) / RIVAL
    trust[rows] = np.minimum(rival, macs[rows] / LOW_MAC)
    ambiguous = np.zeros(len(lam_a), dtype=bool)
    ambiguous[rows] = (rival <= 1.0) | (macs[rows] < LOW_MAC)
    unclear = macs[rows] < CLEAR
    passing = _passing(lam_a[rows], lam_b[columns])
    trust[rows[unclear]] = np.minimum(trust[rows], passing)[unclear]
    trust[_lost(far, partner)] = 1.0
    return Pairing(partner, macs, ambiguous, trust)


def _distance(expected: np.ndarray, lam_b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of each pair (ma, mb) as a cost, and what decides between equal pairings.

    At an undamped lock-in both pairings cost the same: a term far below all others then sends the
    mode of lower frequency on with the higher growth, so that rounding does not decide.
    """
    size_a, size_b = np.maximum(np.abs(expected), 1e-300), np.maximum(np.abs(lam_b), 1e-300)
    zeta_a, zeta_b = -expected.real / size_a, -lam_b.real / size_b
    far = np.abs(np.log(size_b) - np.log(size_a)[:, None]) / PAIR_FREQUENCY
    far += np.abs(zeta_b - zeta_a[:, None]) / PAIR_DAMPING
    return far, (size_a / size_a.max())[:, None] * (-TIE * zeta_b)


def _mac_within(a: np.ndarray, b: np.ndarray, near: np.ndarray) -> np.ndarray:
    """MAC (ma, mb) of the pairs that are near enough; zero or MAC of others.

    Modes come roughly by frequency, so that a block of them sees a part of the others only.
    """
    a2, b2 = squares(a), squares(b)
    if len(a) <= BLOCK:
        return _mac(a, b, a2, b2)
    value = np.zeros(near.shape, dtype=a2.dtype)
    for start in range(0, len(a), BLOCK):
        rows = slice(start, start + BLOCK)
        seen = np.flatnonzero(near[rows].any(axis=0))
        if len(seen):
            columns = slice(seen[0], seen[-1] + 1)
            value[rows, columns] = _mac(a[rows], b[columns], a2[rows], b2[columns])
    return value


def _rival(cost: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Cost of the next best choice of each chosen pair, relative to its own cost (n,).

    It exchanges partners with another pair, and then the costs of both count; or it takes a mode
    that has no partner at all. Infinite where there is no other choice.
    """
    least = 1e-300  # the cost of a pair that did not change is zero but for rounding
    chosen = cost[rows] if len(rows) < cost.shape[0] else cost
    swapped = chosen.take(columns, axis=1)
    own = swapped.diagonal().copy()
    ratio = swapped + swapped.T
    ratio /= np.maximum(own[:, None] + own, least)
    ratio.flat[:: len(own) + 1] = np.inf
    best: np.ndarray = ratio.min(axis=1, initial=np.inf)
    for others in (_without(chosen.T, columns).T, _without(cost, rows).take(columns, axis=1).T):
        if others.size:
            free = np.where(others < UNPAIRED, others, np.inf).min(axis=1)
            best = np.minimum(best, free / np.maximum(own, least))
    return best


def _without(a: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The other rows of an array."""
    if len(rows) == len(a):
        return a[:0]
    kept = np.ones(len(a), dtype=bool)
    kept[rows] = False
    return a[kept]


def _passing(lam_a: np.ndarray, lam_b: np.ndarray) -> np.ndarray:
    """PASSING for each pair whose frequency passes that of another pair, else infinite (n,).

    Whether two modes cross or veer, their shapes tell at close quarters only.
    """
    order_a, order_b = np.abs(lam_a).argsort(), np.abs(lam_b).argsort()
    place = np.empty(len(lam_a), dtype=int)
    place[order_b] = np.arange(len(lam_a))
    ranks = place[order_a]  # ascending but for modes that pass each other
    if not len(ranks):
        return np.zeros(0)
    passing = (np.maximum.accumulate(ranks) > ranks) | (
        np.minimum.accumulate(ranks[::-1])[::-1] < ranks
    )
    found = np.full(len(lam_a), np.inf)
    found[order_a[passing]] = PASSING
    return found


def _lost(far: np.ndarray, partner: np.ndarray) -> np.ndarray:
    """Modes without partner that have another such mode nearby: a step too long, perhaps."""
    alone = (partner < 0).nonzero()[0]
    if not len(alone):
        return alone
    free = _without(far.T, partner[partner >= 0]).T
    return alone[(free[alone] < LOST).any(axis=1)]


def broken(
    lam_a: np.ndarray,
    lam_b: np.ndarray,
    partner: np.ndarray,
    band: tuple[float, float] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Modes that end at a point a, and those that begin at b, where they may be one.

    Parameters
    ----------
    lam_a, lam_b : ndarray (ma,), (mb,) complex
        Roots, rad/s.
    partner : ndarray (ma,) of int
        As of Pairing.
    band : (low, high) or None
        Of the roots, rad/s: none of two modes is in doubt where one may have left the band and the
        other have come in, going by the largest change of a frequency among the pairs.

    Returns
    -------
    ended, began : ndarray (ma,), (mb,) of bool
    """
    ended, began = np.zeros(len(lam_a), dtype=bool), np.ones(len(lam_b), dtype=bool)
    paired = np.flatnonzero(partner >= 0)
    began[partner[paired]] = False
    a, b = np.flatnonzero(partner < 0), np.flatnonzero(began)
    began[:] = False
    if len(a) and len(b):
        near = _distance(lam_a[a], lam_b[b])[0] < LOST
        if band is not None:
            ratio = np.abs(lam_b[partner[paired]]) / np.abs(lam_a[paired])
            reach = EDGE * np.abs(np.log(ratio)).max(initial=0.0)
            near &= ~(_at_edge(lam_a[a], band, reach)[:, None] & _at_edge(lam_b[b], band, reach))
        ended[a], began[b] = near.any(axis=1), near.any(axis=0)
    return ended, began


def _at_edge(lam: np.ndarray, band: tuple[float, float], reach: float) -> np.ndarray:
    """Whether roots are within a relative distance of an edge of the band (m,)."""
    size = np.maximum(np.abs(lam), 1e-300)
    edges = np.log(np.maximum(np.array(band), 1e-300))
    near: np.ndarray = np.abs(np.log(size)[:, None] - edges).min(axis=1) <= reach
    return near
