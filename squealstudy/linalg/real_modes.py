"""Real modes of symmetric sparse pencils K phi = omega^2 M phi, by shift-invert block Lanczos.

The Krylov space grows from a block of random states. States of a block share one pass through the
sparse factor, whose reading takes most of the time of a solve. A block also finds as many copies of
a multiple eigenvalue as it has columns, without the help of round-off (Golub and Underwood 1977).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.linalg.factor import RefinedFactor, factorise

# Square root of the shift in K + shift M over the cutoff's angular frequency. The shift makes the
# matrix definite for free bodies too. With a twentieth, rigid modes outweigh the highest ones and
# leave them residuals a thousand times larger (1e-10 against 3e-14 on the coarse pad).
SHIFT_SHARE = 1 / 6
DENSE_LIMIT = 400  # most degrees of freedom for which LAPACK computes all modes
# states before the first test of convergence; the space then grows by 1/12 between two tests
FIRST_TEST_SIZE, TEST_GROWTH_DIVISOR = 48, 12
# largest Krylov space over the degrees of freedom: a larger one costs more than LAPACK
MAX_KRYLOV_SHARE = 0.4
# residual of a converged mode over its theta = 1 / (omega^2 + shift); refining squares it
CONVERGED_RESIDUAL = 1e-10
REL_RESIDUAL_FLOOR = 1e-14  # round-off of a residual over the largest theta: none is smaller
# round-off over the theta of the limit, above which another shift is needed
MAX_REL_ROUND_OFF = 1e-6
# frequency of a rigid mode over the highest frequency of a single degree of freedom, at most
RIGID_FREQUENCY_RATIO = 1e-6
LANCZOS_BLOCK_SIZE = (
    4  # states of a block: more make the space larger, fewer use the factor less well
)
# squared norm of a state outside the space, over that of its block, below which it is round-off
DEPENDENCE_TOLERANCE_SQUARED = 1e-28
GRAM_SCHMIDT_PASSES = 2


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
        Mass, positive definite, and stiffness, positive semi-definite.
    cutoff_hz : float
        Highest frequency of the modes, Hz.
    factor : RefinedFactor or None
        Factor of K + shift M, if computed before.
    shift : float or None
        Shift of that factor, (rad/s)^2; None for that of `shifted`, which is also used where the
        given one is too far from the modes.

    Returns
    -------
    omega : ndarray (m,)
        Angular frequencies, rad/s; those of rigid-body modes are 0 to round-off.
    phi : ndarray (n, m)
        Mode shapes with phi^T M phi = I.
    """
    n = M.shape[0]
    limit = (2 * np.pi * cutoff_hz) ** 2
    if n > DENSE_LIMIT:
        factorised = (
            factorise(shifted(M, K, cutoff_hz), definite=True) if factor is None else factor
        )
        phi = _space_below(M, factorised, limit, SHIFT_SHARE**2 * limit if shift is None else shift)
        if phi is not None:  # refining mends the error of unrefined solves
            return _clip(*_refine(M, K, factorised.lean()(M @ phi)), limit)
        if shift is not None:
            return real_modes(M, K, cutoff_hz)
    w2, phi = la.eigh(*(A if isinstance(A, np.ndarray) else A.toarray() for A in (K, M)))
    return _clip(w2, phi, limit)


def _space_below(
    M: sp.spmatrix, factor: RefinedFactor, limit: float, shift: float
) -> np.ndarray | None:
    """Modes (n, m) with omega^2 <= limit [(rad/s)^2], and the next one.

    None where they are too many for a Krylov space, or lost in the round-off of the softest one.
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
    """K + (SHIFT_SHARE 2 pi cutoff)^2 M, which `real_modes` factorises for modes up to a cutoff.

    It is K itself at an infinite cutoff, where LAPACK computes all modes.
    """
    shift = (SHIFT_SHARE * 2 * np.pi * cutoff_hz) ** 2 if np.isfinite(cutoff_hz) else 0.0
    total = K + shift * M
    return total if isinstance(total, np.ndarray) else total.tocsr()


def rigid_modes(M: sp.spmatrix, K: sp.spmatrix, omega: np.ndarray) -> int:
    """Number of rigid modes among frequencies omega (m,) [rad/s], which are 0 but for round-off."""
    highest = np.sqrt(np.abs(K.diagonal()) / M.diagonal()).max()
    return int((omega <= RIGID_FREQUENCY_RATIO * highest).sum())


def _refine(M: sp.spmatrix, K: sp.spmatrix, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rayleigh-Ritz, twice, on modes phi (n, m) after a step of inverse iteration.

    Residuals of Lanczos' method are near 1e-9, but component modes must be diagonal in K to 1e-12.
    The second pass removes round-off of the first, by modes of unequal size.
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
    """An orthonormal basis V of a Krylov space, and V^T M A V, by the block Arnoldi method.

    Parameters
    ----------
    apply : callable
        Returns S X (n, b) of real X (n, b), where A = S M.
    n : int
        Number of rows of a state.
    mass : sparse (n, n) or None
        M of the inner product, symmetric; None for the identity.
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
        self._random = np.random.default_rng(0)  # a given operator always has the same space
        self._next = np.zeros((n, 0))  # M times the block to which A is applied next
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
        """Norms (k,) of the parts of A V y outside the space, for y (size, k)."""
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
        """Add the block Q to the space; A is applied to it next."""
        end = self.size + LANCZOS_BLOCK_SIZE
        if end > self._V.shape[1]:
            self._V = _wider(self._V)
            self._H = np.pad(self._H, (0, len(self._H)))
        self._V[:, self.size : end] = Q
        self._next = MQ

    def _orthonormal(self, W: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Q, M Q (n, b), H (size, b), R (b, b) with W = V H + Q R, and Q orthonormal to V.

        Columns of W that depend on V are replaced by random states.
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
        """Orthonormalise X against V, orthonormal `others` and itself."""
        V = self._V[:, : self.size]
        for _ in range(GRAM_SCHMIDT_PASSES):
            MX = self._weigh(X)
            X = X - _summed(V, _projected(V, MX)) - others @ (others.T @ MX)
            d, y = la.eigh(X.T @ self._weigh(X))
            X = X @ (y / np.sqrt(d))
        return X


def _projected(V: np.ndarray, W: np.ndarray) -> np.ndarray:
    """V^T W for narrow W (n, b): two thirds of the time of V.T @ W with V in column order."""
    return (W.T @ V).T


def _summed(V: np.ndarray, h: np.ndarray) -> np.ndarray:
    """V h for narrow h (k, b): half the time of V @ h."""
    return (h.T @ V.T).T


def _wider(A: np.ndarray) -> np.ndarray:
    wider = np.empty((len(A), 2 * A.shape[1]), order="F")
    wider[:, : A.shape[1]] = A
    return wider
