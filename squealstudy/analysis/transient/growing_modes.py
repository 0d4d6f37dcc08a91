"""The complex modes that a transient run is watched through: unstable ones, left vectors too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from squealstudy.linalg.dense_roots import dense_roots

MOST = 6  # complex modes followed in a run, fastest growth first
INVERSE_ITERATIONS = 3


@dataclass(frozen=True)
class GrowingModes:
    """Complex modes of one design point, fastest growth first.

    Attributes
    ----------
    lam : ndarray (m,) complex
        rad/s; where no mode of the band is unstable, the least stable one alone.
    right, left : ndarray (n, m) complex
        Q(lam) right = 0 and left^H Q(lam) = 0, unit norms.
    n_unstable : int
        Unstable modes in the band, those beyond `MOST` counted too.
    n_above : int
        Unstable modes above the band.
    growth_above, frequency_above : float
        Of the fastest of those, 1/s and Hz; 0 where there is none.
    """

    lam: np.ndarray
    right: np.ndarray
    left: np.ndarray
    n_unstable: int
    n_above: int
    growth_above: float
    frequency_above: float

    @property
    def n_followed(self) -> int:
        """Unstable modes among those in `lam`, where they come first."""
        return min(self.n_unstable, len(self.lam))


def growing_modes(
    C: np.ndarray, K: np.ndarray, band_hz: tuple[float, float], tolerance: float
) -> GrowingModes:
    """Unstable modes of lambda^2 I + lambda C + K in a band, and what grows above it.

    Parameters
    ----------
    C, K : ndarray (n, n)
    band_hz : (low, high)
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    """
    low, high = 2 * np.pi * band_hz[0], 2 * np.pi * band_hz[1]
    lam, psi = dense_roots(C, K, (low, np.inf))
    oscillating = lam.imag > 0
    lam, psi = lam[oscillating], psi[:, oscillating]
    unstable = lam.real > tolerance * np.abs(lam)
    inside = np.abs(lam) <= high
    order = np.argsort(-lam.real, kind="stable")
    chosen = order[inside[order]][:MOST]
    n_unstable = int((unstable & inside).sum())
    chosen = chosen[: max(n_unstable, 1)]
    above = lam[unstable & ~inside]
    worst = above[np.argmax(above.real)] if len(above) else 0j
    return GrowingModes(
        lam[chosen],
        psi[:, chosen],
        left_vectors(C, K, lam[chosen]),
        n_unstable,
        len(above),
        float(worst.real),
        float(abs(worst) / (2 * np.pi)),
    )


def left_vectors(C: np.ndarray, K: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Left vectors (n, m) of known simple roots, by inverse iteration on Q(lambda)^H."""
    n = len(K)
    found = np.empty((n, len(lam)), dtype=complex)
    for k, root in enumerate(lam):
        Q = root**2 * np.eye(n) + root * C + K
        shift = 1e-14 * np.abs(Q).max()  # a root met exactly would be a singular matrix
        factor = la.lu_factor(Q.conj().T + shift * np.eye(n), overwrite_a=True)
        y = np.ones(n, dtype=complex)
        for _ in range(INVERSE_ITERATIONS):
            y = la.lu_solve(factor, y / np.linalg.norm(y))
        found[:, k] = y / np.linalg.norm(y)
    return found
