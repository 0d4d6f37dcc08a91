"""Cholesky factors F^T F of sparse symmetric positive definite matrices, out of SuperLU."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.factor import SINGULAR, symmetric_lu

LEAST_PIVOT = (
    1e-12  # of the diagonal entry it came from: no more than the round-off of a singular one
)
REFINEMENTS = 1


class SparseCholesky:
    """F with F^T F = A, by its products.

    SuperLU with pivots on the diagonal of a symmetric matrix gives P A P^T = L D L^T, so that
    F = D^(1/2) L^T P. F^-1 z is A^-1 F^T z, which needs no triangular solve of its own.

    Parameters
    ----------
    A : sparse (n, n)
        Symmetric.

    Raises
    ------
    ConvergenceError
        ``singular``, where A is not positive definite.
    """

    def __init__(self, A: sp.spmatrix) -> None:
        self.A = A.tocsr()
        try:
            self._lu = symmetric_lu(A)
        except RuntimeError as error:
            raise _indefinite() from error
        order = self._lu.perm_c
        pivots = self._lu.U.diagonal()
        diagonal = np.empty(len(order))
        diagonal[order] = self.A.diagonal()
        if (order != self._lu.perm_r).any() or (pivots <= LEAST_PIVOT * np.abs(diagonal)).any():
            raise _indefinite()
        self._order = order
        self._back = np.argsort(order)
        self._lower = (self._lu.L @ sp.diags(np.sqrt(pivots))).tocsr()

    def root(self, X: np.ndarray) -> np.ndarray:
        """F X, real (n, m)."""
        product: np.ndarray = self._lower.T @ X[self._back]
        return product

    def from_root(self, Z: np.ndarray) -> np.ndarray:
        """F^-1 Z, real (n, m)."""
        return self.solve((self._lower @ Z)[self._order])

    def solve(self, b: np.ndarray) -> np.ndarray:
        """A^-1 b, real or complex, with a step of iterative refinement."""
        if np.iscomplexobj(b):
            return self.solve(b.real) + 1j * self.solve(b.imag)
        b = np.ascontiguousarray(b)
        x = self._lu.solve(b)
        for _ in range(REFINEMENTS):
            x = x + self._lu.solve(b - self.A @ x)
        return x


def _indefinite() -> ConvergenceError:
    return ConvergenceError(SINGULAR, "a stiffness matrix is not positive definite")
