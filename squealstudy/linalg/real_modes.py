"""Real modes of symmetric sparse pencils K phi = omega^2 M phi, by shift-invert block Lanczos."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.linalg.block_krylov import BLOCK, BlockKrylov
from squealstudy.linalg.factor import RefinedFactor, factorise, lean_solve

# The shift is negative, so that K - s M is definite for free bodies too, and goes with the cutoff:
# at a twentieth of it the rigid modes outweigh the highest ones and leave them residuals a thousand
# times larger (1e-10 against 3e-14 on the coarse pad), at the same time.
SHIFT_SHARE = 1 / 6  # of the cutoff
DENSE_LIMIT = 400
FIRST, STEP = 48, 12  # states before the first test of convergence, and 1 in so many between two
LARGEST = 0.4  # of the degrees of freedom: a Krylov space that is larger costs more than LAPACK
CONVERGED = 1e-10  # residual of a mode, of its theta = 1 / (omega^2 - shift); squared by refining
RIGID = 1e-6  # of the highest frequency of a single degree of freedom: far above round-off


def real_modes(
    M: sp.spmatrix, K: sp.spmatrix, cutoff_hz: float, factor: RefinedFactor | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """All modes up to `cutoff_hz`, mass-normalised and ascending.

    A Krylov space grows until the modes up to the first one beyond the cutoff have converged.

    Parameters
    ----------
    M, K : sparse (n, n)
        Positive definite and positive semi-definite.
    cutoff_hz : float
        Modes above are dropped.
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
    if n > DENSE_LIMIT:
        above = shifted(M, K, cutoff_hz)
        held = factorise(above) if factor is None else factor
        phi = _space_below(M, held, limit)
        if phi is not None:  # from unrefined solves: what they lack is mended here
            return _clip(*_refine(M, K, lean_solve(held, above)(M @ phi)), limit)
    w2, phi = la.eigh(K.toarray(), M.toarray())
    return _clip(w2, phi, limit)


def _space_below(M: sp.spmatrix, factor: RefinedFactor, limit: float) -> np.ndarray | None:
    """Modes (n, m) with omega^2 <= limit and the next; None where they are most of all."""
    space = BlockKrylov(factor.solve_once, M.shape[0], M)
    size = FIRST
    while size <= LARGEST * M.shape[0]:
        space.grow(size)
        theta, y = la.eigh((space.projected + space.projected.T) / 2)
        theta, y = theta[::-1], y[:, ::-1]
        inside = int((theta >= 1.0 / (limit + SHIFT_SHARE**2 * limit)).sum())
        if inside < space.size:
            y = y[:, : inside + 1]
            if (space.left_out(y) <= CONVERGED * theta[: inside + 1]).all():
                return space.vectors @ y
        size = space.size + max(2 * BLOCK, space.size // STEP)
    return None


def shifted(M: sp.spmatrix, K: sp.spmatrix, cutoff_hz: float) -> sp.csr_matrix:
    """K + (SHIFT_SHARE 2 pi cutoff)^2 M: what `real_modes` factors for modes up to a cutoff.

    K itself where there is no cutoff: all modes are LAPACK's then.
    """
    shift = (SHIFT_SHARE * 2 * np.pi * cutoff_hz) ** 2 if np.isfinite(cutoff_hz) else 0.0
    return (K + shift * M).tocsr()


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
