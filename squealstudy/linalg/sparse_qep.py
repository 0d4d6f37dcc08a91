"""Sparse quadratic eigenproblem (lambda^2 M + lambda C + K) psi = 0: roots nearest to zero.

It is solved in companion form for theta = 1/lambda, with time scaled (THEORY.md eq. (31)). That
needs one real factorisation of K, and real arithmetic makes roots exact conjugate pairs.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import pairs_up_to
from squealstudy.linalg.factor import Factor, RefinedFactor, factorise
from squealstudy.linalg.real_modes import (
    FIRST_TEST_SIZE,
    LANCZOS_BLOCK_SIZE,
    REL_RESIDUAL_FLOOR,
    BlockKrylov,
)
from squealstudy.root_pairs import one_of_each_pair

DENSE_LIMIT = 100  # most degrees of freedom for which LAPACK solves
TEST_GROWTH_DIVISOR = 10  # the space grows by 1/10 of its size between two tests of convergence
MAX_KRYLOV_SHARE = 0.4  # with more Krylov vectors, over states, LAPACK is faster
CONVERGED_RESIDUAL = 1e-11  # largest residual of a converged root, over |theta|


class LowRankSum:
    """The matrix A + U diag(d) U^T (n, n) for products; A is sparse, U (n, m), d (m,)."""

    def __init__(self, A: sp.spmatrix, U: np.ndarray | None = None, d: np.ndarray | None = None):
        self.sparse = A.tocsr()
        self.U = np.zeros((A.shape[0], 0)) if U is None else U
        self.d = np.zeros(0) if d is None else d

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """Product with x, (n,) or (n, k)."""
        y = self.sparse @ x
        if len(self.d):
            y = y + self.U @ ((self.d * (self.U.T @ x).T).T)
        return y

    @property
    def T(self) -> LowRankSum:
        """The transpose."""
        return LowRankSum(self.sparse.T, self.U, self.d)


class WoodburyFactor:
    """Solves with a sparse matrix plus U diag(d) U^T, refined unless told otherwise.

    Parameters
    ----------
    A : LowRankSum (n, n)
    refined : bool
        If False, solutions are not refined where a trial shows that they are as exact without.
    factor : RefinedFactor or None
        Factor of the sparse part, if computed before.
    """

    def __init__(
        self, A: LowRankSum, refined: bool = True, factor: RefinedFactor | None = None
    ) -> None:
        self._factor = factorise(A.sparse) if factor is None else factor
        self._once = self._factor.solve if refined else self._factor.lean()
        self._A = A
        if len(A.d):
            self._X = self._once(A.U)
            core = np.eye(len(A.d)) + A.d[:, None] * (A.U.T @ self._X)
            self._core = np.linalg.solve(core, np.diag(A.d))

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solution of A x = b."""
        x = self._once(b)
        if len(self._A.d):
            x = x - self._X @ (self._core @ (self._A.U.T @ x))
        return x


def roots_below(
    M: sp.spmatrix, C: LowRankSum, K: LowRankSum, limit: float, factor: Factor | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """All roots with |lambda| <= limit [rad/s].

    A Krylov space of the companion form (THEORY.md eq. (31)) grows by blocks of vectors, which are
    solved together, until all these roots and the next one have converged, as far as round-off of
    the root nearest to zero allows.

    Parameters
    ----------
    M, C, K, factor
        As for `smallest_roots`.

    Returns
    -------
    lam : ndarray (m,) complex
        Roots with a non-negative imaginary part, ascending in modulus, rad/s.
    psi : ndarray (n, m) complex
        Right eigenvectors of unit 2-norm.
    """
    n, scale = M.shape[0], limit / 2
    size = FIRST_TEST_SIZE if n > DENSE_LIMIT else 2 * n
    if size <= MAX_KRYLOV_SHARE * 2 * n:
        solver: Factor = WoodburyFactor(K, refined=False) if factor is None else factor
        space = BlockKrylov(_companion_inverse(M, C, solver, scale), 2 * n, None)
    while size <= MAX_KRYLOV_SHARE * 2 * n:
        space.grow(size)
        theta, y = la.eig(space.projected)
        order = np.argsort(-np.abs(theta))
        inside = int((np.abs(theta) >= scale / limit).sum())
        if inside < space.size:
            theta, y = theta[order[: inside + 1]], y[:, order[: inside + 1]]
            allowed = np.maximum(
                CONVERGED_RESIDUAL * np.abs(theta), REL_RESIDUAL_FLOOR * np.abs(theta[0])
            )
            if (space.left_out(y) <= allowed).all():
                lam, y = scale / theta[:inside], y[:, :inside]
                upper_half, lower = lam.imag >= 0, space.vectors[n:]
                y = y[:, upper_half]
                return one_of_each_pair(lam[upper_half], lower @ y.real + 1j * (lower @ y.imag))
        size = space.size + max(2 * LANCZOS_BLOCK_SIZE, space.size // TEST_GROWTH_DIVISOR)
    return _dense_roots(M, C, K, 2 * n, limit)


def _companion_inverse(
    M: sp.spmatrix, C: LowRankSum, factor: Factor, scale: float
) -> Callable[[np.ndarray], np.ndarray]:
    """The map of [x; y] to theta [x; y] of THEORY.md eq. (31), for vectors and blocks."""
    n = M.shape[0]

    def apply(z: np.ndarray) -> np.ndarray:
        # theta x = y,  K (theta y) = -(s C y + s^2 M x), in time scaled by s
        x, y = z[:n], z[n:]
        return np.concatenate([y, -factor.solve(scale * (C @ y) + scale**2 * (M @ x))])

    return apply


def smallest_roots(
    M: sp.spmatrix,
    C: LowRankSum,
    K: LowRankSum,
    n_roots: int,
    scale: float,
    factor: Factor | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The `n_roots` roots of smallest modulus, conjugates included.

    Parameters
    ----------
    M : sparse (n, n)
    C, K : LowRankSum (n, n)
        K nonsingular, not necessarily symmetric.
    n_roots : int
        Number of roots; a conjugate pair counts as two.
    scale : float
        Typical |lambda| [rad/s], by which the companion form is balanced.
    factor : Factor or None
        Factor of K, if computed before; only models above DENSE_LIMIT need one.

    Returns
    -------
    lam : ndarray (m,) complex
        Roots with a non-negative imaginary part, ascending in modulus, rad/s.
    psi : ndarray (n, m) complex
        Right eigenvectors of unit 2-norm.

    Raises
    ------
    ConvergenceError
        ``not_converged`` where ARPACK does not converge.
    """
    n = M.shape[0]
    if n <= DENSE_LIMIT:
        return _dense_roots(M, C, K, n_roots)
    solver: Factor = WoodburyFactor(K, refined=False) if factor is None else factor
    apply = _companion_inverse(M, C, solver, scale)
    operator = spla.LinearOperator((2 * n, 2 * n), matvec=apply, dtype=float)
    v0 = np.random.default_rng(0).standard_normal(2 * n)
    try:
        theta, z = spla.eigs(
            operator, k=n_roots, which="LM", v0=v0, ncv=min(2 * n, int(2.2 * n_roots) + 20)
        )
    except spla.ArpackNoConvergence as error:
        raise ConvergenceError("not_converged", f"full-order complex modes: {error}") from error
    return one_of_each_pair(scale / theta, z[n:])


def _dense_roots(
    M: sp.spmatrix, C: LowRankSum, K: LowRankSum, n_roots: int, limit: float = np.inf
) -> tuple[np.ndarray, np.ndarray]:
    """The `n_roots` smallest roots up to a limit [rad/s], by LAPACK."""
    identity = np.eye(M.shape[0])
    lam, psi = pairs_up_to(C @ identity, K @ identity, limit, M.toarray())
    first = np.argsort(np.abs(lam))[:n_roots]
    return one_of_each_pair(lam[first], psi[:, first], (0.0, limit))
