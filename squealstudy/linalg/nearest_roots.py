"""Roots of a quadratic pencil nearest a complex shift, with right and left vectors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse.linalg as spla

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import right_pairs
from squealstudy.linalg.quadratic_pencil import QuadraticPencil, ShiftedFactor

DENSE_LIMIT = 40  # coordinates of models too small for Arnoldi
LEAST_SPACE = 20  # vectors of an Arnoldi space
TOLERANCE = 1e-12  # of 1 / (lambda - sigma): of a change of lambda, as sigma is beside the old root
Solve = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Roots:
    """Roots (k,) [rad/s], nearest first, right vectors and left vectors (n, k)."""

    lam: np.ndarray
    X: np.ndarray
    Y: np.ndarray


def nearest_roots(
    pencil: QuadraticPencil,
    factor: ShiftedFactor,
    sigma: complex,
    count: int,
    start: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The `count` roots nearest `sigma`, by Arnoldi on the shifted and inverted companion form.

    With z = [u; v], Q(sigma) a = -(M (v + sigma u) + C u) and b = u + sigma a give [a; b], the
    image of z; an eigenvector is [x; lambda x], its value 1 / (lambda - sigma).

    Parameters
    ----------
    pencil : QuadraticPencil
    factor : ShiftedFactor
        Of Q(sigma).
    start : ndarray (n,) or None
        Guess of a vector; without, a fixed random one.

    Returns
    -------
    lam : ndarray (k,) complex
        rad/s, nearest first; k may be less than `count` in a small model.
    X : ndarray (n, k) complex
        Right vectors, unit 2-norm.

    Raises
    ------
    ConvergenceError
        ``not_converged`` where ARPACK stops.
    """
    return _nearest(pencil, factor.solve, sigma, count, start)


def nearest_two_sided(
    pencil: QuadraticPencil, factor: ShiftedFactor, sigma: complex, count: int
) -> Roots:
    """The same with the left vectors, y^H Q(lambda) = 0, paired by their roots."""
    lam, X = nearest_roots(pencil, factor, sigma, count)
    mu, Y = _nearest(pencil.adjoint(), factor.solve_adjoint, np.conj(sigma), count, None)
    # equal multisets up to round-off; the last ones may differ where the count cuts a pair
    order = _matched(lam, mu.conj())
    kept = np.flatnonzero(order >= 0)
    return Roots(lam[kept], X[:, kept], Y[:, order[kept]])


def _matched(lam: np.ndarray, other: np.ndarray) -> np.ndarray:
    """For each root the index of its own among `other`, -1 where there is none left."""
    order = np.full(len(lam), -1)
    free = np.ones(len(other), dtype=bool)
    for i, root in enumerate(lam):
        distance = np.where(free, np.abs(other - root), np.inf)
        j = int(np.argmin(distance))
        if distance[j] <= 1e-4 * np.abs(root):
            order[i], free[j] = j, False
    return order


def _nearest(
    pencil: QuadraticPencil, solve: Solve, sigma: complex, count: int, start: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    n = pencil.n
    if n <= DENSE_LIMIT:
        return _dense(pencil, sigma, count)

    size = abs(sigma)  # scales time: both halves of [x; lambda x] are of one size

    def invert(z: np.ndarray) -> np.ndarray:
        u, v = z[:n], z[n:] * size
        a = -solve(pencil.M @ (v + sigma * u) + pencil.C @ u)
        return np.concatenate([a, (u + sigma * a) / size])

    x = np.random.default_rng(0).standard_normal(n) if start is None else start
    operator = spla.LinearOperator((2 * n, 2 * n), matvec=invert, dtype=complex)
    v0 = np.concatenate([x, sigma / size * x]).astype(complex)
    ncv = min(2 * n, max(2 * count + 4, LEAST_SPACE))
    try:
        theta, z = spla.eigs(operator, k=count, which="LM", v0=v0, ncv=ncv, tol=TOLERANCE)
    except spla.ArpackNoConvergence as error:
        raise ConvergenceError("not_converged", f"roots near a shift: {error}") from error
    return _sorted(sigma + 1 / theta, z[:n], sigma, count)


def _dense(pencil: QuadraticPencil, sigma: complex, count: int) -> tuple[np.ndarray, np.ndarray]:
    one = np.eye(pencil.n)
    M, C, K = (np.asarray(A @ one) for A in (pencil.M, pencil.C, pencil.K))
    return _sorted(*right_pairs(C, K, M), sigma, count)


def _sorted(
    lam: np.ndarray, X: np.ndarray, sigma: complex, count: int
) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(np.abs(lam - sigma))[:count]
    X = X[:, order]
    return lam[order], X / np.linalg.norm(X, axis=0)
