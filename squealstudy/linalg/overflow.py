"""Refuses numbers that are too large or too small to compute with their squares and sums."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ConvergenceError

# largest entry in any unit: squares, and sums of 1e8 squares, stay finite
MAX_SQUARABLE_ENTRY = 1e150
LEAST_MASS = 1e-150  # kg, kg m2 or 1: smallest mass to divide by
OVERFLOW = "overflow"  # status of a design point whose matrices have such entries
LIMITS = f"expected finite numbers of at most {MAX_SQUARABLE_ENTRY:g}"


def largest_entry(A: Any) -> float:
    """Largest modulus in a number, array or sparse matrix; inf where an entry is NaN or inf."""
    values = np.asarray(A.data if sp.issparse(A) else A)
    if not values.size:
        return 0.0
    largest = max(float(values.max()), -float(values.min()))
    return largest if np.isfinite(largest) else np.inf


def expect_computable(parts: Iterable[tuple[str, Any]]) -> None:
    """Raise ConvergenceError ``overflow`` where one of the named arrays has entries too large."""
    for name, A in parts:
        if not (size := largest_entry(A)) <= MAX_SQUARABLE_ENTRY:
            raise ConvergenceError(OVERFLOW, too_large(name, size))


def too_large(matrix_name: str, size: float) -> str:
    """The sentence about a matrix with an entry beyond MAX_SQUARABLE_ENTRY."""
    size_text = "that are not finite" if size == np.inf else f"of {size:.0e}"
    return f"{matrix_name} has entries {size_text}: {LIMITS}"
