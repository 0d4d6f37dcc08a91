"""Real modes of symmetric sparse pencils K phi = omega^2 M phi, by shift-invert block Lanczos.

The Krylov space grows from a block of random states: a few at a time share one pass through a
sparse factor, which is what a solve waits for, and as many copies of a multiple eigenvalue as the
block has columns are found, not by round-off alone (Golub and Underwood 1977).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.linalg.factor import RefinedFactor, factorise

# The shift is negative, so that K - s M is definite for free bodies too, and goes with the cutoff:
# at a twentieth of it the rigid modes outweigh the highest ones and leave them residuals a thousand
# times larger (1e-10 against 3e-14 on the coarse pad), at the same time.
SHIFT_SHARE = 1 / 6  # of the cutoff
DENSE_LIMIT = 400
# states before the first test of convergence, and 1 in so many between two
FIRST_TEST_SIZE, TEST_GROWTH_DIVISOR = 48, 12
# of the degrees of freedom: a Krylov space that is larger costs more than LAPACK
MAX_KRYLOV_SHARE = 0.4
# residual of a mode, of its theta = 1 / (omega^2 - shift); squared by refining
CONVERGED_RESIDUAL = 1e-10
REL_RESIDUAL_FLOOR = 1e-14  # and of the largest theta: without a shift no residual gets below
MAX_REL_ROUND_OFF = 1e-6  # of theta: where that is more than this of it, another shift is needed
# of the highest frequency of a single degree of freedom: far above round-off
RIGID_FREQUENCY_RATIO = 1e-6
LANCZOS_BLOCK_SIZE = 4  # states at a time: more make a larger space, fewer use a factor worse
# of an image's squared size: what is outside the space by less is round-off
DEPENDENCE_TOLERANCE_SQUARED = 1e-28
GRAM_SCHMIDT_PASSES = 2  # of Gram and Schmidt


def real_modes(
    M: sp.spmatrix,
    K: sp.spmatrix,
    cutoff_hz: float,
    factor: RefinedFactor | None = None,
    shift: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """All modes up to `cutoff_hz`, mass-normalised and ascending.

    A Krylov space grows until the modes up to the first one beyond the cutoff have converged.

    Parameters
    ----------
    M, K : sparse or ndarray (n, n)
        Positive definite and positive semi-definite.
    cutoff_hz : float
        Modes above are dropped.
    factor : RefinedFactor or None
        Of K + shift M, where it is there already.
    shift : float or None
        (rad/s)^2; None: that of `shifted`, which is used, too, where this one is too far from the
        modes.

    Returns
    -------
    omega : ndarray (m,)
        rad/s; rigid-body modes come out as 0 within round-off.
    phi : ndarray (n, m)
        phi^T M phi = I.
    """
    n = M.shape[0]
    limit = (2 * np.pi * cutoff_hz) ** 2
    if n > DENSE_LIMIT:
        factorised = (
            factorise(shifted(M, K, cutoff_hz), definite=True) if factor is None else factor
        )
        phi = _space_below(M, factorised, limit, SHIFT_SHARE**2 * limit if shift is None else shift)
        if phi is not None:  # from unrefined solves: what they lack is mended here
            return _clip(*_refine(M, K, factorised.lean()(M @ phi)), limit)
        if shift is not None:
            return real_modes(M, K, cutoff_hz)
    w2, phi = la.eigh(*(A if isinstance(A, np.ndarray) else A.toarray() for A in (K, M)))
    return _clip(w2, phi, limit)


def _space_below(
    M: sp.spmatrix, factor: RefinedFactor, limit: float, shift: float
) -> np.ndarray | None:
    """Modes (n, m) with omega^2 <= limit and the next; None where they are most of all.

    And where they drown in round-off of the softest one.
    """
    space = BlockKrylov(factor.solve_once, M.shape[0], M)
    size = FIRST_TEST_SIZE
    while size <= MAX_KRYLOV_SHARE * M.shape[0]:
        space.grow(size)
        theta, y = la.eigh((space.projected + space.projected.T) / 2)
        theta, y = theta[::-1], y[:, ::-1]
        if REL_RESIDUAL_FLOOR * theta[0] > MAX_REL_ROUND_OFF / (limit + shift):
            return None
        inside = int((theta >= 1.0 / (limit + shift)).sum())
        if inside < space.size:
            y = y[:, : inside + 1]
            allowed = np.maximum(
                CONVERGED_RESIDUAL * theta[: inside + 1], REL_RESIDUAL_FLOOR * theta[0]
            )
            if (space.left_out(y) <= allowed).all():
                return space.vectors @ y
        size = space.size + max(2 * LANCZOS_BLOCK_SIZE, space.size // TEST_GROWTH_DIVISOR)
    return None


def shifted(M: sp.spmatrix, K: sp.spmatrix, cutoff_hz: float) -> sp.csr_matrix:
    """K + (SHIFT_SHARE 2 pi cutoff)^2 M: what `real_modes` factors for modes up to a cutoff.

    K itself where there is no cutoff: all modes are LAPACK's then.
    """
    shift = (SHIFT_SHARE * 2 * np.pi * cutoff_hz) ** 2 if np.isfinite(cutoff_hz) else 0.0
    total = K + shift * M
    return total if isinstance(total, np.ndarray) else total.tocsr()


def rigid_modes(M: sp.spmatrix, K: sp.spmatrix, omega: np.ndarray) -> int:
    """How many of the real modes omega [rad/s] of a free body are rigid: zero but for round-off."""
    highest = np.sqrt(np.abs(K.diagonal()) / M.diagonal()).max()
    return int((omega <= RIGID_FREQUENCY_RATIO * highest).sum())


def _refine(M: sp.spmatrix, K: sp.spmatrix, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rayleigh-Ritz twice on modes sharpened by an inverse iteration.

    Lanczos stops at residuals near 1e-9; component modes must be diagonal in K to 1e-12. The
    second pass removes the round-off that the unequal sizes leave in the first.
    """
    phi = phi / np.sqrt(np.einsum("ij,ij->j", phi, M @ phi))
    for _ in range(2):
        w2, y = la.eigh(phi.T @ (K @ phi), phi.T @ (M @ phi))
        phi = phi @ y
    return w2, phi


def _clip(w2: np.ndarray, phi: np.ndarray, limit: float) -> tuple[np.ndarray, np.ndarray]:
    within = w2 <= limit
    return np.sqrt(np.maximum(w2[within], 0.0)), np.ascontiguousarray(phi[:, within])


class BlockKrylov:
    """Orthonormal states V with V^T M A V, grown a block at a time (Arnoldi's method, of blocks).

    Parameters
    ----------
    apply : callable
        Product (n, b) of S with real (n, b); A = S M.
    n : int
    mass : sparse (n, n) or None
        M of the inner product, symmetric; None is the identity.
    """

    def __init__(
        self,
        apply: Callable[[np.ndarray], np.ndarray],
        n: int,
        mass: sp.spmatrix | None,
    ) -> None:
        self._apply, self._mass, self.size = apply, mass, 0
        self._V = np.empty((n, 16 * LANCZOS_BLOCK_SIZE), order="F")
        self._H = np.zeros((16 * LANCZOS_BLOCK_SIZE, 16 * LANCZOS_BLOCK_SIZE))
        self._random = np.random.default_rng(0)  # the same operator has the same space
        self._next = np.zeros((n, 0))  # M times the block that is mapped next
        self._append(*self._orthonormal(self._random.standard_normal((n, LANCZOS_BLOCK_SIZE)))[:2])

    @property
    def vectors(self) -> np.ndarray:
        """Orthonormal states of the space (n, size)."""
        return self._V[:, : self.size]

    @property
    def projected(self) -> np.ndarray:
        """V^T M A V (size, size)."""
        return self._H[: self.size, : self.size]

    def left_out(self, y: np.ndarray) -> np.ndarray:
        """Sizes (k,) of what the images of V y, y (size, k), have outside of the space."""
        leaves = self._H[
            self.size : self.size + LANCZOS_BLOCK_SIZE, self.size - LANCZOS_BLOCK_SIZE : self.size
        ]
        size: np.ndarray = la.norm(leaves @ y[-LANCZOS_BLOCK_SIZE:], axis=0)
        return size

    def grow(self, size: int) -> None:
        """Grow to at least `size` states."""
        while self.size < size:
            end = self.size + LANCZOS_BLOCK_SIZE
            image = self._apply(np.ascontiguousarray(self._next))
            self.size = end
            Q, MQ, along, R = self._orthonormal(image)
            self._append(Q, MQ)
            self._H[:end, end - LANCZOS_BLOCK_SIZE : end] = along
            self._H[end : end + LANCZOS_BLOCK_SIZE, end - LANCZOS_BLOCK_SIZE : end] = R

    def _append(self, Q: np.ndarray, MQ: np.ndarray) -> None:
        """Make states the block that is mapped next."""
        end = self.size + LANCZOS_BLOCK_SIZE
        if end > self._V.shape[1]:
            self._V = _wider(self._V)
            self._H = np.pad(self._H, (0, len(self._H)))
        self._V[:, self.size : end] = Q
        self._next = MQ

    def _orthonormal(self, W: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Q, M Q (n, b), H (size, b), R (b, b) with W = V H + Q R; Q of unit states outside V.

        Where W has nothing more outside of V, random states take its place.
        """
        V = self._V[:, : self.size]
        along, R = np.zeros((self.size, LANCZOS_BLOCK_SIZE)), np.eye(LANCZOS_BLOCK_SIZE)
        MW = self._weigh(W)
        min_norm_squared = DEPENDENCE_TOLERANCE_SQUARED * max(
            float(np.einsum("ij,ij->", W, MW)), 0.0
        )
        for _ in range(GRAM_SCHMIDT_PASSES):
            h = _projected(V, MW)
            W = W - _summed(V, h)
            MW = self._weigh(W)
            d, y = la.eigh(W.T @ MW)
            independent = d > min_norm_squared
            scale = np.where(independent, 1.0 / np.sqrt(np.where(independent, d, 1.0)), 0.0)
            along = along + h @ R
            R = (scale * d)[:, None] * y.T @ R
            W, MW = W @ (y * scale), MW @ (y * scale)
            if not independent.all():
                W[:, ~independent] = self._random.standard_normal(
                    (len(W), int((~independent).sum()))
                )
                W[:, ~independent] = self._outside(W[:, ~independent], W[:, independent])
                MW = self._weigh(W)
            min_norm_squared = 0.0
        return W, MW, along, R

    def _weigh(self, W: np.ndarray) -> np.ndarray:
        """M W."""
        weighed: np.ndarray = W if self._mass is None else self._mass @ W
        return weighed

    def _outside(self, X: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Unit states of the span of X outside of V and of other unit states."""
        V = self._V[:, : self.size]
        for _ in range(GRAM_SCHMIDT_PASSES):
            MX = self._weigh(X)
            X = X - _summed(V, _projected(V, MX)) - others @ (others.T @ MX)
            d, y = la.eigh(X.T @ self._weigh(X))
            X = X @ (y / np.sqrt(d))
        return X


def _projected(V: np.ndarray, W: np.ndarray) -> np.ndarray:
    """V^T W of few W (n, b); of V (n, k) by columns BLAS takes two thirds of the time so."""
    return (W.T @ V).T


def _summed(V: np.ndarray, h: np.ndarray) -> np.ndarray:
    """V h of few h (k, b), in half the time."""
    return (h.T @ V.T).T


def _wider(A: np.ndarray) -> np.ndarray:
    wider = np.empty((len(A), 2 * A.shape[1]), order="F")
    wider[:, : A.shape[1]] = A
    return wider
