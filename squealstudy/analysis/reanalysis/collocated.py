"""A projected parametric system with its weights expanded in few terms: batches by one product."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from squealstudy.analysis.parametric import DAMPING, MASS, STIFFNESS, ParametricSystem, Weights

Matrices = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Expansion:
    """One term of the system: w = shapes c, so that L^T diag(w) R = sum of c_i matrices_i.

    Attributes
    ----------
    order : int
        Power of lambda.
    shapes : ndarray (k, q)
        Orthonormal; (1, 1) of one for scalar weights.
    matrices : ndarray (q, r * r)
    """

    order: int
    shapes: np.ndarray
    matrices: np.ndarray

    def coefficients(self, weights: Sequence[np.ndarray | float]) -> np.ndarray:
        """Coefficients (b, q) of a batch of weights; a number stands for equal weights."""
        k = len(self.shapes)
        return np.array([np.broadcast_to(w, (k,)) for w in weights]) @ self.shapes


@dataclass(frozen=True)
class CollocatedSystem:
    """Small matrices (r, r) of any design point as sums of few fixed matrices.

    Attributes
    ----------
    r : int
    expansions : tuple of Expansion
        None of a mass that is the identity at every design point.
    unit_mass : bool
    """

    r: int
    expansions: tuple[Expansion, ...]
    unit_mass: bool

    def matrices(self, batch: Sequence[Weights], kept: Sequence[int] = ()) -> Matrices:
        """C, K (b, r, r) of a batch of design points, premultiplied by M^-1 where M varies.

        Parameters
        ----------
        batch : sequence of Weights
            Of the full system, in the order of its terms.
        kept : sequence of int
            Terms to sum; all by default.
        """
        parts = {order: np.zeros((len(batch), self.r**2)) for order in (STIFFNESS, DAMPING, MASS)}
        for number, expansion in enumerate(self.expansions):
            if (kept and number not in kept) or not len(expansion.shapes.T):
                continue
            c = expansion.coefficients([w[number] for w in batch])
            if c.any():
                parts[expansion.order] += c @ expansion.matrices
        shape = (len(batch), self.r, self.r)
        C, K = parts[DAMPING].reshape(shape), parts[STIFFNESS].reshape(shape)
        if self.unit_mass or kept:
            return C, K
        M = parts[MASS].reshape(shape)
        return np.linalg.solve(M, C), np.linalg.solve(M, K)

    def mass(self, weights: Weights) -> np.ndarray:
        """M (r, r) at one design point."""
        if self.unit_mass:
            return np.eye(self.r)
        total = np.zeros(self.r**2)
        for number, expansion in enumerate(self.expansions):
            if expansion.order == MASS:
                total += (expansion.coefficients([weights[number]]) @ expansion.matrices)[0]
        return total.reshape(self.r, self.r)


def collocate(
    system: ParametricSystem,
    samples: Sequence[Weights],
    W: np.ndarray,
    V: np.ndarray,
    tolerance: float,
) -> CollocatedSystem:
    """Project a system on bases W, V (n, r) and expand its weights over sampled design points.

    Parameters
    ----------
    samples : sequence of Weights
        Of design points that fill the box.
    tolerance : float
        Singular values of the weights, relative to the largest, below which shapes are dropped.
    """
    expansions = []
    unit = _unit_mass(system, samples, W, V)
    r = V.shape[1]
    for number, term in enumerate(system.terms):
        left, right = term.seen_left(W), term.seen_right(V)
        sampled = [s[number] for s in samples]
        if term.order == MASS and unit:
            expansions.append(Expansion(MASS, np.zeros((1, 0)), np.zeros((0, r * r))))
            continue
        shapes = _shapes(sampled, tolerance)
        if len(shapes) == 1:
            products = [left.T @ right] * shapes.shape[1]
        else:
            products = [left.T @ (phi[:, None] * right) for phi in shapes.T]
        flat = np.array([p.ravel() for p in products]).reshape(len(products), r * r)
        expansions.append(Expansion(term.order, shapes, flat))
    return CollocatedSystem(r, tuple(expansions), unit)


def _shapes(sampled: Sequence[np.ndarray | float], tolerance: float) -> np.ndarray:
    """Orthonormal shapes (k, q) of the weights; k = 1 for scalars, q = 0 where all vanish."""
    longest = max(np.size(w) for w in sampled)
    A = np.array([np.broadcast_to(np.atleast_1d(w), (longest,)) for w in sampled]).T
    if not A.any():
        return np.zeros((longest, 0))
    if longest == 1:
        return np.ones((1, 1))
    U, s, _ = la.svd(A, full_matrices=False)
    return np.ascontiguousarray(U[:, s > tolerance * s[0]])


def _unit_mass(
    system: ParametricSystem, samples: Sequence[Weights], W: np.ndarray, V: np.ndarray
) -> bool:
    total = np.zeros((V.shape[1], V.shape[1]))
    for number, term in enumerate(system.terms):
        if term.order == MASS:
            values = [s[number] for s in samples]
            if any(np.size(v) > 1 or v != values[0] for v in values):
                return False
            total += float(values[0]) * (term.seen_left(W).T @ term.seen_right(V))
    return bool(np.abs(total - np.eye(len(total))).max() < 1e-9)
