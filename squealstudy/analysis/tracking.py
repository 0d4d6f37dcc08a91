"""Which complex mode of one design point goes on as which mode of the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from squealstudy.analysis.tracking_tree import levels

FREQUENCY_WINDOW = 0.2  # relative change of |lambda| from which on two modes are never paired
DAMPING_WINDOW = 0.5  # change of zeta that weighs as much as the whole frequency window
UNPAIRED = 1.0  # cost of leaving a mode without partner
RIVAL = 1.5  # another pairing is nearly as good below this multiple of the chosen one's cost
LOW_MAC = 0.5
TIE = 1e-3  # what decides between two equal pairings, see `_cost`
STRAIGHT = 0.999  # cosine above which two steps lie on one line
EXTRAPOLATED = 0.5  # share of the last change that is expected to go on: all of it overshoots where
# frequencies come together and lock in, none of it lags where they cross
LONGEST_STEP = 3.0  # extrapolated at most, in steps of the parent


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
    """

    partner: np.ndarray
    mac: np.ndarray
    ambiguous: np.ndarray


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
    """

    labels: list[np.ndarray]
    macs: list[np.ndarray]
    ambiguous: list[np.ndarray]


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
    product = np.abs(a.conj() @ b.T) ** 2
    size = np.outer(_squares(a), _squares(b))
    value: np.ndarray = np.clip(product / np.maximum(size, np.finfo(size.dtype).tiny), 0.0, 1.0)
    return value


def _squares(a: np.ndarray) -> np.ndarray:
    total: np.ndarray = (a.real**2 + a.imag**2).sum(axis=1)
    return total


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
    partner = np.full(len(lam_a), -1)
    macs = np.full(len(lam_a), np.nan)
    ambiguous = np.zeros(len(lam_a), dtype=bool)
    if not len(lam_a) or not len(lam_b):
        return Pairing(partner, macs, ambiguous)
    value = mac(shapes_a, shapes_b)
    cost = _cost(value, lam_a if expected is None else expected, lam_b)
    rows, columns = linear_sum_assignment(cost)
    taken = cost[rows, columns] < UNPAIRED
    rows, columns = rows[taken], columns[taken]
    partner[rows], macs[rows] = columns, value[rows, columns]
    ambiguous[rows] = _rivalled(cost, rows, columns) | (macs[rows] < LOW_MAC)
    return Pairing(partner, macs, ambiguous)


def _cost(value: np.ndarray, expected: np.ndarray, lam_b: np.ndarray) -> np.ndarray:
    """Cost of each pair (ma, mb), at most UNPAIRED.

    At an undamped lock-in both pairings cost the same: a term far below all others then sends the
    mode of lower frequency on with the higher growth, so that rounding does not decide.
    """
    size_a, size_b = np.abs(expected), np.abs(lam_b)
    df = np.abs(np.log(np.maximum(size_b, 1e-300) / np.maximum(size_a, 1e-300)[:, None]))
    zeta_a, zeta_b = (-x.real / np.maximum(np.abs(x), 1e-300) for x in (expected, lam_b))
    tie = np.outer(size_a / max(size_a.max(), 1e-300), -zeta_b)
    dz = np.abs(zeta_b - zeta_a[:, None])
    cost = 1.0 - value + df / FREQUENCY_WINDOW + dz / DAMPING_WINDOW + TIE * tie
    capped: np.ndarray = np.minimum(cost, UNPAIRED)
    return capped


def _rivalled(cost: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Of each chosen pair: does exchanging its partner cost little more? (n,) of bool."""
    own = cost[rows, columns]
    swapped = cost[np.ix_(rows, columns)]
    swapped = swapped + swapped.T
    np.fill_diagonal(swapped, np.inf)
    rivalled: np.ndarray = (swapped <= RIVAL * (own[:, None] + own)).any(axis=1)
    free_rows = np.delete(np.arange(cost.shape[0]), rows)
    free_columns = np.delete(np.arange(cost.shape[1]), columns)
    for others in (cost[np.ix_(rows, free_columns)], cost[np.ix_(free_rows, columns)].T):
        near = (others <= RIVAL * own[:, None]) & (others < UNPAIRED)
        rivalled = rivalled | near.any(axis=1)
    return rivalled


def track(
    parents: Sequence[int],
    lams: Sequence[np.ndarray],
    shapes: Sequence[np.ndarray],
    coordinates: np.ndarray | None = None,
) -> Tracks:
    """Label the modes of all points along a tree: a child inherits the labels of its parent.

    Children of a point without modes attach to its nearest ancestor with modes; where there is
    none, to the first of them. The labels depend on the tree only.

    Parameters
    ----------
    parents : sequence of int (n,)
        Parent of each point, -1 for a root.
    lams, shapes : sequences of ndarray (m,), (m, k)
        Roots [rad/s] and shapes of each point, empty for a failed one.
    coordinates : ndarray (n, p) or None
        Design points; with them roots are extrapolated along straight lines of the tree.

    Raises
    ------
    ValueError
        Where `parents` is no tree over the points.
    """
    n = len(parents)
    if len(lams) != n or len(shapes) != n:
        raise ValueError(f"{n} parents, {len(lams)} sets of roots, {len(shapes)} sets of shapes")
    attached, rows = levels(parents, [len(lam) for lam in lams])
    x = None if coordinates is None else _normalised(np.asarray(coordinates, dtype=float))
    labels = [np.full(len(lam), -1) for lam in lams]
    macs = [np.full(len(lam), np.nan) for lam in lams]
    ambiguous = [np.zeros(len(lam), dtype=bool) for lam in lams]
    before = [np.full(len(lam), np.nan, dtype=complex) for lam in lams]  # the root in the parent
    used = 0
    for level in rows:
        for i in level:
            p = attached[i]
            if p < 0:
                continue
            step = 0.0 if x is None or attached[p] < 0 else _step(x, attached[p], p, i)
            change = np.where(np.isnan(before[p]), 0.0, step * (lams[p] - before[p]))
            pairs = pair_modes(lams[p], shapes[p], lams[i], shapes[i], lams[p] + change)
            a = np.flatnonzero(pairs.partner >= 0)
            b = pairs.partner[a]
            labels[i][b], before[i][b] = labels[p][a], lams[p][a]
            macs[i][b], ambiguous[i][b] = pairs.mac[a], pairs.ambiguous[a]
        used += _number_newcomers(level, lams, labels, used)
    return Tracks(labels, macs, ambiguous)


def _normalised(x: np.ndarray) -> np.ndarray:
    span = np.ptp(x, axis=0)
    scaled: np.ndarray = x / np.where(span > 0, span, 1.0)
    return scaled


def _step(x: np.ndarray, g: int, p: int, i: int) -> float:
    """How much of the change from g to p is expected from p to i; none off their line."""
    u, v = x[p] - x[g], x[i] - x[p]
    size_u, size_v = float(np.linalg.norm(u)), float(np.linalg.norm(v))
    if not size_u or not u @ v > STRAIGHT * size_u * size_v:
        return 0.0
    return EXTRAPOLATED * min(size_v / size_u, LONGEST_STEP)


def _number_newcomers(
    level: Sequence[int], lams: Sequence[np.ndarray], labels: Sequence[np.ndarray], used: int
) -> int:
    """Number what has no label yet, oscillating modes first, by frequency. Returns how many."""
    new = [(i, j) for i in level for j in np.flatnonzero(labels[i] < 0)]
    new.sort(key=lambda ij: (lams[ij[0]][ij[1]].imag == 0, abs(lams[ij[0]][ij[1]]), ij))
    for number, (i, j) in enumerate(new, start=used + 1):
        labels[i][j] = number
    return len(new)
