"""Modes between two structures, from their matrices interpolated in common coordinates.

A structure in between would cost a reduction of its own. Its matrices in the real modes of the
first structure are interpolated linearly between those of both ends; the matrices of the second
structure are first rotated to these modes by the mode shapes of both (Amsallem and Farhat, SIAM J.
Sci. Comput. 33, 2011). That is accurate enough to see which mode continues as which where modes
veer or cross.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg as la

from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.modes.tracking.pairing import LOW_MAC, squares
from squealstudy.modes.tracking.refinement import Modes

# real modes up to this factor times the top of the band are used: places may not distinguish those
# far above it
BAND_TOP_FACTOR = 1.5


class ModalMatrices(NamedTuple):
    """A design point in k real modes of unit mass of its structure, ascending in frequency.

    Attributes
    ----------
    C, K : ndarray (k, k)
        Damping [rad/s] and stiffness [(rad/s)^2].
    seen : ndarray (s, k)
        Displacements of the modes at places that correspond between structures
        (PreparedModel.sensor_shapes).
    """

    C: np.ndarray
    K: np.ndarray
    seen: np.ndarray


class InterpolatedModes:
    """Modes on the straight line from a design point a to a point b of another structure.

    Parameters
    ----------
    a, b : ModalMatrices
    x_a, x_b : ndarray (p,)
        Coordinates of both points.
    band : (low, high)
        Band of the modes, rad/s.
    """

    def __init__(
        self,
        a: ModalMatrices,
        b: ModalMatrices,
        x_a: np.ndarray,
        x_b: np.ndarray,
        band: tuple[float, float],
    ) -> None:
        k = max(min(_count(a, BAND_TOP_FACTOR * band[1]), _count(b, BAND_TOP_FACTOR * band[1])), 1)
        self._seen = np.asarray(a.seen[:, :k]), np.asarray(b.seen[:, :k])
        u, _, vh = la.svd(self._seen[0].T @ self._seen[1])
        self._turn = u @ vh
        self._a = a.C[:k, :k], a.K[:k, :k]
        self._b = tuple(self._turn @ A[:k, :k] @ self._turn.T for A in (b.C, b.K))
        self._x_a, self._way, self._band = x_a, x_b - x_a, band

    def solve(self, x: np.ndarray) -> Modes:
        """Oscillating modes at coordinates (p,) on the line; shapes in the real modes of a."""
        t = float((x - self._x_a) @ self._way / (self._way @ self._way))
        C, K = ((1 - t) * A + t * B for A, B in zip(self._a, self._b, strict=True))
        lam, psi = dense_roots(C, K, self._band)
        oscillates = lam.imag > 0
        return Modes(lam[oscillates], psi.T[oscillates])

    def at_a(self, modes: Modes) -> Modes:
        """Modes of a with shapes in the real modes that are used; `modes` has them in all."""
        return Modes(modes.lam, modes.shapes[:, : len(self._turn)])

    def at_b(self, modes: Modes) -> Modes:
        """Modes of b with shapes in the real modes of a; `modes` has them in those of b."""
        return Modes(modes.lam, modes.shapes[:, : len(self._turn)] @ self._turn.T)

    def foreign(self, modes: Modes) -> np.ndarray:
        """Mask (m,) of the modes of b that are for the most part no motion of a's real modes."""
        a, b = self._seen
        motion_of_b = b @ modes.shapes[:, : len(self._turn)].T
        part_in_a = la.qr(a, mode="economic")[0].T @ motion_of_b
        foreign: np.ndarray = squares(part_in_a.T) < LOW_MAC * squares(motion_of_b.T)
        return foreign


def _count(point: ModalMatrices, limit: float) -> int:
    """Number of real modes up to a frequency, rad/s."""
    return int((np.diagonal(point.K) <= limit**2).sum())
