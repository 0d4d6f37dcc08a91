"""Dense quadratic eigenproblems: the exact rung of reanalysis, behind a small interface."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import scipy.linalg as la

from squealstudy.linalg.dense_qep import roots_inside


class QuadraticSolver(Protocol):
    """Roots and right vectors of lambda^2 I + lambda C + K."""

    def __call__(
        self, C: np.ndarray, K: np.ndarray, band: tuple[float, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Roots [rad/s] with band[0] <= |lambda| <= band[1], and vectors (n, m)."""
        ...


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
    if found is None:
        return companion_roots(C, K, band)
    return _in_band(*found, band)


def companion_roots(
    C: np.ndarray, K: np.ndarray, band: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """The same out of all 2n roots, by the companion form in scaled time and LAPACK's `geev`."""
    n = len(K)
    scale = np.sqrt(np.linalg.norm(K) / np.sqrt(n)) or 1.0
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:] = np.eye(n)
    A[n:, :n] = K / -(scale**2)
    A[n:, n:] = C / -scale
    lam, z = la.eig(A, overwrite_a=True, check_finite=False)
    return _in_band(lam * scale, z[:n], band)


def _in_band(
    lam: np.ndarray, psi: np.ndarray, band: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """One of each pair, ascending in modulus, and unit vectors."""
    size = np.abs(lam)
    kept = np.flatnonzero((lam.imag >= 0) & (size >= band[0]) & (size <= band[1]))
    kept = kept[np.argsort(size[kept])]
    return lam[kept], psi[:, kept] / np.linalg.norm(psi[:, kept], axis=0)


def backward_error(C: np.ndarray, K: np.ndarray, lam: np.ndarray, psi: np.ndarray) -> np.ndarray:
    """Normwise backward error of each pair: |Q(lambda) psi| / (|lambda|^2 + |lambda||C| + |K|)."""
    R = psi * lam**2 + (C @ psi) * lam + K @ psi
    size = np.abs(lam)
    norm = size**2 + size * np.linalg.norm(C) + np.linalg.norm(K)
    error: np.ndarray = np.linalg.norm(R, axis=0) / (norm * np.linalg.norm(psi, axis=0))
    return error
