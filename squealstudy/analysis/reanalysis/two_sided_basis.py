"""A Petrov-Galerkin basis of a family of matrices: right modes as columns, left modes as rows.

Both are complex and nothing is split into real and imaginary parts: half the vectors span the roots
of positive imaginary part, and the error of a root is the product of both bases' errors. The
price is complex arithmetic and roots that mean nothing, which the error estimate tells apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from squealstudy.analysis.reanalysis.eigen import Eigenpairs
from squealstudy.analysis.reanalysis.problem import Problem
from squealstudy.errors import ModelError
from squealstudy.system.parametric import DAMPING, MASS, STIFFNESS, ParametricSystem, Weights


@dataclass(frozen=True)
class TwoSidedBasis:
    """A projection W^H Q V of a system of scalar weights.

    Attributes
    ----------
    V, W : ndarray (n, d) complex
        Orthonormal columns.
    orders : tuple of int
        Power of lambda of each term.
    small : ndarray (terms, d, d) complex
    singular : tuple of two ndarray
        Singular values of the right and left modes that the bases were cut from.
    """

    V: np.ndarray
    W: np.ndarray
    orders: tuple[int, ...]
    small: np.ndarray
    singular: tuple[np.ndarray, np.ndarray]

    @property
    def d(self) -> int:
        """Number of vectors of either basis."""
        return int(self.V.shape[1])

    def matrices(self, weights: Weights) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Small M, C, K (d, d)."""
        w = np.array([float(x) for x in weights])
        order = np.array(self.orders)
        M, C, K = (
            np.tensordot(w * (order == k), self.small, 1) for k in (MASS, DAMPING, STIFFNESS)
        )
        return M, C, K

    def roots(self, weights: Weights) -> np.ndarray:
        """All 2d roots (rad/s) of the small problem, those that mean nothing among them."""
        A, _, scale = self._companion(weights)
        lam: np.ndarray = la.eigvals(A, overwrite_a=True, check_finite=False) * scale
        return lam

    def pairs(self, weights: Weights) -> Eigenpairs:
        """All 2d roots with vectors of the full problem, y^H Q'(lam) x = 1 in the small one."""
        A, (M, C), scale = self._companion(weights)
        lam, left, right = la.eig(A, left=True, right=True, overwrite_a=True, check_finite=False)
        lam = lam * scale
        x = right[: self.d]
        y = np.linalg.solve(M.conj().T, left[self.d :])
        slope = np.einsum("ij,ij->j", y.conj(), 2.0 * lam * (M @ x) + C @ x)
        y = y / np.where(slope == 0, 1.0, slope).conj()
        return Eigenpairs(lam, self.V @ x, self.W @ y)

    def _companion(
        self, weights: Weights
    ) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], float]:
        """First companion matrix in scaled time, M and C, and the scale."""
        M, C, K = self.matrices(weights)
        lower = np.linalg.solve(M, np.hstack([K, C]))
        d = self.d
        scale = float(np.sqrt(np.linalg.norm(lower[:, :d]) / np.sqrt(d))) or 1.0
        A = np.zeros((2 * d, 2 * d), dtype=complex)
        A[:d, d:] = np.eye(d)
        A[d:, :d] = lower[:, :d] / -(scale**2)
        A[d:, d:] = lower[:, d:] / -scale
        return A, (M, C), scale


@dataclass(frozen=True)
class Snapshots:
    """Modes of training points in energy coordinates, as singular vectors and values.

    Attributes
    ----------
    right, left : (U (n, q), s (q,))
    """

    right: tuple[np.ndarray, np.ndarray]
    left: tuple[np.ndarray, np.ndarray]


def snapshots(problem: Problem, pairs: Sequence[Eigenpairs]) -> Snapshots:
    """Singular vectors of the modes of several design points, each of unit energy."""
    return Snapshots(
        _decomposed(problem, [p.X for p in pairs]), _decomposed(problem, [p.Y for p in pairs])
    )


def two_sided_basis(problem: Problem, modes: Snapshots, d: int) -> TwoSidedBasis:
    """The first d vectors of either side.

    Raises
    ------
    ModelError
        Terms whose weights are no scalars; fewer modes than d.
    """
    right, left = modes.right, modes.left
    if d > min(len(right[1]), len(left[1])):
        raise ModelError(f"{d} vectors asked for, the modes span {len(right[1])}")
    V, W = (_basis(problem, U[:, :d]) for U, _ in (right, left))
    orders, small = _projected(problem.system, W, V)
    return TwoSidedBasis(V, W, orders, small, (right[1], left[1]))


def _decomposed(problem: Problem, modes: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    Z = np.hstack(modes)
    E = problem.energy_root(np.ascontiguousarray(Z.real)) + 1j * problem.energy_root(
        np.ascontiguousarray(Z.imag)
    )
    U, s, _ = la.svd(E / np.linalg.norm(E, axis=0), full_matrices=False)
    return U, s


def _basis(problem: Problem, U: np.ndarray) -> np.ndarray:
    """Vectors in displacements, orthonormal: the projection does not depend on the choice."""
    parts = (problem.from_energy(np.ascontiguousarray(p)) for p in (U.real, U.imag))
    real, imaginary = parts
    basis: np.ndarray = la.qr(real + 1j * imaginary, mode="economic")[0]
    return basis


def _projected(
    system: ParametricSystem, W: np.ndarray, V: np.ndarray
) -> tuple[tuple[int, ...], np.ndarray]:
    small = []
    for term in system.terms:
        left, right = term.seen_left(W.conj()), term.seen_right(V)
        small.append(left.T @ right)
    return tuple(t.order for t in system.terms), np.array(small)
