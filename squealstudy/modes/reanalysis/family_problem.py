"""A family of matrices as the ladder's problem: exact pairs by two sparse solves.

One solve finds the right vectors and one the left vectors. Left vectors are matched to the right
ones and scaled to y^H Q'(lambda) x = 1.
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

# left roots are sought in a slightly wider band than right ones: none is cut off at the edge
LEFT_BAND_FACTOR = 1.01
# left roots asked for over right ones found: with a few more than the band holds, one of them lies
# beyond it, and the solve need not be repeated for more
LEFT_COUNT_FACTOR = 1.1
SYMMETRIC = 1e-12  # asymmetry below this share of the largest entry is round-off
# multiples of (lower end of the band)^2 M that are added in turn to a stiffness not definite
SHIFTS = (0.0, 1.0, 1e2, 1e4)
# relative distance up to which a root of one solve and one of the other are the same root
SAME_ROOT_REL_DISTANCE = 1e-6
CLUSTER = 1e-7  # roots with a smaller relative distance have vectors of one subspace
# largest product of a left vector with another root's right vector, over their sizes; 0 if exact
LARGEST_PRODUCT = 1e-4


class FamilyProblem(SweptProblem):
    """A family of matrices over a box of parameters.

    The mass may vary. A design point fails where a coefficient has no value.

    Parameters
    ----------
    family : MatrixFamily
        Matrices and their coefficients.
    dimension : int
        Number of parameters that vary.
    values_at : callable
        Parameter values at theta in [-1, 1]^d.
    band_hz : (low, high)
        Frequency band, Hz.
    first : int
        Number of roots, conjugates counted, that the first solve at a design point asks for.
    least_growth : float
        Growth rate [1/s] below which modes are left out everywhere: no basis holds them, and no
        result shows them.
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
        """Coefficients at theta; raises ConvergenceError where one has no value."""
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
            Where a solve fails, a coefficient has no value, or left and right vectors do not match.
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

        Friction and follower forces are left out, since their symmetric part alone would make it
        indefinite. Where it is not positive definite, as with free bodies, a multiple of the mass
        is added (`SHIFTS`).
        """
        K, M = self._symmetric(STIFFNESS), self._nominal_mass
        for share in SHIFTS:
            try:
                return SparseCholesky(K + share * self.band[0] ** 2 * M)
            except ConvergenceError:
                continue
        raise ModelError("the symmetric stiffness of the family is not positive definite")

    def _symmetric(self, order: int) -> sp.csr_matrix:
        """Sum of the symmetric terms of an order at the middle of the box, weighted.

        Where no term is symmetric, it is the sum of the symmetric parts of all.
        """
        weights = self.weights(np.zeros(self.dimension))
        terms = [
            (float(w), t.matrix)
            for w, t in zip(weights, self.family.terms, strict=True)
            if t.order == order
        ]
        even = [(w, A) for w, A in terms if abs(A - A.T).max() <= SYMMETRIC * abs(A).max()]
        return _symmetric_sum(even or terms, self.family.n)

    def energy_root(self, X: np.ndarray) -> np.ndarray:
        """F X (n, m) with F^T F = K0, the factored stiffness at the middle of the box."""
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
    """Right roots and vectors, each with its left vector, scaled to y^H Q'(lambda) x = 1.

    The product y_i^H ((lam_i + lam_j) M + C) x_j vanishes for distinct roots. The solved vectors of
    close roots are any basis of their subspace, so the left vectors of a cluster are combined to
    make their products with the right ones vanish too.

    Parameters
    ----------
    M, C : csr_matrix (n, n)
        Mass and damping.
    lam, X : ndarray (m,), (n, m) complex
        Right roots and vectors.
    lam_left, Y : ndarray (l,), (n, l) complex
        Left roots and vectors, y^H Q(lambda) = 0. There may be more of them than right ones.

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
    """Index (m,) of the left root of each right root, none used twice."""
    if len(lam_left) < len(lam):
        raise _unmatched(f"{len(lam)} right and {len(lam_left)} left roots")
    distance = np.abs(lam[:, None] - lam_left[None, :])
    partner = partners(distance)
    if (distance[np.arange(len(lam)), partner] > SAME_ROOT_REL_DISTANCE * np.abs(lam)).any():
        raise _unmatched("a right root has no left one")
    return partner


def _clusters(lam: np.ndarray) -> list[np.ndarray]:
    """Indices of the roots in groups of close ones; most groups have a single root."""
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
    """Raise ConvergenceError where products of different roots' vectors do not vanish.

    They are compared with the sizes of both vectors.
    """
    right = np.sqrt(np.abs(np.einsum("ij,ij->j", X.conj(), M @ X))) * np.abs(lam)
    left_norm = np.sqrt(np.abs(np.einsum("ij,ij->j", Y.conj(), M @ Y)))
    size = left_norm[:, None] * right[None, :] + left_norm[:, None] * right[:, None]
    off = np.abs(products - np.diag(np.diag(products)))
    if (off > LARGEST_PRODUCT * np.maximum(size, 1e-300)).any():
        raise _unmatched("left and right vectors are not biorthogonal")


def _unmatched(why: str) -> ConvergenceError:
    return ConvergenceError("not_converged", f"left vectors: {why}")
