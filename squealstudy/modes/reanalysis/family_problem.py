"""A family of matrices as the ladder's problem: exact pairs by sparse solves on both sides.

Left vectors are matched to the right ones, y^H Q'(lambda) x = 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from squealstudy.errors import ConvergenceError, ModelError
from squealstudy.linalg.band_roots import FIRST_ROOTS, roots_in_band
from squealstudy.linalg.companion import Eigenpairs
from squealstudy.linalg.factor import SparseCholesky
from squealstudy.models.matrices.expression import ExpressionError
from squealstudy.models.matrices.family import MatrixFamily
from squealstudy.modes.full_order.modes import UNDEFINED, family_system
from squealstudy.modes.reanalysis.problem import SweptProblem, in_band, in_or_below
from squealstudy.root_pairs import angular_band, partners
from squealstudy.system.parametric import MASS, STIFFNESS, ParametricSystem, Weights

# left roots are sought a little beyond the right ones: none is cut off at the edge
LEFT_BAND_FACTOR = 1.01
# of the number of left roots asked for: one lies beyond the band, so once is enough
LEFT_COUNT_FACTOR = 1.1
SYMMETRIC = 1e-12  # relative asymmetry of round-off
SHIFTS = (0.0, 1.0, 1e2, 1e4)  # shifts of the mass, in squares of the band's lower end
# relative distance of roots that two solves tell apart: the same root within it
SAME_ROOT_REL_DISTANCE = 1e-6
CLUSTER = 1e-7  # relative distance below which roots share their vectors
LARGEST_PRODUCT = 1e-4  # products that vanish for exact vectors of distinct roots


class FamilyProblem(SweptProblem):
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

    def weights(self, theta: np.ndarray) -> Weights:
        """Coefficients at theta; ConvergenceError where one has no value."""
        try:
            return self.family.weights(self.values_at(np.asarray(theta)))
        except ExpressionError as error:
            raise ConvergenceError(UNDEFINED, str(error)) from error

    def pairs(
        self, theta: np.ndarray, reach: float, below: bool = False
    ) -> tuple[Weights, Eigenpairs]:
        """Exact pairs by two sparse solves, of the matrices and of their transposes.

        Raises
        ------
        ConvergenceError
            Where either fails, or where left and right vectors do not match.
        """
        weights = self.weights(theta)
        M, C, K = self.family.combined(weights)
        keep = in_or_below if below else in_band
        band = (0.0 if below else self.band[0] / reach, self.band[1] * reach)
        right = roots_in_band(M, C, K, band, self.first)
        wider = (band[0] / LEFT_BAND_FACTOR, band[1] * LEFT_BAND_FACTOR)
        first = int(LEFT_COUNT_FACTOR * right.n_below) + 2
        left_roots = roots_in_band(M.T.tocsr(), C.T.tocsr(), K.T.tocsr(), wider, first)
        pairs = biorthogonal(M, C, right.lam, right.psi, left_roots.lam, left_roots.psi.conj())
        is_reached = keep(pairs.lam, self.band, reach) & (pairs.lam.real >= self.least_growth)
        return weights, pairs.take(is_reached)

    @cached_property
    def _nominal_mass(self) -> sp.csr_matrix:
        return self._symmetric(MASS)

    @cached_property
    def _cholesky(self) -> SparseCholesky:
        """Cholesky factor of the symmetric stiffness at the middle of the box.

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
        """F X with F^T F = K0, the symmetric stiffness at the middle of the box, (n, m)."""
        return self._cholesky.root(X)

    def from_energy(self, Z: np.ndarray) -> np.ndarray:
        """F^-1 Z, the inverse of `energy_root`, (n, m)."""
        return self._cholesky.from_root(Z)

    def flexibility(self, r: np.ndarray) -> np.ndarray:
        """Static response K0^-1 r to complex loads r (n, m)."""
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


def biorthogonal(
    M: sp.csr_matrix,
    C: sp.csr_matrix,
    lam: np.ndarray,
    X: np.ndarray,
    lam_left: np.ndarray,
    Y: np.ndarray,
) -> Eigenpairs:
    """Pairs of right roots and vectors with the left ones among those given.

    In the state space, y_i^H ((lam_i + lam_j) M + C) x_j vanishes for distinct roots. Vectors of
    close roots are any basis of their subspace: there the left ones are turned against the right.

    Parameters
    ----------
    M, C : csr_matrix (n, n)
    lam, X : ndarray (m,), (n, m) complex
        Right roots and vectors.
    lam_left, Y : ndarray (l,), (n, l) complex
        Roots and y of y^H Q = 0; more than m do no harm.

    Raises
    ------
    ConvergenceError
        ``not_converged``, where a right root has no left vector or vectors are not biorthogonal.
    """
    Y = Y[:, _partners(lam, lam_left)]
    products = _products(M, C, lam, X, Y)
    for members in _clusters(lam):
        if len(members) > 1:
            block = products[np.ix_(members, members)]
            Y[:, members] = Y[:, members] @ _inverse(block).conj().T
    products = _products(M, C, lam, X, Y)
    scale = np.diag(products)
    if not scale.all():
        raise _unmatched("a left vector is orthogonal to its right one")
    _check(M, lam, X, Y, products)
    return Eigenpairs(lam, X, Y / scale.conj())


def _partners(lam: np.ndarray, lam_left: np.ndarray) -> np.ndarray:
    """Index of the left root of each right one, each used once."""
    if len(lam_left) < len(lam):
        raise _unmatched(f"{len(lam)} right and {len(lam_left)} left roots")
    distance = np.abs(lam[:, None] - lam_left[None, :])
    partner = partners(distance)
    if (distance[np.arange(len(lam)), partner] > SAME_ROOT_REL_DISTANCE * np.abs(lam)).any():
        raise _unmatched("a right root has no left one")
    return partner


def _clusters(lam: np.ndarray) -> list[np.ndarray]:
    """Indices of roots that are close to each other, in groups."""
    if not len(lam):
        return []
    size = np.maximum(np.abs(lam)[:, None], np.abs(lam)[None, :])
    close = np.abs(lam[:, None] - lam[None, :]) <= CLUSTER * size
    count, label = connected_components(sp.csr_matrix(close), directed=False)
    return [np.flatnonzero(label == k) for k in range(count)]


def _products(
    M: sp.csr_matrix, C: sp.csr_matrix, lam: np.ndarray, X: np.ndarray, Y: np.ndarray
) -> np.ndarray:
    Y_h = Y.conj().T
    total: np.ndarray = (Y_h @ (M @ X)) * (lam[:, None] + lam[None, :]) + Y_h @ (C @ X)
    return total


def _inverse(block: np.ndarray) -> np.ndarray:
    try:
        inverse: np.ndarray = np.linalg.inv(block)
    except np.linalg.LinAlgError as error:
        raise _unmatched("roots that coincide have no full set of vectors") from error
    return inverse


def _check(
    M: sp.csr_matrix, lam: np.ndarray, X: np.ndarray, Y: np.ndarray, products: np.ndarray
) -> None:
    """Products of distinct roots must vanish beside the sizes of both vectors."""
    right = np.sqrt(np.abs(np.einsum("ij,ij->j", X.conj(), M @ X))) * np.abs(lam)
    left_norm = np.sqrt(np.abs(np.einsum("ij,ij->j", Y.conj(), M @ Y)))
    size = left_norm[:, None] * right[None, :] + left_norm[:, None] * right[:, None]
    off = np.abs(products - np.diag(np.diag(products)))
    if (off > LARGEST_PRODUCT * np.maximum(size, 1e-300)).any():
        raise _unmatched("left and right vectors are not biorthogonal")


def _unmatched(why: str) -> ConvergenceError:
    return ConvergenceError("not_converged", f"left vectors: {why}")
