"""All roots of a sparse quadratic eigenproblem below a modulus, whatever its matrices are like.

Nothing is assumed but real entries: M, C and K may be unsymmetric, M and K singular.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.factor import SINGULAR, Factor, factorise
from squealstudy.linalg.sparse_qep import DENSE_LIMIT, LowRankSum, smallest_roots

FIRST_ROOTS = 60  # asked for where nothing is known
SHIFT = 0.02  # of the band's top: where K itself is singular
LARGEST_RESIDUAL = 1e-8  # of a pair that is accepted
LARGEST_DENSE = 2000  # degrees of freedom that LAPACK takes where most of the roots are wanted


@dataclass(frozen=True)
class BandRoots:
    """Roots of a band.

    Attributes
    ----------
    lam : ndarray (m,) complex
        Imaginary part non-negative, ascending in modulus, rad/s.
    psi : ndarray (n, m) complex
        Right vectors of unit 2-norm.
    n_below : int
        Roots up to the top of the band, conjugates and those below the band counted.
    """

    lam: np.ndarray
    psi: np.ndarray
    n_below: int


class PivotingFactor:
    """SuperLU with partial pivoting: slower than `factorise`, for matrices far from definite."""

    def __init__(self, A: sp.spmatrix) -> None:
        try:
            self._lu = spla.splu(A.tocsc())
        except RuntimeError as error:  # "Factor is exactly singular"
            raise ConvergenceError(SINGULAR, f"a stiffness matrix is singular ({error})") from error

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solution of A x = b, real."""
        x: np.ndarray = self._lu.solve(b)
        return x


def roots_in_band(
    M: sp.csr_matrix,
    C: sp.csr_matrix,
    K: sp.csr_matrix,
    band: tuple[float, float],
    first: int = FIRST_ROOTS,
    shift: float = 0.0,
) -> BandRoots:
    """Roots with band[0] <= |lambda| <= band[1] of lambda^2 M + lambda C + K.

    Roots next to a real shift are found by one real factorisation there, more of them until one
    lies beyond the band. Where K is singular, or diagonal pivots spoil the roots, it is done again
    about a positive shift, then with partial pivoting.

    Parameters
    ----------
    M, C, K : csr_matrix (n, n)
    band : (low, high)
        rad/s.
    first : int
        Roots asked for at first, conjugates counted: a guess that costs time only.
    shift : float
        rad/s.

    Raises
    ------
    ConvergenceError
        Where no attempt gives roots whose residual is below LARGEST_RESIDUAL.
    """
    failure = ConvergenceError("not_converged", "no roots with a small residual")
    for sigma, pivoting in _attempts(shift, SHIFT * band[1]):
        try:
            lam, psi = _roots_about(M, C, K, band[1], first, sigma, pivoting)
        except ConvergenceError as error:
            failure = error
            continue
        kept = np.abs(lam) >= band[0]
        found = BandRoots(lam[kept], psi[:, kept], len(lam) + int((lam.imag > 0).sum()))
        residual = pair_residuals(M, C, K, found.lam, found.psi)
        if residual.max(initial=0.0) <= LARGEST_RESIDUAL:
            return found
    raise failure


def pair_residuals(
    M: sp.csr_matrix, C: sp.csr_matrix, K: sp.csr_matrix, lam: np.ndarray, psi: np.ndarray
) -> np.ndarray:
    """Residual |Q(lambda) psi| of each pair over |lambda^2 M psi| + |lambda C psi| + |K psi|."""
    parts = (M @ (psi * lam**2), C @ (psi * lam), K @ psi)
    size = sum(np.linalg.norm(part, axis=0) for part in parts)
    residual: np.ndarray = np.linalg.norm(sum(parts), axis=0) / np.maximum(size, 1e-300)
    return residual


def _attempts(shift: float, other: float) -> list[tuple[float, bool]]:
    """Shifts and whether to pivot, in order."""
    return [(shift, False), (shift or other, False), (shift or other, True)]


def _roots_about(
    M: sp.csr_matrix,
    C: sp.csr_matrix,
    K: sp.csr_matrix,
    limit: float,
    first: int,
    sigma: float,
    pivoting: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """All roots up to `limit` through the problem in lambda - sigma."""
    n = M.shape[0]
    C_s, K_s = C + 2 * sigma * M, K + sigma * C + sigma**2 * M
    reach = limit + abs(sigma)
    if n <= DENSE_LIMIT:
        return _up_to(limit, *_dense_roots(M, C_s, K_s, limit), sigma)
    factor: Factor = PivotingFactor(K_s) if pivoting else factorise(K_s)
    count = first
    while 2 * count <= n or n > LARGEST_DENSE:
        count = min(count, 2 * n - 2)
        mu, psi = smallest_roots(M, LowRankSum(C_s), LowRankSum(K_s), count, limit / 2, factor)
        farthest = np.abs(mu).max()
        if farthest > reach or count == 2 * n - 2:
            return _up_to(limit, mu, psi, sigma)
        count = max(int(count * min(reach / farthest, 3.0) ** 1.2), count) + 20
    return _up_to(limit, *_dense_roots(M, C_s, K_s, limit), sigma)


def _up_to(
    limit: float, mu: np.ndarray, psi: np.ndarray, sigma: float
) -> tuple[np.ndarray, np.ndarray]:
    """Roots sigma + mu up to the limit, one of each pair, ascending; vectors of unit norm."""
    lam = sigma + mu
    kept = np.flatnonzero((lam.imag >= 0) & (np.abs(lam) <= limit))
    kept = kept[np.argsort(np.abs(lam[kept]))]
    return lam[kept], psi[:, kept] / np.linalg.norm(psi[:, kept], axis=0)


def _dense_roots(
    M: sp.csr_matrix, C: sp.csr_matrix, K: sp.csr_matrix, limit: float
) -> tuple[np.ndarray, np.ndarray]:
    """All roots by LAPACK: of the companion form, or of its inverse where M is singular."""
    n, one, zero = M.shape[0], np.eye(M.shape[0]), np.zeros(M.shape)
    dense = [A.toarray() for A in (M, C, K)]
    scaled = (dense[0] * limit, dense[1], dense[2] / limit)  # time in units of 1/limit
    if np.linalg.matrix_rank(scaled[0]) == n:
        lower = -np.linalg.solve(scaled[0], np.hstack([scaled[2], scaled[1]]))
        mu, z = np.linalg.eig(np.vstack([np.hstack([zero, one]), lower]))
        return mu * limit, z[:n]
    try:
        lower = -np.linalg.solve(scaled[2], np.hstack([scaled[0], scaled[1]]))
    except np.linalg.LinAlgError as error:
        raise ConvergenceError(SINGULAR, "a stiffness matrix is singular") from error
    theta, z = np.linalg.eig(np.vstack([np.hstack([zero, one]), lower]))
    finite = np.abs(theta) > np.abs(theta).max() * np.finfo(float).eps * n
    return limit / theta[finite], z[n:, finite]
