"""Checks of the matrices and vectors of components and interfaces, which raise ModelError."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.linalg.overflow import LEAST_MASS, MAX_SQUARABLE_ENTRY, largest_entry, too_large

SKEW_SHARE = 1e-12  # asymmetry over the largest entry of a symmetric matrix


def is_skew(A: np.ndarray | sp.spmatrix) -> bool:
    """Whether a matrix has a skew-symmetric part beyond round-off, as where something turns."""
    skew = abs(A - A.T)
    return bool(skew.max() > SKEW_SHARE * max(abs(A).max(), 1e-300)) if A.size else False


def check_skew(matrix_name: str, A: sp.spmatrix, n: int) -> None:
    """Raise ModelError unless `A` is (n, n), finite and the opposite of its transpose."""
    if A.shape != (n, n):
        raise ModelError(f"{matrix_name} has shape {A.shape}, expected {(n, n)}")
    check_size(matrix_name, A)
    both = abs(A + A.T)
    if both.nnz and both.max() > SKEW_SHARE * max(abs(A).max(), 1e-300):
        raise ModelError(f"{matrix_name} is not skew-symmetric")


def check_symmetric(matrix_name: str, A: sp.spmatrix, n: int) -> None:
    """Raise ModelError unless `A` is (n, n), finite and symmetric to round-off."""
    if A.shape != (n, n):
        raise ModelError(f"{matrix_name} has shape {A.shape}, expected {(n, n)}")
    check_size(matrix_name, A)
    skew = abs(A - A.T)
    if skew.nnz and skew.max() > SKEW_SHARE * max(abs(A).max(), 1e-300):
        raise ModelError(f"{matrix_name} is not symmetric")


def check_size(matrix_name: str, A: np.ndarray | sp.spmatrix) -> None:
    """Raise ModelError where an entry is not finite, or too large to be squared."""
    if not (size := largest_entry(A)) <= MAX_SQUARABLE_ENTRY:
        raise ModelError(too_large(matrix_name, size))


def check_masses(matrix_name: str, M: sp.spmatrix) -> None:
    """Raise ModelError unless the diagonal of a mass matrix is positive and not tiny."""
    smallest = M.diagonal().min()
    if smallest <= 0:
        raise ModelError(f"{matrix_name} is not positive definite")
    if smallest < LEAST_MASS:
        raise ModelError(
            f"{matrix_name} has a diagonal entry of {smallest:.0e}: expected at least "
            f"{LEAST_MASS:g}"
        )
