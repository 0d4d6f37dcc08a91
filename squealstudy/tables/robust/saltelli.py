"""The sample of Sobol indices: base points, and the mixed points that belong to each.

Saltelli et al., Computer Physics Communications 181 (2010) 259-270: two independent samples A and
B of n points in d parameters, and d matrices AB_i that are A with column i taken from B. The d + 2
points of one base point stand together, so that a failed point takes its own group with it and
more base points only add rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

ROW_A, ROW_B, MIXED = 0, 1, 2  # places in a group; the mixed points follow in parameter order


class Groups(NamedTuple):
    """Values of the sample by role.

    Attributes
    ----------
    a, b : ndarray (n,)
    ab : ndarray (d, n)
    """

    a: np.ndarray
    b: np.ndarray
    ab: np.ndarray


def saltelli_rows(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """All points (n (d + 2), d) of the samples A and B (n, d), group after group."""
    n, d = A.shape
    rows = np.empty((n, d + MIXED, d))
    rows[:, ROW_A], rows[:, ROW_B], rows[:, MIXED:] = A, B, A[:, None, :]
    i = np.arange(d)
    rows[:, MIXED + i, i] = B
    return rows.reshape(-1, d)


def is_saltelli(x: np.ndarray) -> bool:
    """Whether points (m, d) are such a sample in its order."""
    m, d = x.shape
    if not m or m % (d + MIXED):
        return False
    rows = x.reshape(-1, d + MIXED, d)
    return bool(np.array_equal(saltelli_rows(rows[:, ROW_A], rows[:, ROW_B]), x))


def base_rows(n_points: int, d: int) -> np.ndarray:
    """Which of the points (n_points,) belong to A or B: these alone are independent."""
    return np.arange(n_points) % (d + MIXED) < MIXED


def grouped(values: np.ndarray, d: int) -> tuple[Groups, int]:
    """Values (n (d + 2),) by role, without the groups in which one is not finite; their number."""
    rows = values.reshape(-1, d + MIXED)
    whole = np.isfinite(rows).all(axis=1)
    kept = rows[whole]
    return Groups(kept[:, ROW_A], kept[:, ROW_B], kept[:, MIXED:].T), int((~whole).sum())
