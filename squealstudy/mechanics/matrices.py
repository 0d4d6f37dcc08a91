"""A model made of given matrices: M(p), C(p), K(p) as sums of terms."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError, ParameterError
from squealstudy.mechanics.model import Model
from squealstudy.models.matrices.expression import Expression
from squealstudy.models.matrices.family import (
    ORDERS,
    FamilyTerm,
    MatrixFamily,
    family_definition,
)
from squealstudy.wording import did_you_mean, shown


def matrices(M: Any, K: Any, *, C: Any = None, **values: float) -> Model:
    """The model lam^2 M(p) + lam C(p) + K(p), each a matrix or a sum of matrices.

    It has complex modes, and neither contact nor components. The damping is given by name, ``C=``,
    because other programs take it as the second argument.

    Parameters
    ----------
    M, K, C : matrix (n, n), or mapping of str -> matrix (n, n)
        Real matrices, dense or sparse, which are copied. A mapping is a sum of its
        matrices, each times its key: a number, or an expression of parameters such as
        ``"mu"`` or ``"2*sin(angle)"``.
    **values
        Value of each parameter in the coefficients.

    Raises
    ------
    ModelError
        Where matrices are not real and square, or of different sizes, or a coefficient is no
        expression.
    ParameterError
        Where a parameter has no value, or a value belongs to no parameter of a coefficient.

    Examples
    --------
    >>> import numpy as np, squealstudy as sq
    >>> follower = np.array([[0.0, 1.0], [-1.0, 0.0]])
    >>> model = sq.matrices(np.eye(2), {"1": np.diag([1e6, 1.2e6]), "mu": 1e6 * follower}, mu=0.0)
    >>> model.at(mu=[0.05, 0.15]).modes().unstable.any(axis=1).tolist()
    [False, True]
    """
    terms, letters = [], []
    for letter, matrix_or_parts in (("M", M), ("C", C), ("K", K)):
        is_sum = isinstance(matrix_or_parts, Mapping) and not sp.issparse(matrix_or_parts)  # DOK
        parts = matrix_or_parts if is_sum else {"1": matrix_or_parts}
        for coefficient, matrix in parts.items():
            if matrix is not None:
                term = FamilyTerm(ORDERS[letter], _real(letter, matrix), Expression(coefficient))
                terms.append(term)
                letters.append(letter)
    sizes = [(letter, term.matrix.shape[0]) for letter, term in zip(letters, terms, strict=True)]
    for letter, n in sizes:
        if n != sizes[0][1]:
            first, largest = sizes[0]
            raise ModelError(f"{letter} is {n} x {n}, {first} is {largest} x {largest}")
    family = MatrixFamily(tuple(terms))
    for name in values:
        if name not in family.names:
            hint = did_you_mean(name, family.names) or ""
            raise ParameterError(name, f"'{name}' is in none of the coefficients{hint}")
    for name in family.names:
        if name not in values:
            raise ParameterError(name, f"'{name}' of the coefficients has no value")
    nominal = {name: _number(name, values[name]) for name in family.names}
    return Model(family_definition((), nominal), {}, family=family)


def _number(name: str, entry: Any) -> float:
    """The value of a parameter; ParameterError where it is no finite number."""
    try:
        number = float(entry)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ParameterError(name, f"expected a finite number, got {shown(entry)}")
    return number


def _real(letter: str, matrix: Any) -> sp.csr_matrix:
    """A matrix as a sparse one of floats; ModelError unless it is square, real and finite."""
    array = matrix if sp.issparse(matrix) else np.asarray(matrix)
    if array.ndim != 2 or array.shape[0] != array.shape[1] or not array.shape[0]:
        raise ModelError(f"{letter}: expected a square matrix, got the shape {array.shape}")
    if np.ma.is_masked(matrix):
        raise ModelError(f"{letter}: expected a value of every entry, some are masked")
    if array.dtype.kind not in "iuf":
        raise ModelError(f"{letter}: expected a matrix of real numbers, got {array.dtype}")
    sparse = sp.csr_matrix(array, dtype=float, copy=True)
    if not np.isfinite(sparse.data).all():
        raise ModelError(f"{letter}: expected finite numbers")
    return sparse
