"""Real modes of symmetric sparse pencils K phi = omega^2 M phi, by shift-invert Lanczos."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from squealstudy.linalg.factor import factorise

# The shift is negative, so that K - s M is definite for free bodies too, and grows with the cutoff:
# at 500 Hz the rigid modes outweigh those near 10 kHz and leave them residuals a thousand times
# larger (1e-10 against 3e-14 on the coarse pad), at the same time.
LEAST_SHIFT = 500.0  # Hz
SHIFT_SHARE = 1 / 6  # of the cutoff
DENSE_LIMIT = 400


def real_modes(
    M: sp.spmatrix, K: sp.spmatrix, cutoff_hz: float, guess: int = 40
) -> tuple[np.ndarray, np.ndarray]:
    """All modes up to `cutoff_hz`, mass-normalised and ascending.

    Parameters
    ----------
    M, K : sparse (n, n)
        Positive definite and positive semi-definite.
    cutoff_hz : float
        Modes above are dropped.
    guess : int
        First number of modes asked for; it grows until the cutoff is passed.

    Returns
    -------
    omega : ndarray (m,)
        rad/s; rigid-body modes come out as 0 within round-off.
    phi : ndarray (n, m)
        phi^T M phi = I.
    """
    n = M.shape[0]
    limit = (2 * np.pi * cutoff_hz) ** 2
    if n <= DENSE_LIMIT:
        w2, phi = la.eigh(K.toarray(), M.toarray())
        return _clip(w2, phi, limit)
    shift = -((2 * np.pi * max(LEAST_SHIFT, SHIFT_SHARE * cutoff_hz)) ** 2)
    factor = factorise(K - shift * M)
    # unrefined: what Lanczos' residuals lack is mended below
    inverse = spla.LinearOperator((n, n), matvec=factor.solve_once, dtype=float)
    k = min(guess, n - 2)
    while True:
        rng = np.random.default_rng(0)  # a fixed start: the same model gives the same basis
        w2, phi = spla.eigsh(K, k=k, M=M, sigma=shift, OPinv=inverse, v0=rng.standard_normal(n))
        if w2.max() > limit or k == n - 2:
            phi = phi[:, np.argsort(w2)]
            return _clip(*_refine(M, K, factor.solve(M @ phi)), limit)
        k = min(int(1.1 * k * np.sqrt(limit / max(w2.max(), 1.0))) + 10, 2 * k + 20, n - 2)


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
    kept = w2 <= limit
    return np.sqrt(np.maximum(w2[kept], 0.0)), np.ascontiguousarray(phi[:, kept])
