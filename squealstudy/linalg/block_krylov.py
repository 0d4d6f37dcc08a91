"""A Krylov space from a block of random states: eigenvalues of large operators, largest first.

A few states at a time share one pass through a sparse factor, which is what a solve waits for, and
as many copies of a multiple eigenvalue as the block has columns are found, not by round-off alone
(Golub and Underwood 1977).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

BLOCK = 4  # states at a time: more make a larger space, fewer use a factor worse
DEPENDENT = 1e-28  # of an image's squared size: what is outside the space by less is round-off
PASSES = 2  # of Gram and Schmidt


class BlockKrylov:
    """Orthonormal states V with V^T M A V, grown a block at a time.

    Parameters
    ----------
    apply : callable
        Product (n, b) of S with real (n, b); A = S M.
    n : int
    mass : sparse (n, n) or None
        M of the inner product; None for the identity.
    """

    def __init__(
        self,
        apply: Callable[[np.ndarray], np.ndarray],
        n: int,
        mass: sp.spmatrix | None = None,
    ) -> None:
        self._apply, self._mass, self.size = apply, mass, 0
        self._V = np.empty((n, 16 * BLOCK), order="F")
        self._MV = self._V if mass is None else np.empty_like(self._V)
        self._H = np.zeros((16 * BLOCK, 16 * BLOCK))
        self._random = np.random.default_rng(0)  # the same operator has the same space
        self._append(*self._orthonormal(self._random.standard_normal((n, BLOCK)))[:2])

    @property
    def vectors(self) -> np.ndarray:
        """V (n, size)."""
        return self._V[:, : self.size]

    @property
    def projected(self) -> np.ndarray:
        """V^T M A V (size, size)."""
        return self._H[: self.size, : self.size]

    def left_out(self, y: np.ndarray) -> np.ndarray:
        """Sizes (k,) of what the images of V y, y (size, k), have outside of the space."""
        leaves = self._H[self.size : self.size + BLOCK, self.size - BLOCK : self.size]
        size: np.ndarray = la.norm(leaves @ y[-BLOCK:], axis=0)
        return size

    def grow(self, size: int) -> None:
        """Grow to at least `size` states."""
        while self.size < size:
            held = self.size + BLOCK
            image = self._apply(np.ascontiguousarray(self._MV[:, self.size : held]))
            self.size = held
            Q, MQ, along, R = self._orthonormal(image)
            self._append(Q, MQ)
            self._H[:held, held - BLOCK : held] = along
            self._H[held : held + BLOCK, held - BLOCK : held] = R

    def _append(self, Q: np.ndarray, MQ: np.ndarray) -> None:
        """Make states the block that is mapped next."""
        held = self.size + BLOCK
        if held > self._V.shape[1]:
            self._V = _wider(self._V)
            self._MV = self._V if self._mass is None else _wider(self._MV)
            self._H = np.pad(self._H, (0, len(self._H)))
        self._V[:, self.size : held] = Q
        if self._mass is not None:
            self._MV[:, self.size : held] = MQ

    def _orthonormal(self, W: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Q, M Q (n, b), H (size, b), R (b, b) with W = V H + Q R; Q of unit states outside V.

        Where W has nothing more outside of V, random states take its place.
        """
        V, MV = self._V[:, : self.size], self._MV[:, : self.size]
        along, R = np.zeros((self.size, BLOCK)), np.eye(BLOCK)
        least = DEPENDENT * max(float(np.trace(W.T @ self._times_mass(W))), 0.0)
        for _ in range(PASSES):
            h = MV.T @ W
            W = W - V @ h
            MW = self._times_mass(W)
            d, y = la.eigh(W.T @ MW)
            kept = d > least
            scale = np.where(kept, 1.0 / np.sqrt(np.where(kept, d, 1.0)), 0.0)
            along = along + h @ R
            R = (scale * d)[:, None] * y.T @ R
            W = W @ (y * scale)
            if not kept.all():
                W[:, ~kept] = self._random.standard_normal((len(W), int((~kept).sum())))
                W[:, ~kept] = self._outside(W[:, ~kept], W[:, kept])
            least = 0.0
        return W, self._times_mass(W), along, R

    def _outside(self, X: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Unit states of the span of X outside of V and of other unit states."""
        V, MV = self._V[:, : self.size], self._MV[:, : self.size]
        for _ in range(PASSES):
            X = X - V @ (MV.T @ X) - others @ (others.T @ self._times_mass(X))
            d, y = la.eigh(X.T @ self._times_mass(X))
            X = X @ (y / np.sqrt(d))
        return X

    def _times_mass(self, X: np.ndarray) -> np.ndarray:
        return X if self._mass is None else self._mass @ X


def _wider(A: np.ndarray) -> np.ndarray:
    wider = np.empty((len(A), 2 * A.shape[1]), order="F")
    wider[:, : A.shape[1]] = A
    return wider
