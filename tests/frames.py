"""A frame of beams with six freedoms a node, by its own few lines, and superelements of it."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

E, NU, RHO = 2.1e5, 0.3, 7.8e-9  # N, mm, t
SIDE = 6.0  # mm, of a square section
NODES = np.array(
    [[0, 0, 0], [10, 2, 0], [20, 3, 1], [30, 3, 3], [35, 10, 5], [36, 20, 9], [36, 30, 9.0]]
)
ENDS = (0, 6)  # boundary nodes


def beam(a, b):
    """K and M (12, 12) of Euler and Bernoulli's beam of a square section between two places."""
    L = np.linalg.norm(b - a)
    A, bend, J = SIDE**2, SIDE**4 / 12, 0.1406 * SIDE**4
    G = E / 2 / (1 + NU)
    K, M = np.zeros((12, 12)), np.zeros((12, 12))
    for at, k, m in (((0, 6), E * A / L, RHO * A * L), ((3, 9), G * J / L, RHO * 2 * bend * L)):
        K[np.ix_(at, at)] += k * np.array([[1, -1], [-1, 1]])
        M[np.ix_(at, at)] += m / 6 * np.array([[2, 1], [1, 2]])
    k = np.array(
        [[12, 6 * L, -12, 6 * L], [0, 4 * L**2, -6 * L, 2 * L**2], [0, 0, 12, -6 * L],
         [0, 0, 0, 4 * L**2]]
    )  # fmt: skip
    m = np.array(
        [[156, 22 * L, 54, -13 * L], [0, 4 * L**2, 13 * L, -3 * L**2], [0, 0, 156, -22 * L],
         [0, 0, 0, 4 * L**2]]
    )  # fmt: skip
    k, m = (A + np.triu(A, 1).T for A in (k, m))
    for at, sign in (((1, 5, 7, 11), 1), ((2, 4, 8, 10), -1)):
        S = np.diag([1, sign, 1, sign])
        K[np.ix_(at, at)] += E * bend / L**3 * S @ k @ S
        M[np.ix_(at, at)] += RHO * A * L / 420 * S @ m @ S
    x = (b - a) / L
    y = np.cross([0.1, 0.2, 1.0], x)
    y /= np.linalg.norm(y)
    T = np.kron(np.eye(4), np.array([x, y, np.cross(x, y)]))
    return T.T @ K @ T, T.T @ M @ T


def frame():
    """K and M (6 n, 6 n): three displacements and three turns of each node."""
    K, M = (np.zeros((6 * len(NODES),) * 2) for _ in "KM")
    for a in range(len(NODES) - 1):
        at = np.arange(6 * a, 6 * a + 12)
        for whole, part in zip((K, M), beam(NODES[a], NODES[a + 1]), strict=True):
            whole[np.ix_(at, at)] += part
    return K, M


def craig_bampton(n_modes):
    """K, M and all freedoms by those of the ends and modal coordinates."""
    K, M = frame()
    b = np.concatenate([np.arange(6 * end, 6 * end + 6) for end in ENDS])
    i = np.setdiff1d(np.arange(len(K)), b)
    _, phi = la.eigh(K[np.ix_(i, i)], M[np.ix_(i, i)])
    R = np.zeros((len(K), len(b) + min(n_modes, len(i))))
    R[b, np.arange(len(b))] = 1.0
    R[np.ix_(i, np.arange(len(b)))] = -la.solve(K[np.ix_(i, i)], K[np.ix_(i, b)])
    R[np.ix_(i, np.arange(len(b), R.shape[1]))] = phi[:, :n_modes]
    return *((A + A.T) / 2 for A in (R.T @ K @ R, R.T @ M @ R)), R


def numbers():
    """Numbers of the nodes, from 101."""
    return np.arange(len(NODES)) + 101


def names(n_modal):
    """node.direction of the rows of a superelement, and its modal coordinates."""
    rows = [f"{numbers()[end]}.{d}" for end in ENDS for d in range(1, 7)]
    return rows + ["modal"] * n_modal
