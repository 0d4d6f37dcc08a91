"""All roots of a dense quadratic eigenproblem, by its companion form and LAPACK.

The companion matrix is formed in scaled time, so that C and K have one size, for LAPACK's balanced
`geev` (THEORY.md eq. (30)); `stacked.roots` forms those of a batch.
"""

from __future__ import annotations

import contextlib
from typing import NamedTuple

import numpy as np
import scipy.linalg as la

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.factor import SINGULAR
from squealstudy.linalg.overflow import OVERFLOW

SHIFT_RATIO = 0.013  # shift over the limit, used where roots far below the limit spoil the others
# modulus over the limit from which roots must be resolved beside the largest root's round-off
MIN_RESOLVED_RATIO = 1e-6
SINGULAR_STIFFNESS = "a stiffness matrix is singular, or nearly so beside its largest entries"


class Eigenpairs(NamedTuple):
    """Roots and vectors of lambda^2 I + lambda C + K.

    Attributes
    ----------
    lam : ndarray (m,) complex
        Roots, rad/s.
    X : ndarray (n, m) complex
        Right vectors.
    Y : ndarray (n, m) complex
        Left vectors, y^H Q(lam) = 0, scaled so that y^H (2 lam + C) x = 1.
    """

    lam: np.ndarray
    X: np.ndarray
    Y: np.ndarray

    def take(self, index: np.ndarray) -> Eigenpairs:
        """The pairs selected by an index or a mask."""
        return Eigenpairs(self.lam[index], self.X[:, index], self.Y[:, index])


def companion(C: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, float]:
    """First companion matrix (2n, 2n) in scaled time, and s [rad/s]: lam is s times its roots.

    Raises
    ------
    ConvergenceError
        ``overflow``: the matrix is not finite, and LAPACK would return arbitrary roots.
    """
    n = len(K)
    with np.errstate(over="ignore", invalid="ignore"):
        scale = float(np.sqrt(np.linalg.norm(K) / np.sqrt(n))) or 1.0
        A = np.zeros((2 * n, 2 * n))
        A[:n, n:] = np.eye(n)
        A[n:, :n] = K / -(scale**2)
        A[n:, n:] = C / -scale
    if not (np.isfinite(scale) and np.isfinite(A).all()):
        raise ConvergenceError(OVERFLOW, "the roots of the model are too large or small to compute")
    return A, scale


def all_roots(C: np.ndarray, K: np.ndarray) -> np.ndarray:
    """All 2n roots [rad/s] of lambda^2 I + lambda C + K, without vectors."""
    A, scale = companion(C, K)
    lam: np.ndarray = la.eigvals(A, overwrite_a=True, check_finite=False) * scale
    return lam


def right_pairs(
    C: np.ndarray, K: np.ndarray, M: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """All roots (2n,) [rad/s] and right vectors (n, 2n) of lambda^2 M + lambda C + K.

    Parameters
    ----------
    C, K : ndarray (n, n)
    M : ndarray (n, n) or None
        Nonsingular; None for the identity.

    Raises
    ------
    LinAlgError
        M is singular.
    """
    n = len(K)
    if M is not None:
        C, K = np.hsplit(np.linalg.solve(M, np.hstack([C, K])), 2)
    A, scale = companion(C, K)
    lam, z = la.eig(A, overwrite_a=True, check_finite=False)
    return lam * scale, np.where(
        np.abs(lam) > 1.0, z[n:], z[:n]
    )  # the larger half of a state is accurate


def drowned(lam: np.ndarray, limit: float) -> bool:
    """Whether round-off of the largest of all 2n roots may hide those of modulus `limit`."""
    lost_accuracy = len(lam) / 2 * np.finfo(float).eps / MIN_RESOLVED_RATIO
    return bool(np.abs(lam).max(initial=0.0) * lost_accuracy >= limit)


def pairs_up_to(
    C: np.ndarray, K: np.ndarray, limit: float, M: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Roots and right vectors that are accurate up to `limit` [rad/s], and perhaps others.

    They are those of `right_pairs`, or, where round-off of large roots would hide them, of the
    inverse form: about zero, or about a positive shift where much smaller roots hide them in turn.

    Raises
    ------
    ConvergenceError
        ``singular``: none of these forms is accurate.
    """
    lam, psi = right_pairs(C, K, M)
    if not drowned(lam, limit):
        return lam, psi
    with contextlib.suppress(ConvergenceError):
        return inverse_pairs(C, K, limit, M)
    sigma, mass = SHIFT_RATIO * limit, np.eye(len(K)) if M is None else M
    mu, psi = inverse_pairs(C + 2 * sigma * mass, K + sigma * C + sigma**2 * mass, limit, M)
    return sigma + mu, psi


def inverse_pairs(
    C: np.ndarray, K: np.ndarray, limit: float, M: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Finite roots [rad/s] and right vectors from those of limit / lambda, limit in rad/s.

    M may be singular; stiff springs do not make roots of the size of the limit less accurate.

    Raises
    ------
    ConvergenceError
        ``singular``: K has no inverse, or roots far below the limit hide the others.
    """
    if not regular(K):
        raise ConvergenceError(SINGULAR, SINGULAR_STIFFNESS)
    n, mass = len(K), np.eye(len(K)) if M is None else M
    theta, psi = right_pairs(C, mass * limit, K / limit)
    if drowned(theta, 1.0):
        raise ConvergenceError(SINGULAR, SINGULAR_STIFFNESS)
    finite = np.abs(theta) > np.abs(theta).max() * np.finfo(float).eps * n
    return limit / theta[finite], psi[:, finite]


def regular(A: np.ndarray) -> bool:
    """Whether a matrix (n, n) has full rank once its rows and columns are scaled to one size."""
    for axis in (1, 0):
        size = np.abs(A).max(axis=axis, keepdims=True)
        if not size.all():
            return False
        A = A / size
    return bool(np.linalg.matrix_rank(A) == len(A))


def all_pairs(C: np.ndarray, K: np.ndarray) -> Eigenpairs:
    """All 2n roots of lambda^2 I + lambda C + K with both vectors."""
    n = len(K)
    A, scale = companion(C, K)
    lam, left_states, right = la.eig(A, left=True, right=True, overwrite_a=True, check_finite=False)
    lam = lam * scale
    X = right[:n] / np.linalg.norm(right[:n], axis=0)
    Y = left_states[n:]
    return Eigenpairs(lam, X, Y / derivative_products(C, lam, X, Y).conj())


def derivative_products(C: np.ndarray, lam: np.ndarray, X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """y^H (2 lam + C) x of each pair (m,); tiny, not zero, at an exceptional point."""
    d = np.einsum("ij,ij->j", Y.conj(), 2.0 * lam * X + C @ X)
    tiny = 1e-14 * np.linalg.norm(X, axis=0) * np.linalg.norm(Y, axis=0)
    return np.where(np.abs(d) > tiny, d, tiny + 1e-300)
