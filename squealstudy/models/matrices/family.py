"""A parametric family of matrices: M(p) = sum a_i(p) M_i, likewise C and K."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ConvergenceError, ModelError
from squealstudy.linalg.overflow import (
    LEAST_MASS,
    MAX_SQUARABLE_ENTRY,
    OVERFLOW,
    largest_entry,
    too_large,
)
from squealstudy.models.assembly import Assembly
from squealstudy.models.matrices.expression import Expression
from squealstudy.models.parameter import ModelDefinition
from squealstudy.parameter import Parameter

NAME = "matrices"
DESCRIPTION = "a family M(p), C(p), K(p) of matrices from files, coefficients in named parameters"
ORDERS = {"K": 0, "C": 1, "M": 2}  # power of lambda
LETTERS = {order: letter for letter, order in ORDERS.items()}
REQUIRED = ("M", "K")  # matrices of which a family has at least one term


@dataclass(frozen=True)
class FamilyTerm:
    """One summand a(p) A of a family of matrices: coefficient times matrix.

    Attributes
    ----------
    order : int
        Power of lambda: 0 stiffness, 1 damping, 2 mass.
    matrix : csr_matrix (n, n)
    coefficient : Expression
    """

    order: int
    matrix: sp.csr_matrix
    coefficient: Expression


@dataclass(frozen=True)
class MatrixFamily:
    """The quadratic eigenproblem lambda^2 M(p) + lambda C(p) + K(p) as sums over terms.

    Matrices are real and square. They may be unsymmetric, and all may depend on parameters.

    Attributes
    ----------
    terms : tuple of FamilyTerm

    Raises
    ------
    ModelError
        There is no term of the mass or of the stiffness; sizes differ.
    """

    terms: tuple[FamilyTerm, ...]

    def __post_init__(self) -> None:
        for letter in REQUIRED:
            if all(t.order != ORDERS[letter] for t in self.terms):
                raise ModelError(f"a family of matrices needs at least one term of {letter}")
        for number, term in enumerate(self.terms, start=1):
            if term.matrix.shape != (self.n, self.n):
                raise ModelError(
                    f"term {number} is {term.matrix.shape[0]} x {term.matrix.shape[1]}, "
                    f"the first is {self.n} x {self.n}"
                )

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return int(self.terms[0].matrix.shape[0])

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Parameters of all coefficients, in the order of their first use."""
        return tuple(dict.fromkeys(n for t in self.terms for n in t.coefficient.names))

    def weights(self, values: Mapping[str, float]) -> tuple[float, ...]:
        """Coefficient of each term at parameter values.

        Raises
        ------
        ExpressionError
            A coefficient has no value.
        ConvergenceError
            ``overflow``: the entries of a term are too large to compute with.
        """
        weights = tuple(t.coefficient.value(values) for t in self.terms)
        for t, size, weight in zip(self.terms, self._largest_entries, weights, strict=True):
            if not (entry := abs(weight) * size) <= MAX_SQUARABLE_ENTRY:
                term = f"the term '{t.coefficient.text}' of {LETTERS[t.order]}"
                raise ConvergenceError(OVERFLOW, too_large(term, entry))
        return weights

    @cached_property
    def _stacked(self) -> np.ndarray:
        """Matrices of all terms (k, n, n)."""
        return np.array([term.matrix.toarray() for term in self.terms])

    def dense(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """M, C, K as dense matrices (n, n), for families so small that LAPACK solves them.

        Errors are those of `weights` and `combined`.
        """
        weights = np.array(self.weights(values))
        orders = np.array([term.order for term in self.terms])
        stiffness, damping, mass = (
            np.tensordot(weights[orders == order], self._stacked[orders == order], axes=1)
            for order in sorted(LETTERS)
        )
        _expect_mass(mass)
        return mass, damping, stiffness

    @cached_property
    def _largest_entries(self) -> tuple[float, ...]:
        """Largest entry of each term's matrix."""
        return tuple(largest_entry(t.matrix) for t in self.terms)

    def matrices(
        self, values: Mapping[str, float]
    ) -> tuple[sp.csr_matrix, sp.csr_matrix, sp.csr_matrix]:
        """M, C, K (n, n) at parameter values; errors are those of `weights` and `combined`."""
        return self.combined(self.weights(values))

    def combined(
        self, weights: tuple[float, ...]
    ) -> tuple[sp.csr_matrix, sp.csr_matrix, sp.csr_matrix]:
        """M, C, K (n, n) as the sums of the terms with these weights.

        Raises
        ------
        ConvergenceError
            ``overflow``: the mass is not zero, but too small to divide by.
        """
        parts = [sp.csr_matrix((self.n, self.n)) for _ in ORDERS]
        for term, weight in zip(self.terms, weights, strict=True):
            parts[term.order] = parts[term.order] + weight * term.matrix
        stiffness, damping, mass = (part.tocsr() for part in parts)
        _expect_mass(mass)
        return mass, damping, stiffness


def _expect_mass(mass: np.ndarray | sp.csr_matrix) -> None:
    """Raise ConvergenceError ``overflow`` for a mass that is not 0, but too small to divide by."""
    if 0 < (size := largest_entry(mass)) < LEAST_MASS:
        raise ConvergenceError(
            OVERFLOW, f"the largest entry of M is {size:.0e}: expected at least {LEAST_MASS:g}"
        )


@dataclass(frozen=True)
class TermSource:
    """The source of a term.

    Attributes
    ----------
    matrix : str
        ``M``, ``C`` or ``K``.
    path : Path
    variable : str or None
        Which matrix, where the file has several.
    coefficient : str
        Text of an expression.
    """

    matrix: str
    path: Path
    variable: str | None
    coefficient: str


@dataclass(frozen=True)
class FamilyDefinition(ModelDefinition):
    """The model of a family of matrices, without contact, friction or components.

    Its parameters are the names in the coefficients; their defaults are the study's values.

    Attributes
    ----------
    sources : tuple of TermSource
    """

    sources: tuple[TermSource, ...] = ()


def family_definition(
    sources: tuple[TermSource, ...], nominal: Mapping[str, float]
) -> FamilyDefinition:
    """The model of these terms; `nominal` has the default of each parameter."""
    parameters = tuple(Parameter(n, v, "", "in the coefficients") for n, v in nominal.items())
    return FamilyDefinition(NAME, DESCRIPTION, (), parameters, (), _no_assembly, sources=sources)


def _no_assembly(
    options: Mapping[str, str | int],  # noqa: ARG001 - the signature of every model
    values: Mapping[str, float],  # noqa: ARG001
) -> Assembly:
    raise ModelError("a family of matrices has neither components nor contact")
