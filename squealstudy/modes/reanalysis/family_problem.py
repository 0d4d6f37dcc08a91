"""A family of matrices as the ladder's problem: exact pairs by sparse solves on both sides."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ConvergenceError, ModelError
from squealstudy.linalg.band_roots import FIRST_ROOTS, roots_in_band
from squealstudy.linalg.companion import Eigenpairs
from squealstudy.linalg.sparse_cholesky import SparseCholesky
from squealstudy.models.matrices.expression import ExpressionError
from squealstudy.models.matrices.family import MatrixFamily
from squealstudy.modes.full_order.family_point import UNDEFINED, family_system
from squealstudy.modes.point import angular_band
from squealstudy.modes.reanalysis.biorthogonal import biorthogonal
from squealstudy.modes.reanalysis.problem import Linearisation, Linearised, in_band
from squealstudy.system.parametric import MASS, STIFFNESS, ParametricSystem, Weights

EDGE = 1.01  # left roots are sought a little beyond the right ones: none is cut off at the edge
MARGIN = 1.1  # of the number of left roots asked for: one lies beyond the band, so once is enough
SYMMETRIC = 1e-12  # relative asymmetry of round-off
SHIFTS = (0.0, 1.0, 1e2, 1e4)  # of the mass, in squares of the band's lower end


class FamilyProblem:
    """A family of matrices over a box of parameters.

    The mass may vary. A coefficient without a value at a design point is its failure.

    Parameters
    ----------
    family : MatrixFamily
    dimension : int
        Number of parameters that vary.
    values_at : callable
        Parameter values at theta in [-1, 1]^d.
    band_hz : (low, high)
    first : int
        Roots to ask for first at a design point, conjugates counted.
    least_growth : float
        Growth rate [1/s] below which modes are left out everywhere: they neither enter the basis
        nor are they looked at.
    """

    exact = "full"  # the rung of `pairs`

    def __init__(
        self,
        family: MatrixFamily,
        dimension: int,
        values_at: Callable[[np.ndarray], Mapping[str, float]],
        band_hz: tuple[float, float],
        first: int = FIRST_ROOTS,
        least_growth: float = -np.inf,
    ) -> None:
        self.family, self.values_at = family, values_at
        self.dimension = dimension
        self.band = angular_band(band_hz)
        self.first, self.least_growth = first, least_growth

    @cached_property
    def system(self) -> ParametricSystem:
        """Terms of the family, one scalar weight each."""
        return family_system(self.family)

    def interpolation_error(self) -> float:
        """Nothing is interpolated."""
        return 0.0

    def weights(self, theta: np.ndarray) -> Weights:
        """Coefficients at theta; ConvergenceError where one has no value."""
        try:
            return self.family.weights(self.values_at(np.asarray(theta)))
        except ExpressionError as error:
            raise ConvergenceError(UNDEFINED, str(error)) from error

    def samples(self, theta: np.ndarray, field: Any = None) -> list[Linearised]:
        """Weights at theta (b, d); the reason where a coefficient has no value."""
        found: list[Linearised] = []
        for row in theta:
            try:
                found.append(Linearisation(self.weights(row), None))
            except ConvergenceError as error:
                found.append(error)
        return found

    def local_field(self, box: Any, grid: Any) -> None:
        """Nothing: a family has no working points."""
        return

    def pairs(self, theta: np.ndarray, reach: float) -> tuple[Weights, Eigenpairs]:
        """Exact pairs by two sparse solves, of the matrices and of their transposes.

        Raises
        ------
        ConvergenceError
            Where either fails, or where left and right vectors do not match.
        """
        weights = self.weights(theta)
        M, C, K = self.family.combined(weights)
        band = (self.band[0] / reach, self.band[1] * reach)
        right = roots_in_band(M, C, K, band, self.first)
        wider = (band[0] / EDGE, band[1] * EDGE)
        first = int(MARGIN * right.n_below) + 2
        left = roots_in_band(M.T.tocsr(), C.T.tocsr(), K.T.tocsr(), wider, first)
        pairs = biorthogonal(M, C, right.lam, right.psi, left.lam, left.psi.conj())
        kept = in_band(pairs.lam, self.band, reach) & (pairs.lam.real >= self.least_growth)
        return weights, pairs.take(kept)

    @cached_property
    def _nominal_mass(self) -> sp.csr_matrix:
        return self._symmetric(MASS)

    @cached_property
    def _cholesky(self) -> SparseCholesky:
        """Of the symmetric stiffness at the middle of the box.

        Friction and follower forces are left out: their symmetric part alone makes it indefinite.
        Free bodies, and what else is not definite, get a share of the mass.
        """
        K, M = self._symmetric(STIFFNESS), self._nominal_mass
        for share in SHIFTS:
            try:
                return SparseCholesky(K + share * self.band[0] ** 2 * M)
            except ConvergenceError:
                continue
        raise ModelError("the symmetric stiffness of the family is not positive definite")

    def _symmetric(self, order: int) -> sp.csr_matrix:
        """Sum of the symmetric terms of an order at the middle, of symmetric parts if none is."""
        weights = self.weights(np.zeros(self.dimension))
        terms = [
            (float(w), t.matrix)
            for w, t in zip(weights, self.family.terms, strict=True)
            if t.order == order
        ]
        even = [(w, A) for w, A in terms if abs(A - A.T).max() <= SYMMETRIC * abs(A).max()]
        return _symmetric_sum(even or terms, self.family.n)

    def energy_root(self, X: np.ndarray) -> np.ndarray:
        """F X."""
        return self._cholesky.root(X)

    def from_energy(self, Z: np.ndarray) -> np.ndarray:
        """F^-1 Z."""
        return self._cholesky.from_root(Z)

    def flexibility(self, r: np.ndarray) -> np.ndarray:
        """K0^-1 r."""
        return self._cholesky.solve(r)

    def mass_product(self, X: np.ndarray) -> np.ndarray:
        """M0 X with the symmetric mass at the middle of the box."""
        product: np.ndarray = self._nominal_mass @ X
        return product


def _symmetric_sum(terms: Sequence[tuple[float, sp.csr_matrix]], n: int) -> sp.csr_matrix:
    total = sp.csr_matrix((n, n))
    for weight, A in terms:
        total = total + (weight / 2) * (A + A.T)
    return total.tocsr()
