"""A quadratic pencil of real matrices, its adjoint, and its factorisation at a complex shift."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.factor import SINGULAR
from squealstudy.linalg.sparse_qep import LowRankSum

Matrix = Any  # ndarray, scipy sparse matrix or LowRankSum
PIVOTS = 0.1  # least size of a diagonal pivot beside its column: Q is indefinite near a root


class ShiftedFactor(Protocol):
    """Solves with Q(sigma) and with its conjugate transpose."""

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solution of Q(sigma) x = b, b (n,) or (n, k)."""
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
        """Q(lambda) x."""
        product: np.ndarray = lam**2 * (self.M @ x) + lam * (self.C @ x) + self.K @ x
        return product

    def slope(self, lam: complex, x: np.ndarray) -> np.ndarray:
        """Q'(lambda) x = (2 lambda M + C) x."""
        product: np.ndarray = 2 * lam * (self.M @ x) + self.C @ x
        return product

    def adjoint(self) -> QuadraticPencil:
        """The transposed pencil: left vectors are its right vectors at conj(lambda)."""
        return QuadraticPencil(self.M, transposed(self.C), transposed(self.K))

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


def transposed(A: Matrix) -> Matrix:
    """A^T; a low-rank part is symmetric."""
    return LowRankSum(A.sparse.T, A.U, A.d) if isinstance(A, LowRankSum) else A.T


class DenseShiftedFactor:
    """LU of a dense Q(sigma)."""

    def __init__(self, Q: np.ndarray) -> None:
        self._lu = la.lu_factor(Q, check_finite=False)
        if not np.abs(np.diag(self._lu[0])).min() > 0:
            raise ConvergenceError(SINGULAR, "the shift of an inverse iteration is a root")

    def solve(self, b: np.ndarray) -> np.ndarray:
        """See `ShiftedFactor`."""
        return la.lu_solve(self._lu, b, check_finite=False)

    def solve_adjoint(self, b: np.ndarray) -> np.ndarray:
        """See `ShiftedFactor`."""
        return la.lu_solve(self._lu, b, trans=2, check_finite=False)


class SparseShiftedFactor:
    """Complex SuperLU of the sparse part of Q(sigma); low-rank parts by Woodbury's identity."""

    def __init__(self, pencil: QuadraticPencil, sigma: complex) -> None:
        Q, self._U, d = _split(pencil, sigma)
        try:
            self._lu = spla.splu(Q.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=PIVOTS)
        except RuntimeError as error:  # "Factor is exactly singular"
            raise ConvergenceError(SINGULAR, f"a shifted matrix is singular ({error})") from error
        self._X = self._lu.solve(self._U) if len(d) else self._U
        self._core = np.zeros((0, 0), dtype=complex)
        if len(d):
            self._Y = self._lu.solve(self._U, trans="H")
            core = np.eye(len(d)) + d[:, None] * (self._U.T @ self._X)
            self._core = la.solve(core, np.diag(d))

    def solve(self, b: np.ndarray) -> np.ndarray:
        """See `ShiftedFactor`."""
        x = self._lu.solve(np.asarray(b, dtype=complex))
        if len(self._core):
            x = x - self._X @ (self._core @ (self._U.T @ x))
        return x

    def solve_adjoint(self, b: np.ndarray) -> np.ndarray:
        """See `ShiftedFactor`."""
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
