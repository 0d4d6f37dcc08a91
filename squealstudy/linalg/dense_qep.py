"""Roots of a dense quadratic eigenproblem in a band or a circle: Arnoldi where that is certain.

With mu = lambda - sigma the roots of lambda^2 I + lambda C + K are those of

    mu^2 I + mu C_s + K_s,    C_s = C + 2 sigma I,    K_s = K + sigma C + sigma^2 I,

and those nearest to the shift are the largest theta = s / mu of the inverse companion form. They
all follow from one LU factorisation of K_s and the Schur form of a Krylov space, with about twice
as many vectors as there are roots inside; LAPACK's QR would compute all 2n roots and vectors.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.linalg as la

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import (
    Eigenpairs,
    all_pairs,
    drowned,
    pairs_up_to,
)
from squealstudy.linalg.quadratic_pencil import product
from squealstudy.root_pairs import one_of_each_pair

KRYLOV_MIN_SIZE = 60  # for more coordinates a Krylov space is less work than LAPACK's QR
# roots in the circle over all 2n, above which the space costs as much as LAPACK's QR
KRYLOV_MAX_ROOT_SHARE = 0.25
# shifts over the circle's radius; the second is used where the first fails, as next to a root
SHIFTS_OVER_RADIUS = (0.05, 0.083)
# roots up to this times the radius are computed too, so that the next ones are well apart
SEARCH_RADIUS_FACTOR = 1.1
# vectors of the first space: for each expected root, and in addition
VECTORS_PER_ROOT, EXTRA_VECTORS = 1.8, 30
SPACE_GROWTH = 1.25  # factor on the size of a space that is too small
CONVERGED_RESIDUAL = 1e-14  # largest residual of a converged root in the circle, over |theta|
# the same for roots up to SEARCH_RADIUS_FACTOR: enough to know that none was missed
OUTER_RESIDUAL_TOLERANCE = 1e-3
# |theta| of a root next to the shift, above which its round-off spoils the others
MAX_SHIFTED_EIGENVALUE = 1e4
RESIDUAL_TOLERANCE = 1e-10  # largest |Q(lambda) x| / |lambda^2 x| of an accepted pair
PROBE_STEPS = 36  # steps of the search for missed roots: enough to amplify one by 1e7
# part of an image outside the space, over its norm, below which it is round-off
INVARIANCE_TOLERANCE = 1e-14

Inside = tuple[np.ndarray, np.ndarray]  # roots in a circle and their right vectors
# condition of the products of left and right vectors above which, next to an exceptional point,
# LAPACK computes the left vectors
WORST_PRODUCTS = 1e9


def real_modes_to_know(radius: float) -> float:
    """Frequency [rad/s] up to which real modes are counted to estimate the roots in a circle."""
    return SEARCH_RADIUS_FACTOR * radius


def roots_inside(
    C: np.ndarray, K: np.ndarray, radius: float, real_modes: int | None = None
) -> Inside | None:
    """All roots of lambda^2 I + lambda C + K with |lambda| <= radius and their right vectors.

    It is tested that none is missing, nor a copy of a multiple one: a Krylov space from another
    random start, in the complement of the subspace found, must have no root in the circle.

    Parameters
    ----------
    C, K : ndarray (n, n)
        Real, of any symmetry; K may be singular.
    radius : float
        Radius of the circle, rad/s.
    real_modes : int or None
        Number of real modes up to `real_modes_to_know`, or about so many, from which the number of
        roots is guessed; None to count them.

    Returns
    -------
    lam : ndarray (m,) complex
        Roots, rad/s, conjugates included, in any order.
    X : ndarray (n, m) complex
        Right vectors. None is returned in place of both where the roots could not be certified, or
        LAPACK's QR costs less, for small matrices or many roots.
    """
    if len(K) < KRYLOV_MIN_SIZE or not 0 < radius < np.inf:
        return None
    for share in SHIFTS_OVER_RADIUS:
        try:
            if real_modes is None:
                real_modes = _real_modes_below(K, real_modes_to_know(radius))
            expected = 2 * real_modes
            if expected > 2 * KRYLOV_MAX_ROOT_SHARE * len(K):
                return None
            form = _InverseCompanion(C, K, share * radius, radius)
            near_shift = _roots_in_reach(form, radius, expected)
            if _nothing_left(form, near_shift.Z, radius):
                X = near_shift.states[form.n :]
                return _accurate(C, K, form.roots(near_shift.theta), X, radius)
        except la.LinAlgError:
            continue
    return None


def _real_modes_below(K: np.ndarray, omega: float) -> int:
    """Eigenvalues of the symmetric part of K below omega^2, counted by Sylvester's law."""
    shifted = (K + K.T) / 2
    shifted[np.diag_indices_from(shifted)] -= omega**2
    _, D, _ = la.ldl(shifted, overwrite_a=True, check_finite=False)
    pivots = la.eigvalsh_tridiagonal(np.diag(D), np.diag(D, 1), check_finite=False)
    return int((pivots < 0).sum())


class _InverseCompanion:
    """Products with the inverse companion form about a shift, in the state [x; theta x].

    Parameters
    ----------
    C, K : ndarray (n, n)
    sigma : float
        The shift, rad/s.
    scale : float
        Scale s of time, rad/s.

    Raises
    ------
    LinAlgError
        The shift is a root.
    """

    def __init__(self, C: np.ndarray, K: np.ndarray, sigma: float, scale: float) -> None:
        self.n, self.sigma, self.scale = len(K), sigma, scale
        diagonal = np.diag_indices_from(K)
        self._C = scale * C
        self._C[diagonal] += 2 * sigma * scale
        K_s = K + sigma * C
        K_s[diagonal] += sigma**2
        factorise, self._solve = la.get_lapack_funcs(("getrf", "getrs"), (K_s,))
        self._lu, self._pivots, info = factorise(K_s, overwrite_a=True)
        if info:
            raise la.LinAlgError("the shift is a root")

    def apply(self, z: np.ndarray) -> np.ndarray:
        """Image of a real state (2n,)."""
        x, y = z[: self.n], z[self.n :]
        solved, _ = self._solve(self._lu, self._pivots, self._C @ y + self.scale**2 * x)
        return np.concatenate([y, -solved])

    def holds(self, theta: complex | np.ndarray, radius: float) -> bool | np.ndarray:
        """Whether roots are in the circle about zero: |sigma + s / theta| <= radius."""
        return np.abs(self.sigma * theta + self.scale) <= radius * np.abs(theta)

    def roots(self, theta: np.ndarray) -> np.ndarray:
        """Roots lambda [rad/s] of eigenvalues theta of the inverse form."""
        lam: np.ndarray = self.sigma + self.scale / theta
        return lam


class _Krylov:
    """A Krylov space of real states, orthogonal to given ones.

    Parameters
    ----------
    apply : callable
    locked : ndarray (N, k)
        Orthonormal states to which the space is kept orthogonal.
    max_size : int
        Largest number of its vectors.
    seed : int
        Seed of its random start.
    """

    def __init__(
        self,
        apply: Callable[[np.ndarray], np.ndarray],
        locked: np.ndarray,
        max_size: int,
        seed: int,
    ) -> None:
        self._apply, self._held, self.size = apply, locked.shape[1], 0
        self._V = np.empty((len(locked), self._held + max_size + 1), order="F")
        self._V[:, : self._held] = locked
        self._random = np.random.default_rng(seed)
        self._H = np.zeros((max_size + 1, max_size))
        self._put(self._random.standard_normal(len(locked)))

    @property
    def vectors(self) -> np.ndarray:
        """Orthonormal states of the Krylov space (N, m)."""
        return self._V[:, self._held : self._held + self.size]

    @property
    def hessenberg(self) -> np.ndarray:
        """The operator in the orthonormal states of the space (m, m)."""
        return self._H[: self.size, : self.size]

    @property
    def leaves(self) -> float:
        """Norm of the part of the last vector's image that is outside the space."""
        return float(self._H[self.size, self.size - 1])

    def grow(self, size: int) -> None:
        """Arnoldi's method up to `size` vectors, orthogonalised twice."""
        while self.size < size:
            j = self.size
            self.size += 1
            image = self._apply(self._V[:, self._held + j])
            length = math.sqrt(image @ image)
            along = self._put(image)
            self._H[: j + 1, j] = along[self._held : -1]
            self._H[j + 1, j] = along[-1]
            if (
                not along[-1] > INVARIANCE_TOLERANCE * length
            ):  # the space is invariant: continue from a random state
                self._H[j + 1, j] = 0.0
                self._put(self._random.standard_normal(len(image)))

    def _put(self, w: np.ndarray) -> np.ndarray:
        """Add a state as next vector; returns its components along all vectors, the new last."""
        basis = self._V[:, : self._held + self.size]
        first = basis.T @ w
        w = w - basis @ first
        again = basis.T @ w
        w = w - basis @ again
        length = math.sqrt(w @ w)
        self._V[:, self._held + self.size] = w / (length or 1.0)
        return np.concatenate([first + again, [length]])


class _RootsNearShift(NamedTuple):
    """Eigenvalues theta (k,) nearest to the shift, their states (2n, k), an orthonormal basis Z."""

    theta: np.ndarray
    states: np.ndarray
    Z: np.ndarray


def _roots_in_reach(form: _InverseCompanion, radius: float, expected: int) -> _RootsNearShift:
    """All roots in the circle, and those up to SEARCH_RADIUS_FACTOR that have appeared.

    `expected` is a guess of their number.

    Raises
    ------
    LinAlgError
        They do not converge or are too many, or one is so near the shift that its round-off spoils
        the others.
    """
    N = 2 * form.n
    most, size = (
        int(VECTORS_PER_ROOT * KRYLOV_MAX_ROOT_SHARE * N) + EXTRA_VECTORS,
        int(VECTORS_PER_ROOT * expected) + EXTRA_VECTORS,
    )
    space = _Krylov(form.apply, np.zeros((N, 0)), int(SPACE_GROWTH * max(most, size)), seed=0)

    def in_reach(real: float, imag: float = 0.0) -> bool:
        return bool(form.holds(complex(real, imag), SEARCH_RADIUS_FACTOR * radius))

    while size <= most:
        space.grow(size)
        T, Q, k = la.schur(space.hessenberg, "real", sort=in_reach, check_finite=False)
        theta, S = la.eig(T[:k, :k], check_finite=False)
        if np.abs(theta).max(initial=0.0) > MAX_SHIFTED_EIGENVALUE:
            raise la.LinAlgError("a root lies next to the shift")
        leaves = space.leaves * Q[-1, :k]
        missing = np.abs(leaves @ S) / np.abs(theta)
        inside = form.holds(theta, radius)
        if (
            k < size
            and (missing <= np.where(inside, CONVERGED_RESIDUAL, OUTER_RESIDUAL_TOLERANCE)).all()
        ):
            Z = space.vectors @ Q[:, :k]
            return _RootsNearShift(theta, product(Z, S), Z)
        size = int(SPACE_GROWTH * size)
    raise la.LinAlgError("the roots did not converge")


def _nothing_left(form: _InverseCompanion, Z: np.ndarray, radius: float) -> bool:
    """Whether the complement of an invariant subspace has no root in the circle.

    The form with the subspace Z projected out has the remaining eigenvalues. The largest of these
    belongs to a root outside the circle, unless one was missed.
    """
    steps = min(PROBE_STEPS, len(Z) - Z.shape[1] - 1)
    if steps < 1:
        return True
    space = _Krylov(form.apply, Z, steps, seed=1)
    space.grow(steps)
    theta = la.eigvals(space.hessenberg, check_finite=False)
    return not np.any(form.holds(theta, radius))


def _accurate(
    C: np.ndarray, K: np.ndarray, lam: np.ndarray, X: np.ndarray, radius: float
) -> Inside | None:
    """The roots in the circle, or None where one of their residuals is too large.

    Only roots with imaginary part >= 0 are tested, as conjugates have conjugate residuals.
    """
    in_circle = np.abs(lam) <= radius
    lam, X = lam[in_circle], X[:, in_circle] / np.linalg.norm(X[:, in_circle], axis=0)
    upper = lam.imag >= 0
    mu, Y = lam[upper], X[:, upper]
    R = Y * mu**2 + product(C, Y) * mu + product(K, Y)
    small = (
        np.linalg.norm(R, axis=0)
        <= RESIDUAL_TOLERANCE * np.maximum(np.abs(mu), SHIFTS_OVER_RADIUS[0] * radius) ** 2
    )
    return (lam, X) if small.all() else None


def dense_roots(
    C: np.ndarray, K: np.ndarray, band: tuple[float, float], real_modes: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """All roots in a band: by `roots_inside`, or by `companion_roots` where that cannot be certain.

    Parameters
    ----------
    C, K : ndarray (n, n)
        Damping and stiffness; the mass is the identity.
    band : (low, high)
        Bounds of |lambda|, rad/s.
    real_modes : int or None
        As in `roots_inside`, for the band's top.

    Returns
    -------
    lam : ndarray (m,) complex
        Real roots and one of each conjugate pair (imaginary part >= 0), rad/s, ascending in
        |lambda|.
    psi : ndarray (n, m) complex
        Right vectors of unit 2-norm.
    """
    pairs = roots_inside(C, K, band[1], real_modes)
    return companion_roots(C, K, band) if pairs is None else one_of_each_pair(*pairs, band)


def companion_roots(
    C: np.ndarray, K: np.ndarray, band: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Roots of the band out of all 2n; ConvergenceError where larger ones spoil them."""
    return one_of_each_pair(*pairs_up_to(C, K, band[1]), band)


def pairs_inside(C: np.ndarray, K: np.ndarray, radius: float) -> Eigenpairs:
    """All pairs with |lam| <= radius [rad/s], and perhaps others.

    Left vectors are right ones of the transposed problem, combined by their products with the right
    ones, G_ij = y_i^H (lam_i + lam_j + C) x_j, which vanish for different roots
    (THEORY.md eq. (33)).
    """
    right, left = roots_inside(C, K, radius), roots_inside(C.T, K.T, radius)
    if right is None or left is None or len(right[0]) != len(left[0]):
        return _told_pairs(C, K, radius)
    (lam, X), (mu, Z) = right, left
    G = (Z.T @ X) * (mu[:, None] + lam) + Z.T @ (C @ X)
    if len(lam) and not np.linalg.cond(G / np.abs(lam)) < WORST_PRODUCTS:
        return _told_pairs(C, K, radius)
    return Eigenpairs(lam, X, np.linalg.solve(G, Z.T).conj().T)


def _told_pairs(C: np.ndarray, K: np.ndarray, radius: float) -> Eigenpairs:
    """All pairs by LAPACK; ConvergenceError where round-off spoils those up to the radius."""
    pairs = all_pairs(C, K)
    if drowned(pairs.lam, radius):
        raise ConvergenceError("not_converged", "the roots of the band drown beside larger ones")
    return pairs


def backward_error(
    C: np.ndarray,
    K: np.ndarray,
    lam: np.ndarray,
    psi: np.ndarray,
    left_over: np.ndarray | None = None,
) -> np.ndarray:
    """Normwise backward error of each pair: |Q(lambda) psi| / (|lambda|^2 + |lambda||C| + |K|).

    `left_over` are the |Q(lambda) psi| (m,), if computed before.
    """
    if left_over is None:
        R = psi * lam**2 + product(C, psi) * lam + product(K, psi)
        left_over = np.linalg.norm(R, axis=0)
    size = np.abs(lam)
    norm = size**2 + size * np.linalg.norm(C) + np.linalg.norm(K)
    error: np.ndarray = left_over / (norm * np.linalg.norm(psi, axis=0))
    return error
