"""Quadratic eigenproblems that depend on the design point by the weights of their terms alone.

    Q(lambda; p) = lambda^2 M(p) + lambda C(p) + K(p) = sum_t lambda^order_t L_t^T diag(w_t(p)) R_t

The brake at its contact points and a family of matrices are both of this form, and so is every
projection of them: reductions multiply L_t and R_t once, a design point changes weights.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ConvergenceError, ModelError
from squealstudy.linalg.factor import is_full
from squealstudy.linalg.overflow import MAX_SQUARABLE_ENTRY, OVERFLOW, largest_entry, too_large
from squealstudy.linalg.quadratic_pencil import product
from squealstudy.linalg.sparse_qep import LowRankSum
from squealstudy.system.row_blocks import BlockRows, weighted

STIFFNESS, DAMPING, MASS = 0, 1, 2
# number of whole matrices of one order above which they are summed before a product
SUM_FIRST_ABOVE = 3
Matrix = Any  # ndarray or scipy sparse matrix
Weights = tuple[Any, ...]  # of float, ndarray (k,), or ndarray (n, n) for dense terms


@dataclass(frozen=True)
class Term:
    """One term L^T diag(w) R of the stiffness, damping or mass.

    Attributes
    ----------
    order : int
        Power of lambda: 0 stiffness, 1 damping, 2 mass.
    left, right : matrix (k, n) or None
        None stands for the identity.
    dense : bool
        Whether the weight is a matrix (n, n) and the whole term; left and right are then None.
    """

    order: int
    left: Matrix | None = None
    right: Matrix | None = None
    dense: bool = False

    def right_product(self, X: np.ndarray) -> np.ndarray:
        """R X, or X itself where R is the identity."""
        return X if self.right is None else np.asarray(self.right @ X)

    def left_product(self, Y: np.ndarray) -> np.ndarray:
        """L Y, or Y itself where L is the identity."""
        return Y if self.left is None else np.asarray(self.left @ Y)


@dataclass(frozen=True)
class ParametricSystem:
    """The terms of a parametric quadratic eigenproblem of size n.

    Raises
    ------
    ModelError
        Terms that do not fit together.
    """

    n: int
    terms: tuple[Term, ...]

    def __post_init__(self) -> None:
        for number, term in enumerate(self.terms):
            for side in (term.left, term.right):
                if side is not None and side.shape[1] != self.n:
                    raise ModelError(
                        f"term {number} has {side.shape[1]} columns, expected {self.n}"
                    )

    def expect_computable(self, weights: Weights, names: Sequence[str]) -> None:
        """Raise ConvergenceError ``overflow`` where weights make entries too large for squares.

        Parameters
        ----------
        weights : Weights
        names : sequence of str
            Names of the terms, for the message.
        """
        for w, size, name in zip(weights, self._sizes, names, strict=True):
            if not (entry := largest_entry(w) * size) <= MAX_SQUARABLE_ENTRY:
                what = f"a matrix of the model ({name.replace('_', ' ')})"
                raise ConvergenceError(OVERFLOW, too_large(what, entry))

    @cached_property
    def _sizes(self) -> list[float]:
        """Upper bound of the entries of L^T R of each term."""
        return [
            math.prod(largest_entry(side) for side in (t.left, t.right) if side is not None)
            for t in self.terms
        ]

    def numbers(self, order: int) -> list[int]:
        """Indices of the terms of one power of lambda."""
        return [i for i, term in enumerate(self.terms) if term.order == order]

    def summed(self, weights: Weights, numbers: Iterable[int]) -> np.ndarray:
        """Dense sum (n, n) of some of the terms, whatever their orders."""
        total = np.zeros((self.n, self.n))
        in_blocks: dict[int, list[tuple[Matrix, Any, Matrix]]] = {}
        for i in numbers:
            term, w = self.terms[i], weights[i]
            if np.ndim(w) == 1 and i in self._block_rows:
                in_blocks.setdefault(len(w), []).append((term.left, w, term.right))
            else:
                _add_dense(total, term, w)
        for rows, terms in in_blocks.items():
            self._blocks[rows].add(total, terms)
        return total

    @cached_property
    def _blocks(self) -> dict[int, BlockRows]:
        """Blocks of the dense terms, by their number of rows; only where there are blocks."""
        sides: dict[int, dict[int, np.ndarray]] = {}
        for term in self.terms:
            if isinstance(term.left, np.ndarray) and isinstance(term.right, np.ndarray):
                for side in (term.left, term.right):
                    sides.setdefault(len(side), {})[id(side)] = side
        by_rows = {rows: BlockRows.of(list(matrices.values())) for rows, matrices in sides.items()}
        return {rows: matrices for rows, matrices in by_rows.items() if matrices.blocks}

    @cached_property
    def _block_rows(self) -> frozenset[int]:
        """Indices of the terms whose products are computed by blocks."""
        return frozenset(
            i
            for i, term in enumerate(self.terms)
            if isinstance(term.left, np.ndarray)
            and isinstance(term.right, np.ndarray)
            and len(term.right) in self._blocks
        )

    def matrices(self, weights: Weights) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Dense M, C, K (n, n) at a design point."""
        self._check(weights)
        M, C, K = (self.summed(weights, self.numbers(o)) for o in (MASS, DAMPING, STIFFNESS))
        return M, C, K

    def sparse_matrices(self, weights: Weights) -> tuple[LowRankSum, LowRankSum, LowRankSum]:
        """Sparse M, C, K at a design point, with the few dense rows apart, as U^T diag(d) U."""
        self._check(weights)
        M, C, K = (self.sparse_sum(weights, self.numbers(o)) for o in (MASS, DAMPING, STIFFNESS))
        return M, C, K

    def sparse_sum(self, weights: Weights, numbers: Iterable[int]) -> LowRankSum:
        """The sum that `summed` gives, as a sparse matrix plus U diag(d) U^T of the dense rows."""
        total, columns, values = sp.csr_matrix((self.n, self.n)), [], []
        identity = sp.identity(self.n, format="csr")
        for i in numbers:
            term, w = self.terms[i], weights[i]
            if isinstance(term.right, np.ndarray) and term.left is term.right:
                rows = np.asarray(term.right)
                d = np.broadcast_to(w, len(rows))
                columns.append(rows[d != 0].T)
                values.append(d[d != 0])
            elif not _vanishes(w):
                left = identity if term.left is None else term.left
                right = identity if term.right is None else term.right
                scaled = right * float(w) if np.ndim(w) == 0 else sp.diags(w) @ right
                if is_full(right) and left is not identity:  # as in a projected assembly
                    total = total + sp.csr_matrix(left.T.toarray() @ scaled.toarray())
                else:
                    total = total + left.T @ scaled
        if not columns:
            return LowRankSum(total)
        return LowRankSum(total, np.hstack(columns), np.concatenate(values))

    def projected(self, V: np.ndarray) -> ParametricSystem:
        """The terms projected on a basis V (n, r); their weights stay the same.

        A term without `left` is projected as one matrix.

        Raises
        ------
        ModelError
            A term whose weight is a whole matrix.
        """
        terms = []
        for number, term in enumerate(self.terms):
            if term.dense:
                raise ModelError(f"term {number} is dense: it has no projection")
            if term.left is None and term.right is not None:
                terms.append(Term(term.order, None, V.T @ np.asarray(term.right @ V)))
            elif term.left is term.right:
                projected_rows = term.right_product(V)
                terms.append(Term(term.order, projected_rows, projected_rows))
            else:
                terms.append(Term(term.order, term.left_product(V), term.right_product(V)))
        return ParametricSystem(V.shape[1], tuple(terms))

    def of_order(self, weights: Weights, order: int) -> tuple[ParametricSystem, Weights]:
        """The system of the terms of one power of lambda, and their weights."""
        chosen = self.numbers(order)
        part = ParametricSystem(self.n, tuple(self.terms[i] for i in chosen))
        return part, tuple(weights[i] for i in chosen)

    def apply(self, weights: Weights, lam: np.ndarray, X: np.ndarray | Columns) -> np.ndarray:
        """Q(lam_j) x_j (n, m) for every column x_j of X."""
        return self._sum(weights, [lam**order for order in range(3)], columns(X), adjoint=False)

    def apply_adjoint(
        self, weights: Weights, lam: np.ndarray, Y: np.ndarray | Columns
    ) -> np.ndarray:
        """Q(lam_j)^H y_j (n, m) for every column y_j of Y."""
        return self._sum(
            weights, [lam.conj() ** order for order in range(3)], columns(Y), adjoint=True
        )

    def slopes(
        self, weights: Weights, lam: np.ndarray, X: np.ndarray | Columns, Y: np.ndarray | Columns
    ) -> np.ndarray:
        """y_j^H Q'(lam_j) x_j (m,) for every pair of columns of X and Y."""
        right, left_columns = columns(X), columns(Y)
        total = np.zeros(len(lam), dtype=complex)
        system, weights = self.gathered(weights)
        for term, w in zip(system.terms, weights, strict=True):
            if term.order == STIFFNESS or _vanishes(w):
                continue
            observed, left_observed = (
                right.product_with(term.right),
                left_columns.product_with(term.left),
            )
            observed = product(w, observed) if term.dense else _scaled(w, observed)
            products = np.einsum("ij,ij->j", left_observed.conj(), observed)
            total += products if term.order == DAMPING else 2.0 * lam * products
        return total

    def forms(
        self, weights: Weights, lam: np.ndarray, X: np.ndarray | Columns, Y: np.ndarray | Columns
    ) -> np.ndarray:
        """y_i^H Q(lam_j) x_j (k, m) for all pairs of columns of Y (n, k) and X (n, m)."""
        right, left_columns = columns(X), columns(Y)
        total = np.zeros((left_columns.values.shape[1], len(lam)), dtype=complex)
        self._check(weights)
        for term, w in zip(self.terms, weights, strict=True):
            if not _vanishes(w):
                observed = right.product_with(term.right)
                observed = product(w, observed) if term.dense else _scaled(w, observed)
                total += left_columns.product_with(term.left).conj().T @ (
                    observed * lam**term.order
                )
        return total

    def gathered(self, weights: Weights) -> tuple[ParametricSystem, Weights]:
        """The same system at one design point, with fewer terms for the products there.

        Where many terms of one order are whole matrices, these are summed.
        """
        by_order: dict[int, list[int]] = {STIFFNESS: [], DAMPING: [], MASS: []}
        for i, (term, w) in enumerate(zip(self.terms, weights, strict=True)):
            if term.left is None and isinstance(term.right, np.ndarray) and not np.ndim(w):
                by_order[term.order].append(i)
        to_sum = {
            order: term_numbers
            for order, term_numbers in by_order.items()
            if len(term_numbers) > SUM_FIRST_ABOVE
        }
        if not to_sum:
            return self, weights
        summed = {i for term_numbers in to_sum.values() for i in term_numbers}
        others = [i for i in range(len(self.terms)) if i not in summed]
        totals = [
            sum(weights[i] * self.terms[i].right for i in term_numbers)
            for term_numbers in to_sum.values()
        ]
        terms = (
            *(self.terms[i] for i in others),
            *(Term(order, dense=True) for order in to_sum),
        )
        return ParametricSystem(self.n, terms), (*(weights[i] for i in others), *totals)

    def _check(self, weights: Weights) -> None:
        if len(weights) != len(self.terms):
            raise ModelError(f"{len(weights)} weights for {len(self.terms)} terms")

    def _sum(
        self, weights: Weights, factors: Sequence[np.ndarray], X: Columns, adjoint: bool
    ) -> np.ndarray:
        """Sum of the terms times X, or of their adjoints, with a factor (m,) for each order.

        Terms with the same left matrix share the product with it.
        """
        total = np.zeros(X.values.shape, dtype=complex)
        left_factors: dict[int, tuple[Matrix, np.ndarray]] = {}
        system, weights = self.gathered(weights)
        for term, w in zip(system.terms, weights, strict=True):
            if _vanishes(w):
                continue
            factor = factors[term.order]
            if term.dense:
                total += product(w.T if adjoint else w, X.values) * factor
                continue
            first, second = (term.left, term.right) if adjoint else (term.right, term.left)
            part = _scaled(w, X.product_with(first)) * factor
            if second is None:
                total += part
            elif id(second) in left_factors:
                left_factors[id(second)] = second, left_factors[id(second)][1] + part
            else:
                left_factors[id(second)] = second, part
        for second, part in left_factors.values():
            total += product(second.T, part)
        return total


class Columns:
    """Vectors (n, m) that remember their products with the matrices of terms.

    Parameters
    ----------
    values : ndarray (n, m) complex
    """

    def __init__(self, values: np.ndarray) -> None:
        self.values = values
        self._products: dict[int, tuple[Matrix, np.ndarray]] = {}

    def product_with(self, A: Matrix | None) -> np.ndarray:
        """A X, or X itself where A is None."""
        if A is None:
            return self.values
        if id(A) not in self._products:
            self._products[id(A)] = A, product(A, self.values)
        return self._products[id(A)][1]


def columns(X: np.ndarray | Columns) -> Columns:
    """The vectors as `Columns`."""
    return X if isinstance(X, Columns) else Columns(X)


def _vanishes(w: Any) -> bool:
    return np.ndim(w) == 0 and w == 0


def _scaled(w: Any, X: np.ndarray) -> np.ndarray:
    scaled: np.ndarray = X * (w if np.ndim(w) == 0 else np.asarray(w)[:, None])
    return scaled


def _add_dense(A: np.ndarray, term: Term, w: Any) -> None:
    """Add a term with its weight to a dense matrix, in place."""
    if term.dense:
        A += w
    elif term.left is None and term.right is None:
        A[np.diag_indices_from(A)] += w
    elif np.ndim(w) and term.left is term.right:
        right = _dense(term.right)
        A += weighted(right, np.asarray(w), right)
    elif np.ndim(w) or w:
        right = np.eye(len(A)) if term.right is None else _dense(term.right)
        scaled = (np.asarray(w)[:, None] if np.ndim(w) else w) * right
        A += scaled if term.left is None else term.left.T @ scaled


def _dense(A: Matrix) -> np.ndarray:
    return A.toarray() if sp.issparse(A) else np.asarray(A)
