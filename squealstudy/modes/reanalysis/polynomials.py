"""Polynomials of a total degree over boxes of any dimension, and expanded parametric systems.

There is interpolation through few well-placed nodes, and a projected parametric system whose
weights are expanded in few terms, so that a batch of its matrices is one product.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.linalg as la

from squealstudy.system.parametric import DAMPING, MASS, STIFFNESS, ParametricSystem, Weights

MOST_CANDIDATES = 4000  # points of the grid that nodes are chosen from
MOST_SPREAD = 250  # points that represent a whole box
Matrices = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Interpolation:
    """Interpolation by polynomials of a total degree on [-1, 1]^d.

    Attributes
    ----------
    nodes : ndarray (q, d)
        Points at which values are given.
    powers : tuple of tuples of int
        Chebyshev degrees of each of the q basis polynomials.
    inverse : ndarray (q, q)
        Coefficients of the cardinal polynomial of each node, in columns.
    """

    nodes: np.ndarray
    powers: tuple[tuple[int, ...], ...]
    inverse: np.ndarray

    def cardinals(self, xi: np.ndarray) -> np.ndarray:
        """Values (n, q) of the cardinal polynomials at points xi (n, d)."""
        values: np.ndarray = _vandermonde(xi, self.powers) @ self.inverse
        return values


@lru_cache(maxsize=32)
def interpolation(degree: int, dimension: int) -> Interpolation:
    """Interpolation of a total degree in some dimensions.

    In one dimension the nodes are Chebyshev's; in more they are approximate Fekete points, chosen
    among a tensor grid by pivoted QR of the Vandermonde matrix.
    """
    powers = tuple(
        a for a in itertools.product(range(degree + 1), repeat=dimension) if sum(a) <= degree
    )
    nodes = _candidates(degree, dimension)
    if dimension > 1:
        pivots = la.qr(_vandermonde(nodes, powers).T, pivoting=True, mode="r")[1]
        nodes = nodes[np.sort(pivots[: len(powers)])]
    return Interpolation(nodes, powers, la.inv(_vandermonde(nodes, powers)))


@lru_cache(maxsize=32)
def spread_points(dimension: int) -> np.ndarray:
    """Points (n, d) that represent the box [-1, 1]^d: a regular grid with all its corners."""
    count = max(2, int(MOST_SPREAD ** (1 / max(dimension, 1))))
    line = np.linspace(-1.0, 1.0, count)
    return np.array(list(itertools.product(line, repeat=dimension)))


def _candidates(degree: int, dimension: int) -> np.ndarray:
    count = degree + 1
    if dimension > 1:
        count = max(degree + 1, min(4 * degree + 4, int(MOST_CANDIDATES ** (1 / dimension))))
    line = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    return np.array(list(itertools.product(line, repeat=dimension)))


def _vandermonde(xi: np.ndarray, powers: tuple[tuple[int, ...], ...]) -> np.ndarray:
    """Products of Chebyshev polynomials (n, q) at points (n, d), also outside the box."""
    highest = max((max(a, default=0) for a in powers), default=0)
    T = np.ones((highest + 1, *xi.shape))
    if highest:
        T[1] = xi
    for k in range(2, highest + 1):
        T[k] = 2.0 * xi * T[k - 1] - T[k - 2]
    ones = np.ones(len(xi))
    columns = [
        np.prod([ones, *(T[degree, :, j] for j, degree in enumerate(a))], axis=0) for a in powers
    ]
    return np.stack(columns, axis=1)


@dataclass(frozen=True)
class ExpandedWeights:
    """The weights of one term of the system, w = shapes c.

    Attributes
    ----------
    order : int
        Power of lambda that the term belongs to.
    shapes : ndarray (k, q)
        Orthonormal shapes of the weights; a single 1 for scalar weights.
    """

    order: int
    shapes: np.ndarray

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
        Number of coordinates.
    expansions : tuple of ExpandedWeights
        Expanded weights of each term; without shapes for a mass that is always the identity.
    stacks : tuple of three ndarray (q, r * r)
        Matrices of each power of lambda: L^T diag(shape) R for all shapes of its terms, in order.
        They are one array, so that a batch of design points is one product.
    unit_mass : bool
        Whether the mass is the identity at every design point.
    """

    r: int
    expansions: tuple[ExpandedWeights, ...]
    stacks: tuple[np.ndarray, ...]
    unit_mass: bool

    def matrices(self, batch: Sequence[Weights]) -> Matrices:
        """C, K (b, r, r) of a batch of design points, premultiplied by M^-1 where M varies.

        The weights are those of the full system, in the order of its terms.
        """
        C, K = self.summed(DAMPING, batch), self.summed(STIFFNESS, batch)
        if self.unit_mass:
            return C, K
        M = self.summed(MASS, batch)
        return np.linalg.solve(M, C), np.linalg.solve(M, K)

    def mass(self, weights: Weights) -> np.ndarray:
        """M (r, r) at one design point."""
        return np.eye(self.r) if self.unit_mass else self.summed(MASS, [weights])[0]

    def summed(self, order: int, batch: Sequence[Weights]) -> np.ndarray:
        """The terms of one power of lambda (b, r, r) at a batch of design points."""
        parts = [
            expansion.coefficients([w[number] for w in batch])
            for number, expansion in enumerate(self.expansions)
            if expansion.order == order
        ]
        c = np.hstack([np.zeros((len(batch), 0)), *parts])
        total: np.ndarray = c @ self.stacks[order]
        return total.reshape(len(batch), self.r, self.r)


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
        Weights at design points that fill the box.
    tolerance : float
        Singular value of the weights, relative to the largest, up to which shapes are left out.
    """
    expansions = []
    stacks: dict[int, list[np.ndarray]] = {STIFFNESS: [], DAMPING: [], MASS: []}
    unit = _unit_mass(system, samples, W, V)
    r = V.shape[1]
    for number, term in enumerate(system.terms):
        left_rows, right = term.left_product(W), term.right_product(V)
        if term.order == MASS and unit:
            expansions.append(ExpandedWeights(MASS, np.zeros((1, 0))))
            continue
        shapes = _shapes([s[number] for s in samples], tolerance)
        expansions.append(ExpandedWeights(term.order, shapes))
        if len(shapes) == 1:
            stacks[term.order] += [left_rows.T @ right] * shapes.shape[1]
        else:
            stacks[term.order] += [left_rows.T @ (phi[:, None] * right) for phi in shapes.T]
    flat = [np.array(stacks[order]).reshape(-1, r * r) for order in range(len(stacks))]
    return CollocatedSystem(r=r, expansions=tuple(expansions), stacks=tuple(flat), unit_mass=unit)


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
    """Whether the mass projected on W and V is the identity at all samples."""
    total = np.zeros((V.shape[1], V.shape[1]))
    for number, term in enumerate(system.terms):
        if term.order == MASS:
            values = [s[number] for s in samples]
            if any(np.size(v) > 1 or v != values[0] for v in values):
                return False
            total += float(values[0]) * (term.left_product(W).T @ term.right_product(V))
    return bool(np.abs(total - np.eye(len(total))).max() < 1e-9)
