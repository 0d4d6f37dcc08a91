"""Pairing and labelling of modes one step after the other: what many at a time must equal."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from squealstudy.modes.tracking.labels import _normalised, _steps
from squealstudy.modes.tracking.pairing import (
    CROSSING_MAC,
    DAMPING_WINDOW,
    FREQUENCY_WINDOW,
    LOW_MAC,
    MODES_PER_BLOCK,
    PASSING_TRUST,
    RIVAL_COST_RATIO,
    TIE_COST,
    UNPAIRED_COST,
    Pairing,
    _mac,
    broken,
    squares,
)


def labels_in_order(parents, lams, shapes, x):
    """Labels, MACs and ambiguities by point: pairs and labels one point after the other."""
    parents, rows = levels(parents, [len(lam) for lam in lams])
    step = _steps(_normalised(x), np.asarray(parents))
    pairings, used = {}, 0
    labels = [np.full(len(lam), -1) for lam in lams]
    macs = [np.full(len(lam), np.nan) for lam in lams]
    ambiguous = [np.zeros(len(lam), dtype=bool) for lam in lams]
    for row in rows:
        for i in row:
            if (p := parents[i]) < 0:
                continue
            before = pairings.get(p) if step[i] else None
            earlier = lams[parents[p]] if before is not None else None
            expected = expected_roots(lams[p], step[i], earlier, before)
            pairs = pairings[i] = pair_one(lams[p], shapes[p], lams[i], shapes[i], expected)
            a = np.flatnonzero(pairs.partner >= 0)
            b = pairs.partner[a]
            labels[i][b], macs[i][b] = labels[p][a], pairs.mac[a]
            ambiguous[i][b] |= pairs.ambiguous[a]
            ended, began = broken(lams[p], lams[i], pairs.partner)
            ambiguous[p] |= ended
            ambiguous[i] |= began
        new = [(i, j) for i in row for j in np.flatnonzero(labels[i] < 0)]
        new.sort(key=lambda ij: (lams[ij[0]][ij[1]].imag == 0, abs(lams[ij[0]][ij[1]]), ij))
        for i, j in new:
            used += 1
            labels[i][j] = used
    return labels, macs, ambiguous


def expected_roots(
    lam: np.ndarray, step: float, earlier: np.ndarray | None, before: Pairing | None
) -> np.ndarray | None:
    """Where roots are expected at the next point of a line; None: where they are."""
    if earlier is None or before is None:
        return None
    a = np.flatnonzero(before.partner >= 0)
    b = before.partner[a]
    expected = lam.astype(complex)
    expected[b] += step * (lam[b] - earlier[a])
    return expected


def pair_one(
    lam_a: np.ndarray,
    shapes_a: np.ndarray,
    lam_b: np.ndarray,
    shapes_b: np.ndarray,
    expected: np.ndarray | None = None,
) -> Pairing:
    """`pairing.pair_modes`, of one step and step by step."""
    partner = np.full(len(lam_a), -1)
    macs = np.full(len(lam_a), np.nan)
    trust = np.full(len(lam_a), np.inf)
    if not len(lam_a) or not len(lam_b):
        return Pairing(partner, macs, np.zeros(len(lam_a), dtype=bool), trust)
    far, tie = _distance(lam_a if expected is None else expected, lam_b)
    value = _mac_within(shapes_a, shapes_b, far < UNPAIRED_COST)
    cost = np.minimum(1.0 - value + far + tie, UNPAIRED_COST)
    rows, columns = linear_sum_assignment(cost)
    taken = cost[rows, columns] < UNPAIRED_COST
    rows, columns = rows[taken], columns[taken]
    partner[rows], macs[rows] = columns, value[rows, columns]
    rival = _rival(cost, rows, columns) / RIVAL_COST_RATIO
    trust[rows] = np.minimum(rival, macs[rows] / LOW_MAC)
    ambiguous = np.zeros(len(lam_a), dtype=bool)
    ambiguous[rows] = (rival <= 1.0) | (macs[rows] < LOW_MAC)
    unclear = macs[rows] < CROSSING_MAC
    passing = _passing(lam_a[rows], lam_b[columns])
    trust[rows[unclear]] = np.minimum(trust[rows], passing)[unclear]
    trust[_lost(lam_b, partner)] = 1.0
    return Pairing(partner, macs, ambiguous, trust)


def _distance(expected: np.ndarray, lam_b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of each pair (ma, mb) as a cost, and what decides between equal pairings.

    At an undamped lock-in both pairings cost the same: a term far below all others then sends the
    mode of lower frequency on with the higher growth, so that rounding does not decide.
    """
    size_a, size_b = np.maximum(np.abs(expected), 1e-300), np.maximum(np.abs(lam_b), 1e-300)
    zeta_a, zeta_b = -expected.real / size_a, -lam_b.real / size_b
    far = np.abs(np.log(size_b) - np.log(size_a)[:, None]) / FREQUENCY_WINDOW
    far += np.abs(zeta_b - zeta_a[:, None]) / DAMPING_WINDOW
    return far, (size_a / size_a.max())[:, None] * (-TIE_COST * zeta_b)


def _mac_within(a: np.ndarray, b: np.ndarray, near: np.ndarray) -> np.ndarray:
    """MAC (ma, mb) of the pairs that are near enough; zero or MAC of others.

    Modes come roughly by frequency, so that a block of them sees a part of the others only.
    """
    a2, b2 = squares(a), squares(b)
    if len(a) <= MODES_PER_BLOCK:
        return _mac(a, b, a2, b2)
    value = np.zeros(near.shape, dtype=a2.dtype)
    for start in range(0, len(a), MODES_PER_BLOCK):
        rows = slice(start, start + MODES_PER_BLOCK)
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
            free = np.where(others < UNPAIRED_COST, others, np.inf).min(axis=1)
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
    """PASSING_TRUST for each pair whose frequency passes that of another pair, else infinite (n,).

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
    found[order_a[passing]] = PASSING_TRUST
    return found


def _lost(lam_b: np.ndarray, partner: np.ndarray) -> np.ndarray:
    """Modes without partner where another such mode is: a step too long, perhaps."""
    alone = (partner < 0).nonzero()[0]
    return alone if len(lam_b) > (partner >= 0).sum() else alone[:0]


def levels(parents: list[int], counts: list[int]) -> tuple[list[int], list[list[int]]]:
    """The tree without the points that have no modes, and its points by depth."""
    n = len(parents)
    anchor = [-1] * n  # the point itself or its nearest ancestor with modes
    root = list(range(n))
    attached, depth = [-1] * n, [0] * n
    first: dict[int, int] = {}
    rows: list[list[int]] = []
    for i in _from_the_roots(parents):
        p = int(parents[i])
        root[i] = i if p < 0 else root[p]
        anchor[i] = -1 if p < 0 else anchor[p]
        if not counts[i]:
            continue
        attached[i] = anchor[i] if anchor[i] >= 0 else first.get(root[i], -1)
        first.setdefault(root[i], i)
        anchor[i] = i
        depth[i] = 0 if attached[i] < 0 else depth[attached[i]] + 1
        rows.extend([] for _ in range(depth[i] + 1 - len(rows)))
        rows[depth[i]].append(i)
    return attached, [sorted(row) for row in rows]


def _from_the_roots(parents: list[int]) -> list[int]:
    """Points by depth, then by index."""
    n = len(parents)
    children: list[list[int]] = [[] for _ in range(n)]
    row: list[int] = []
    for i, p in enumerate(parents):
        if not -1 <= p < n:
            raise ValueError(f"point {i} has the parent {p}, expected -1 to {n - 1}")
        (row if p < 0 else children[p]).append(i)
    order: list[int] = []
    while row:
        order += row
        row = sorted(c for i in row for c in children[i])
    if len(order) < n:
        raise ValueError("parents form a cycle")
    return order
