"""Real modes of symmetric sparse pencils K phi = omega^2 M phi, by shift-invert Lanczos."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from squealstudy.linalg.factor import RefinedFactor, factorise, lean_solve, symmetric_lu

# The shift is negative, so that K - s M is definite for free bodies too, and goes with the cutoff:
# at a twentieth of it the rigid modes outweigh the highest ones and leave them residuals a thousand
# times larger (1e-10 against 3e-14 on the coarse pad), at the same time.
SHIFT_SHARE = 1 / 6  # of the cutoff
DENSE_LIMIT = 400
SPACE, LEAST_MORE = 1.4, 20  # Lanczos vectors a mode, and beside the modes: more cost more
FIRST_GUESS = 40  # modes asked for where they cannot be counted
RIGID = 1e-6  # of the highest frequency of a single degree of freedom: far above round-off


def real_modes(
    M: sp.spmatrix,
    K: sp.spmatrix,
    cutoff_hz: float,
    guess: int | None = None,
    factor: RefinedFactor | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """All modes up to `cutoff_hz`, mass-normalised and ascending.

    Parameters
    ----------
    M, K : sparse (n, n)
        Positive definite and positive semi-definite.
    cutoff_hz : float
        Modes above are dropped.
    guess : int or None
        First number of modes asked for; it grows until the cutoff is passed. None counts them.
    factor : RefinedFactor or None
        Of `shifted`, where it is there already.

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
    shift, above = -(SHIFT_SHARE**2) * limit, shifted(M, K, cutoff_hz)
    factor = factorise(above) if factor is None else factor
    # unrefined: what Lanczos' residuals lack is mended below
    inverse = spla.LinearOperator((n, n), matvec=factor.solve_once, dtype=float)
    k = min((modes_below(M, K, limit) if guess is None else guess) + 1, n - 2)
    while True:
        rng = np.random.default_rng(0)  # a fixed start: the same model gives the same basis
        v0, space = rng.standard_normal(n), min(max(int(SPACE * k), k + LEAST_MORE), n - 1)
        w2, phi = spla.eigsh(K, k=k, M=M, sigma=shift, OPinv=inverse, v0=v0, ncv=space)
        if w2.max() > limit or k == n - 2:
            phi = phi[:, np.argsort(w2)]
            return _clip(*_refine(M, K, lean_solve(factor, above)(M @ phi)), limit)
        growth = np.sqrt(limit / max(w2.max(), limit / 100))
        k = min(int(1.1 * k * growth) + 10, 2 * k + 20, n - 2)


def shifted(M: sp.spmatrix, K: sp.spmatrix, cutoff_hz: float) -> sp.csr_matrix:
    """K + (SHIFT_SHARE 2 pi cutoff)^2 M: what `real_modes` factors for modes up to a cutoff."""
    return (K + (SHIFT_SHARE * 2 * np.pi * cutoff_hz) ** 2 * M).tocsr()


def modes_below(M: sp.spmatrix, K: sp.spmatrix, limit: float) -> int:
    """How many modes have omega^2 < limit, by Sylvester's law: the negative pivots of K - limit M.

    Without pivoting: round-off may change the count where a pivot is close to zero.
    """
    try:
        factor = symmetric_lu(K - limit * M)
    except RuntimeError:  # a pivot is zero
        return FIRST_GUESS
    return int((factor.U.diagonal() < 0).sum())


def rigid_modes(M: sp.spmatrix, K: sp.spmatrix, omega: np.ndarray) -> int:
    """How many of the real modes omega [rad/s] of a free body are rigid: zero but for round-off."""
    highest = np.sqrt(np.abs(K.diagonal()) / M.diagonal()).max()
    return int((omega <= RIGID * highest).sum())


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
