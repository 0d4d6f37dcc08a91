"""Polynomial interpolation over boxes of any dimension: total degree, few well-placed nodes."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.linalg as la

MOST_CANDIDATES = 4000
MOST_SPREAD = 250  # points that stand for a whole box


@dataclass(frozen=True)
class Interpolation:
    """Interpolation by polynomials of a total degree on [-1, 1]^d.

    Attributes
    ----------
    nodes : ndarray (q, d)
    powers : tuple of tuples of int
        Chebyshev degrees of each of the q basis polynomials.
    inverse : ndarray (q, q)
        Coefficients of each node's cardinal polynomial, one a column.
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
    """Points (n, d) that stand for the box [-1, 1]^d: a regular grid with all its corners."""
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
    one = np.ones(len(xi))
    columns = [
        np.prod([one, *(T[degree, :, j] for j, degree in enumerate(a))], axis=0) for a in powers
    ]
    return np.stack(columns, axis=1)
