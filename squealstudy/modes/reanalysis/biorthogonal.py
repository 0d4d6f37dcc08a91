"""Left vectors of a sparse quadratic problem matched to its right ones, y^H Q'(lambda) x = 1."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import Eigenpairs
from squealstudy.root_pairs import partners

APART = 1e-6  # relative distance of roots that two solves tell apart: the same root within it
CLUSTER = 1e-7  # relative distance below which roots share their vectors
LARGEST_PRODUCT = 1e-4  # of products that vanish for exact vectors of distinct roots


def biorthogonal(
    M: sp.csr_matrix,
    C: sp.csr_matrix,
    lam: np.ndarray,
    X: np.ndarray,
    lam_left: np.ndarray,
    Y: np.ndarray,
) -> Eigenpairs:
    """Pairs of right roots and vectors with the left ones among those given.

    In the state space, y_i^H ((lam_i + lam_j) M + C) x_j vanishes for distinct roots. Vectors of
    close roots are any basis of their subspace: there the left ones are turned against the right.

    Parameters
    ----------
    M, C : csr_matrix (n, n)
    lam, X : ndarray (m,), (n, m) complex
        Right roots and vectors.
    lam_left, Y : ndarray (l,), (n, l) complex
        Roots and y of y^H Q = 0; more than m do no harm.

    Raises
    ------
    ConvergenceError
        ``not_converged``, where a right root has no left vector or vectors are not biorthogonal.
    """
    Y = Y[:, _partners(lam, lam_left)]
    products = _products(M, C, lam, X, Y)
    for members in _clusters(lam):
        if len(members) > 1:
            block = products[np.ix_(members, members)]
            Y[:, members] = Y[:, members] @ _inverse(block).conj().T
    products = _products(M, C, lam, X, Y)
    scale = np.diag(products)
    if not scale.all():
        raise _unmatched("a left vector is orthogonal to its right one")
    _check(M, lam, X, Y, products)
    return Eigenpairs(lam, X, Y / scale.conj())


def _partners(lam: np.ndarray, lam_left: np.ndarray) -> np.ndarray:
    """Index of the left root of each right one, each used once."""
    if len(lam_left) < len(lam):
        raise _unmatched(f"{len(lam)} right and {len(lam_left)} left roots")
    distance = np.abs(lam[:, None] - lam_left[None, :])
    found = partners(distance)
    if (distance[np.arange(len(lam)), found] > APART * np.abs(lam)).any():
        raise _unmatched("a right root has no left one")
    return found


def _clusters(lam: np.ndarray) -> list[np.ndarray]:
    """Indices of roots that are close to each other, in groups."""
    if not len(lam):
        return []
    size = np.maximum(np.abs(lam)[:, None], np.abs(lam)[None, :])
    close = np.abs(lam[:, None] - lam[None, :]) <= CLUSTER * size
    count, label = connected_components(sp.csr_matrix(close), directed=False)
    return [np.flatnonzero(label == k) for k in range(count)]


def _products(
    M: sp.csr_matrix, C: sp.csr_matrix, lam: np.ndarray, X: np.ndarray, Y: np.ndarray
) -> np.ndarray:
    left = Y.conj().T
    total: np.ndarray = (left @ (M @ X)) * (lam[:, None] + lam[None, :]) + left @ (C @ X)
    return total


def _inverse(block: np.ndarray) -> np.ndarray:
    try:
        inverse: np.ndarray = np.linalg.inv(block)
    except np.linalg.LinAlgError as error:
        raise _unmatched("roots that coincide have no full set of vectors") from error
    return inverse


def _check(
    M: sp.csr_matrix, lam: np.ndarray, X: np.ndarray, Y: np.ndarray, products: np.ndarray
) -> None:
    """Products of distinct roots must vanish beside the sizes of both vectors."""
    right = np.sqrt(np.abs(np.einsum("ij,ij->j", X.conj(), M @ X))) * np.abs(lam)
    left = np.sqrt(np.abs(np.einsum("ij,ij->j", Y.conj(), M @ Y)))
    size = left[:, None] * right[None, :] + left[:, None] * right[:, None]
    off = np.abs(products - np.diag(np.diag(products)))
    if (off > LARGEST_PRODUCT * np.maximum(size, 1e-300)).any():
        raise _unmatched("left and right vectors are not biorthogonal")


def _unmatched(why: str) -> ConvergenceError:
    return ConvergenceError("not_converged", f"left vectors: {why}")
