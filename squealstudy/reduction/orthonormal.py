"""Mass-orthonormal bases of exact component modes and of nearly dependent trial vectors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

GRAM_RESOLUTION = 1e-6  # a smaller relative singular value is round-off of a Gram matrix
# smallest singular value kept of traces of assembly modes, over the largest; with 1e-6 their
# frequencies err by 3e-8
MODE_TOLERANCE = 1e-7


def complete_basis(
    M: sp.spmatrix,
    K: sp.spmatrix,
    phi: np.ndarray,
    blocks: Sequence[tuple[np.ndarray, float]],
) -> tuple[np.ndarray, np.ndarray]:
    """The basis [phi | rest] of one component, M-orthonormal, diagonal in K (THEORY.md eq. (25)).

    Vectors of a block are not scaled one by one: a small trace carries little of the motion and may
    be dropped. The span of the basis is projected out twice, the Gram matrix is truncated by its
    eigenvalues, and vectors are orthonormalised by Cholesky factors twice (THEORY.md eq. (27)).

    Parameters
    ----------
    M, K : sparse (n, n)
        Component mass and stiffness.
    phi : ndarray (n, m)
        Free-free modes, M-orthonormal.
    blocks : sequence of (ndarray (n, t), float)
        Displacements of the component in assembly shapes, the most important block first, each
        with the smallest singular value to keep, relative to the largest of the block.

    Returns
    -------
    T : ndarray (n, m + r)
        phi first, unchanged.
    k : ndarray (m + r,)
        Diagonal of T^T K T, (rad/s)^2.
    """
    basis = phi
    for vectors, tolerance in blocks:
        basis = np.hstack([basis, new_directions(M, basis, vectors, tolerance)])
    k_phi = np.einsum("ij,ij->j", phi, K @ phi)
    rest = basis[:, phi.shape[1] :]
    if not rest.shape[1]:
        return phi, k_phi
    k_rest, y = la.eigh(rest.T @ (K @ rest))
    return np.ascontiguousarray(np.hstack([phi, rest @ y])), np.concatenate([k_phi, k_rest])


def new_directions(
    M: sp.spmatrix, basis: np.ndarray, vectors: np.ndarray, tolerance: float
) -> np.ndarray:
    """M-orthonormal directions (n, k) of `vectors` (n, t) outside the span of `basis` (n, r)."""
    M_basis = M @ basis

    def project_out(X: np.ndarray) -> np.ndarray:
        return X - basis @ (M_basis.T @ X)

    if not vectors.shape[1]:
        return vectors
    largest = la.eigvalsh(_gram(M, vectors))[-1]  # before projecting: the block's own size
    X = project_out(project_out(vectors))
    values, modes = la.eigh(_gram(M, X))
    is_new = values > tolerance**2 * largest
    if largest <= 0 or not is_new.any():
        return vectors[:, :0]
    X = project_out(project_out(X @ (modes[:, is_new] / np.sqrt(values[is_new]))))
    for _ in range(2):
        L = la.cholesky(_gram(M, X), lower=True)
        X = la.solve_triangular(L, X.T, lower=True).T
    return X


def _gram(M: sp.spmatrix, X: np.ndarray) -> np.ndarray:
    G = X.T @ (M @ X)
    half: np.ndarray = (G + G.T) / 2
    return half


def outside(
    M: sp.spmatrix | np.ndarray,
    K: sp.spmatrix | np.ndarray,
    block: np.ndarray,
    displacements: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Part of a component's `displacements` (n, t) outside the span of `block` (n, r).

    Returns directions (n, k) that are orthogonal in K, without those that are round-off, and twice
    the elastic energy (k,) of each. `block` is M-orthonormal.
    """
    M_block = M @ block
    largest = la.norm(displacements, axis=0).max(initial=0.0)
    X = displacements - block @ (M_block.T @ displacements)
    X = X - block @ (M_block.T @ X)
    energy, y = la.eigh(X.T @ (K @ X))
    X = X @ y
    is_outside = la.norm(X, axis=0) > GRAM_RESOLUTION * largest
    return X[:, is_outside], energy[is_outside]
