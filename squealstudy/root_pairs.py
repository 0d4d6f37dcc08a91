"""Roots of two solutions of one problem, paired one to one: the same modes found twice."""

from __future__ import annotations

import numpy as np


def partners(distance: np.ndarray, limit: float = np.inf) -> np.ndarray:
    """For each row of distances (n, m) the column of its partner, -1 for none.

    No two rows have the same partner. The sum of the square roots of the distances is least, those
    beyond the `limit`, which make no pair, counting as that: one mode that is missing must not
    shift its neighbours' partners by one each, as the sum of the distances themselves allows.
    """
    from scipy.optimize import linear_sum_assignment  # slow to import

    found = np.full(len(distance), -1)
    if not distance.size:
        return found
    rows, columns = linear_sum_assignment(np.sqrt(np.minimum(distance, limit)))
    near = distance[rows, columns] < limit
    found[rows[near]] = columns[near]
    return found


def partner_distances(lam: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Distance (m,) of each root to its partner among others, infinite where there is none."""
    distance = np.abs(lam[:, None] - others[None, :])
    partner = partners(distance)
    found = np.full(len(lam), np.inf)
    paired = partner >= 0
    found[paired] = distance[paired, partner[paired]]
    return found
