"""All roots of a dense quadratic problem with right and left vectors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg as la

from squealstudy.linalg.dense_qep import roots_inside

WORST_PRODUCTS = 1e9  # condition of them: beyond, next to an exceptional point, LAPACK's are taken


class Eigenpairs(NamedTuple):
    """Roots and vectors of lambda^2 I + lambda C + K.

    Attributes
    ----------
    lam : ndarray (m,) complex
        rad/s.
    X : ndarray (n, m) complex
        Right vectors.
    Y : ndarray (n, m) complex
        Left vectors, y^H Q(lam) = 0, scaled so that y^H (2 lam + C) x = 1.
    """

    lam: np.ndarray
    X: np.ndarray
    Y: np.ndarray

    def take(self, index: np.ndarray) -> Eigenpairs:
        """The pairs chosen by an index or a mask."""
        return Eigenpairs(self.lam[index], self.X[:, index], self.Y[:, index])


def companion(C: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, float]:
    """First companion matrix (2n, 2n) in time scaled by s, and s: its roots times s are lam."""
    n = len(K)
    scale = float(np.sqrt(np.linalg.norm(K) / np.sqrt(n))) or 1.0
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:] = np.eye(n)
    A[n:, :n] = K / -(scale**2)
    A[n:, n:] = C / -scale
    return A, scale


def all_roots(C: np.ndarray, K: np.ndarray) -> np.ndarray:
    """All 2n roots [rad/s]; LAPACK's balanced `geev` without vectors."""
    A, scale = companion(C, K)
    lam: np.ndarray = la.eigvals(A, overwrite_a=True, check_finite=False) * scale
    return lam


def all_pairs(C: np.ndarray, K: np.ndarray) -> Eigenpairs:
    """All 2n roots with both vectors."""
    n = len(K)
    A, scale = companion(C, K)
    lam, left, right = la.eig(A, left=True, right=True, overwrite_a=True, check_finite=False)
    lam = lam * scale
    X = right[:n] / np.linalg.norm(right[:n], axis=0)
    Y = left[n:]
    return Eigenpairs(lam, X, Y / derivative_products(C, lam, X, Y).conj())


def pairs_inside(C: np.ndarray, K: np.ndarray, radius: float) -> Eigenpairs:
    """All pairs with |lam| <= radius [rad/s], and perhaps others.

    Left vectors are right ones of the transposed problem, told apart by their products with the
    right ones, G_ij = y_i^H (lam_i + lam_j + C) x_j, which vanish for different roots.
    """
    right, left = roots_inside(C, K, radius), roots_inside(C.T, K.T, radius)
    if right is None or left is None or len(right[0]) != len(left[0]):
        return all_pairs(C, K)
    (lam, X), (mu, Z) = right, left
    G = (Z.T @ X) * (mu[:, None] + lam) + Z.T @ (C @ X)
    if len(lam) and not np.linalg.cond(G / np.abs(lam)) < WORST_PRODUCTS:
        return all_pairs(C, K)
    return Eigenpairs(lam, X, np.linalg.solve(G, Z.T).conj().T)


def derivative_products(C: np.ndarray, lam: np.ndarray, X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """y^H (2 lam + C) x of every pair (m,): zero at an exceptional point, where it is bounded."""
    d = np.einsum("ij,ij->j", Y.conj(), 2.0 * lam * X + C @ X)
    tiny = 1e-14 * np.linalg.norm(X, axis=0) * np.linalg.norm(Y, axis=0)
    return np.where(np.abs(d) > tiny, d, tiny + 1e-300)
