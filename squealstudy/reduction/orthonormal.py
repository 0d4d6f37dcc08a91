"""Robust mass-orthonormalisation of near-dependent trial vectors after exact component modes."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

SINGULAR_TOLERANCE = 1e-6  # of the traces' singular values in the mass norm


def complete_basis(
    M: sp.spmatrix,
    K: sp.spmatrix,
    phi: np.ndarray,
    traces: np.ndarray,
    tolerance: float = SINGULAR_TOLERANCE,
) -> tuple[np.ndarray, np.ndarray]:
    """The basis [phi | rest] of one component (eq. 3), M-orthonormal and diagonal in K.

    Traces are scaled together, not one by one: a small trace carries little of the motion and
    may be dropped. Modes are projected out twice, the Gram matrix is truncated by its
    eigenvalues, Cholesky is done twice (theory.md section 4).

    Parameters
    ----------
    M, K : sparse (n, n)
        Component mass and stiffness.
    phi : ndarray (n, m)
        Free-free modes, M-orthonormal.
    traces : ndarray (n, t)
        Displacements of the component in assembly shapes.
    tolerance : float
        Smallest singular value kept, relative to the largest.

    Returns
    -------
    T : ndarray (n, m + r)
        phi first, unchanged.
    k : ndarray (m + r,)
        Diagonal of T^T K T, (rad/s)^2.
    """
    k_phi = np.einsum("ij,ij->j", phi, K @ phi)
    M_phi = M @ phi

    def project_out(X: np.ndarray) -> np.ndarray:
        return X - phi @ (M_phi.T @ X)

    X = project_out(project_out(traces))
    gram = X.T @ (M @ X)
    values, vectors = la.eigh((gram + gram.T) / 2)
    kept = values > tolerance**2 * max(values[-1], 0.0)
    if not len(values) or values[-1] <= 0 or not kept.any():
        return phi, k_phi
    X = project_out(X @ (vectors[:, kept] / np.sqrt(values[kept])))
    for _ in range(2):
        gram = X.T @ (M @ X)
        L = la.cholesky((gram + gram.T) / 2, lower=True)
        X = la.solve_triangular(L, X.T, lower=True).T
    k_rest, y = la.eigh(X.T @ (K @ X))
    return np.ascontiguousarray(np.hstack([phi, X @ y])), np.concatenate([k_phi, k_rest])
