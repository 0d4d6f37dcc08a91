"""Roots of a dense quadratic eigenproblem in a band: by Arnoldi's method where that is certain."""

from __future__ import annotations

import numpy as np

from squealstudy.linalg.companion import Eigenpairs, all_pairs, one_of_each_pair, right_pairs
from squealstudy.linalg.dense_qep import roots_inside

WORST_PRODUCTS = 1e9  # condition of them: beyond, next to an exceptional point, LAPACK's are taken


def dense_roots(
    C: np.ndarray, K: np.ndarray, band: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """All roots in a band: by `roots_inside`, or by `companion_roots` where that cannot be certain.

    Parameters
    ----------
    C, K : ndarray (n, n)
        Damping and stiffness; the mass is the identity.
    band : (low, high)
        Bounds of |lambda|, rad/s.

    Returns
    -------
    lam : ndarray (m,) complex
        One of each conjugate pair (imaginary part >= 0), ascending in |lambda|; real roots are
        listed each.
    psi : ndarray (n, m) complex
        Right vectors of unit 2-norm.
    """
    found = roots_inside(C, K, band[1])
    return companion_roots(C, K, band) if found is None else one_of_each_pair(*found, band)


def companion_roots(
    C: np.ndarray, K: np.ndarray, band: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """The same out of all 2n roots."""
    return one_of_each_pair(*right_pairs(C, K), band)


def pairs_inside(C: np.ndarray, K: np.ndarray, radius: float) -> Eigenpairs:
    """All pairs with |lam| <= radius [rad/s], and perhaps others.

    Left vectors are right ones of the transposed problem, told apart by their products with the
    right ones, G_ij = y_i^H (lam_i + lam_j + C) x_j, which vanish for different roots
    (THEORY.md eq. (33)).
    """
    right, left = roots_inside(C, K, radius), roots_inside(C.T, K.T, radius)
    if right is None or left is None or len(right[0]) != len(left[0]):
        return all_pairs(C, K)
    (lam, X), (mu, Z) = right, left
    G = (Z.T @ X) * (mu[:, None] + lam) + Z.T @ (C @ X)
    if len(lam) and not np.linalg.cond(G / np.abs(lam)) < WORST_PRODUCTS:
        return all_pairs(C, K)
    return Eigenpairs(lam, X, np.linalg.solve(G, Z.T).conj().T)


def backward_error(C: np.ndarray, K: np.ndarray, lam: np.ndarray, psi: np.ndarray) -> np.ndarray:
    """Normwise backward error of each pair: |Q(lambda) psi| / (|lambda|^2 + |lambda||C| + |K|)."""
    R = psi * lam**2 + (C @ psi) * lam + K @ psi
    size = np.abs(lam)
    norm = size**2 + size * np.linalg.norm(C) + np.linalg.norm(K)
    error: np.ndarray = np.linalg.norm(R, axis=0) / (norm * np.linalg.norm(psi, axis=0))
    return error
