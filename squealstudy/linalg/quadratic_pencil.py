"""A quadratic pencil of real matrices, and its roots nearest to a complex shift."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from squealstudy.errors import ConvergenceError
from squealstudy.faults import raise_if_memory
from squealstudy.linalg.companion import Eigenpairs, right_pairs
from squealstudy.linalg.factor import SINGULAR, FullLU, is_full
from squealstudy.linalg.sparse_qep import LowRankSum
from squealstudy.root_pairs import partners

Matrix = Any  # ndarray, scipy sparse matrix or LowRankSum
# smallest diagonal pivot of SuperLU over the largest entry of its column, as Q is indefinite
LU_PIVOT_THRESHOLD = 0.1
DENSE_LIMIT = 40  # coordinates up to which all roots are computed by LAPACK, not by Arnoldi
MIN_ARNOLDI_VECTORS = 20  # smallest number of vectors in an Arnoldi space
# relative tolerance of 1 / (lambda - sigma), and so of the distance lambda - sigma
ARNOLDI_TOLERANCE = 1e-12
# relative distance below which a root from right vectors and one from left vectors are the same
LEFT_RIGHT_ROOT_REL_DISTANCE = 1e-4
# steps of inverse iteration for the one nearest root, before Arnoldi is used instead
MAX_INVERSE_ITERATIONS = 8
Solve = Callable[[np.ndarray], np.ndarray]


def product(A: Matrix, X: np.ndarray) -> np.ndarray:
    """A X of a vector (n,) or vectors (n, m), without a complex copy of a real dense A."""
    if sp.issparse(A) or np.iscomplexobj(A) or not np.iscomplexobj(X):
        return np.asarray(A @ X)
    columns = X.reshape(len(X), math.prod(X.shape[1:]))
    real = A @ np.ascontiguousarray(columns).view(float)
    return np.ascontiguousarray(real).view(complex).reshape(len(real), *X.shape[1:])


def squared(X: np.ndarray) -> np.ndarray:
    """|X|^2 entry by entry, computed without a square root."""
    return np.asarray(X.real**2 + X.imag**2)


class ShiftedFactor(Protocol):
    """Solves with Q(sigma) and with its conjugate transpose."""

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solution of Q(sigma) x = b."""
        ...

    def solve_adjoint(self, b: np.ndarray) -> np.ndarray:
        """Solution of Q(sigma)^H x = b."""
        ...


@dataclass(frozen=True)
class QuadraticPencil:
    """Q(lambda) = lambda^2 M + lambda C + K, all (n, n) and real.

    M is symmetric; every matrix is dense, sparse, or sparse plus a symmetric low-rank part.
    """

    M: Matrix
    C: Matrix
    K: Matrix

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return int(self.M.shape[0])

    def apply(self, lam: complex, x: np.ndarray) -> np.ndarray:
        """Q(lambda) x for one root and vector."""
        inertia, damping = lam**2 * product(self.M, x), lam * product(self.C, x)
        product_sum: np.ndarray = inertia + damping + product(self.K, x)
        return product_sum

    def slope(self, lam: complex, x: np.ndarray) -> np.ndarray:
        """Q'(lambda) x = (2 lambda M + C) x."""
        product_sum: np.ndarray = 2 * lam * product(self.M, x) + product(self.C, x)
        return product_sum

    def adjoint(self) -> QuadraticPencil:
        """The transposed pencil: left vectors are its right vectors at conj(lambda)."""
        return QuadraticPencil(self.M, self.C.T, self.K.T)

    def factor(self, sigma: complex) -> ShiftedFactor:
        """Factorise Q(sigma). Raises ConvergenceError (``singular``) at a root."""
        if isinstance(self.K, np.ndarray):
            Q = sigma * self.C + self.K
            if sp.issparse(self.M):
                Q += sigma**2 * self.M.toarray()
            else:
                Q += sigma**2 * self.M
            return DenseShiftedFactor(Q)
        return SparseShiftedFactor(self, sigma)


class DenseShiftedFactor:
    """LU of a dense Q(sigma)."""

    def __init__(self, Q: np.ndarray) -> None:
        self._lu = la.lu_factor(Q, check_finite=False)
        if not np.abs(np.diag(self._lu[0])).min() > 0:
            raise ConvergenceError(SINGULAR, "the shift of an inverse iteration is a root")

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solution of Q(sigma) x = b."""
        return la.lu_solve(self._lu, b, check_finite=False)

    def solve_adjoint(self, b: np.ndarray) -> np.ndarray:
        """Solution of Q(sigma)^H x = b."""
        return la.lu_solve(self._lu, b, trans=2, check_finite=False)


class SparseShiftedFactor:
    """Complex SuperLU of the sparse part of Q(sigma); low-rank parts by Woodbury's identity.

    Where the sparse part is full, LAPACK factorises all of Q(sigma) instead.
    """

    def __init__(self, pencil: QuadraticPencil, sigma: complex) -> None:
        Q, self._U, d = _split(pencil, sigma)
        self._lu: spla.SuperLU | FullLU
        try:
            if is_full(Q):
                self._lu, d = FullLU(Q.toarray() + (self._U * d) @ self._U.T), d[:0]
            else:
                A = Q.tocsc()
                self._lu = spla.splu(
                    A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=LU_PIVOT_THRESHOLD
                )
        except RuntimeError as error:  # "Factor is exactly singular"
            raise_if_memory(error)
            raise ConvergenceError(SINGULAR, f"a shifted matrix is singular ({error})") from error
        self._X = self._lu.solve(self._U) if len(d) else self._U
        self._core = np.zeros((0, 0), dtype=complex)
        if len(d):
            self._Y = self._lu.solve(self._U, trans="H")
            core = np.eye(len(d)) + d[:, None] * (self._U.T @ self._X)
            self._core = la.solve(core, np.diag(d))

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solution of Q(sigma) x = b."""
        x = self._lu.solve(np.asarray(b, dtype=complex))
        if len(self._core):
            x = x - self._X @ (self._core @ (self._U.T @ x))
        return x

    def solve_adjoint(self, b: np.ndarray) -> np.ndarray:
        """Solution of Q(sigma)^H x = b."""
        x = self._lu.solve(np.asarray(b, dtype=complex), trans="H")
        if len(self._core):
            x = x - self._Y @ (self._core.conj().T @ (self._U.T @ x))
        return x


def _split(pencil: QuadraticPencil, sigma: complex) -> tuple[sp.spmatrix, np.ndarray, np.ndarray]:
    """Sparse part of Q(sigma), and U (n, m) and d (m,) of its low-rank part U diag(d) U^T."""
    Q: sp.spmatrix = sp.csr_matrix(pencil.M.shape, dtype=complex)
    columns, weights = [], []
    for A, factor in ((pencil.M, sigma**2), (pencil.C, sigma), (pencil.K, 1.0)):
        if isinstance(A, LowRankSum):
            columns.append(A.U.astype(complex))
            weights.append(factor * A.d)
        Q = Q + factor * (A.sparse if isinstance(A, LowRankSum) else A)
    if not columns:
        return Q, np.zeros((pencil.n, 0), dtype=complex), np.zeros(0, dtype=complex)
    return Q, np.hstack(columns), np.concatenate(weights).astype(complex)


def nearest_roots(
    pencil: QuadraticPencil,
    factor: ShiftedFactor,
    sigma: complex,
    count: int,
    start: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The `count` roots nearest `sigma`, by Arnoldi on the shifted and inverted companion form.

    That form maps z = [u; v] to [a; b] with Q(sigma) a = -(M (v + sigma u) + C u) and
    b = u + sigma a. Its eigenvectors are [x; lambda x], its eigenvalues 1 / (lambda - sigma).

    Parameters
    ----------
    pencil : QuadraticPencil
    factor : ShiftedFactor
        Factor of Q(sigma).
    sigma : complex
        The shift, rad/s.
    count : int
        Number of roots.
    start : ndarray (n,) or None
        Guess of a right vector; None for a fixed random one.

    Returns
    -------
    lam : ndarray (k,) complex
        Roots, rad/s, nearest first; k may be less than `count` in a small model.
    X : ndarray (n, k) complex
        Right vectors of unit 2-norm.

    Raises
    ------
    ConvergenceError
        ``not_converged`` where ARPACK stops.
    """
    return _nearest(pencil, factor.solve, sigma, count, start)


def nearest_two_sided(
    pencil: QuadraticPencil, factor: ShiftedFactor, sigma: complex, count: int
) -> Eigenpairs:
    """Nearest roots with right and left vectors (y^H Q(lambda) = 0) of unit norm, paired."""
    lam, X = nearest_roots(pencil, factor, sigma, count)
    mu, Y = nearest_left(pencil, factor, sigma, None, count)
    # both searches give the same roots but for round-off; of two equally near ones at the end of
    # the count, each may give another
    distance = np.abs(lam[:, None] - mu) / np.abs(lam)[:, None]
    order = partners(distance, LEFT_RIGHT_ROOT_REL_DISTANCE)
    is_paired = np.flatnonzero(order >= 0)
    return Eigenpairs(lam[is_paired], X[:, is_paired], Y[:, order[is_paired]])


def nearest_left(
    pencil: QuadraticPencil,
    factor: ShiftedFactor,
    sigma: complex,
    start: np.ndarray | None,
    count: int = 1,
) -> tuple[np.ndarray, np.ndarray]:
    """Nearest roots with left vectors, y^H Q(lambda) = 0, without right vectors."""
    mu, Y = _nearest(pencil.adjoint(), factor.solve_adjoint, np.conj(sigma), count, start)
    return mu.conj(), Y


def _nearest(
    pencil: QuadraticPencil, solve: Solve, sigma: complex, count: int, start: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Roots nearest to a shift and their vectors, by LAPACK, inverse iteration or Arnoldi."""
    n = pencil.n
    if n <= DENSE_LIMIT:
        return _dense(pencil, sigma, count)

    size = abs(sigma)  # scales time, so that both halves of [x; lambda x] have one size

    def invert(z: np.ndarray) -> np.ndarray:
        u, v = z[:n], z[n:] * size
        a = -solve(product(pencil.M, v + sigma * u) + product(pencil.C, u))
        return np.concatenate([a, (u + sigma * a) / size])

    x = np.random.default_rng(0).standard_normal(n) if start is None else start
    operator = spla.LinearOperator((2 * n, 2 * n), matvec=invert, dtype=complex)
    v0 = np.concatenate([x, sigma / size * x]).astype(complex)
    if count == 1 and (eigenpair := _by_power_iteration(invert, v0)) is not None:
        return _nearest_first(sigma + 1 / eigenpair[0], eigenpair[1][:n], sigma, count)
    ncv = min(2 * n, max(2 * count + 4, MIN_ARNOLDI_VECTORS))
    try:
        theta, z = spla.eigs(operator, k=count, which="LM", v0=v0, ncv=ncv, tol=ARNOLDI_TOLERANCE)
    except spla.ArpackNoConvergence as error:
        raise ConvergenceError("not_converged", f"roots near a shift: {error}") from error
    return _nearest_first(sigma + 1 / theta, z[:n], sigma, count)


def _by_power_iteration(invert: Solve, start: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Largest eigenvalue (1,) of `invert` and its vector (m, 1) by power iteration, or None."""
    z = start / np.linalg.norm(start)
    for _ in range(MAX_INVERSE_ITERATIONS):
        image = invert(z)
        theta = np.vdot(z, image)
        if np.linalg.norm(image - theta * z) <= ARNOLDI_TOLERANCE * np.abs(theta):
            return np.array([theta]), z[:, None]
        z = image / np.linalg.norm(image)
    return None


def _dense(pencil: QuadraticPencil, sigma: complex, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Roots nearest to a shift and their vectors, by LAPACK for all roots of a small pencil."""
    identity = np.eye(pencil.n)
    M, C, K = (np.asarray(A @ identity) for A in (pencil.M, pencil.C, pencil.K))
    return _nearest_first(*right_pairs(C, K, M), sigma, count)


def _nearest_first(
    lam: np.ndarray, X: np.ndarray, sigma: complex, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """The first `count` roots by distance from the shift, with vectors of unit norm."""
    order = np.argsort(np.abs(lam - sigma))[:count]
    X = X[:, order]
    return lam[order], X / np.linalg.norm(X, axis=0)
