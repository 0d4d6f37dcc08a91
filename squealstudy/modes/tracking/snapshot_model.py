"""A fast approximate solver for the points that mode tracking inserts between design points.

Where two design points lie too far apart to pair their modes, tracking solves points between them.
The reduced brake is projected on its modes at a few design points (snapshots). The projection gives
the modes of other points with relative errors of some 1e-4, in a fifth of the time.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy.linalg as la

from squealstudy.models.operating import DesignState
from squealstudy.modes.point import band_modes, linearised_point, state_working_point
from squealstudy.modes.tracking.pairing import mac
from squealstudy.modes.tracking.refinement import Modes
from squealstudy.reduction.prepared import PreparedModel, unit_shapes
from squealstudy.system.linearise import linearise, reduced_structure
from squealstudy.system.parametric import ParametricSystem

# modes up to this factor times the band's top are snapshots, as they may come into the band
SNAPSHOT_BAND_FACTOR = 1.1
# singular values of the snapshots below this share of the largest are left out of the basis. On the
# medium brake over friction and pressure 148 of 618 directions stay; roots err by 1e-4 at most
MIN_SINGULAR_VALUE = 1e-3


def snapshots(
    prepared: PreparedModel,
    state: DesignState,
    band_hz: tuple[float, float],
    gap: np.ndarray | None = None,
) -> np.ndarray:
    """Real and imaginary parts (n, 2 m) of the modes of a design state, columns of a basis.

    Modes below the band are included. A basis that spans only a part of a mode gives it too high a
    frequency: a mode below the band might then appear in the band.

    Raises
    ------
    ConvergenceError
        Where there is no working point.
    """
    point, system = linearised_point(prepared, state, gap)
    psi = band_modes(system, point, (0.0, SNAPSHOT_BAND_FACTOR * band_hz[1])).psi
    return np.hstack([psi.real, psi.imag])


def snapshot_basis(blocks: Sequence[np.ndarray]) -> np.ndarray:
    """Orthonormal basis (n, r) of snapshots (n, m) of several design points."""
    A = np.hstack(blocks)
    squares, U = la.eigh(A @ A.T, driver="evd")
    basis: np.ndarray = U[:, squares > MIN_SINGULAR_VALUE**2 * max(squares[-1], 0.0)]
    return basis


class SnapshotModel:
    """Modes of a prepared model at any design state, approximated on a basis of snapshots.

    Parameters
    ----------
    prepared : PreparedModel
    V : ndarray (n, r)
        Orthonormal columns of the basis.
    band_hz : (low, high)
        Band of the modes, Hz.
    """

    def __init__(
        self, prepared: PreparedModel, V: np.ndarray, band_hz: tuple[float, float]
    ) -> None:
        self._prepared, self._V, self._band_hz = prepared, V, band_hz
        self._shape_rows = prepared.shape_rows @ V

    @cached_property
    def _system(self) -> ParametricSystem:
        return reduced_structure(self._prepared.model).system.projected(self._V)

    def modes(self, state: DesignState, near: np.ndarray | None = None) -> Modes:
        """Oscillating modes of a design state in the band.

        Parameters
        ----------
        state : DesignState
        near : ndarray (nc,) or None
            Gaps of the working point of a neighbour, from which Newton's method starts.

        Raises
        ------
        ConvergenceError
            Where there is no working point.
        """
        point = state_working_point(self._prepared, state, near=near)
        system = linearise(self._prepared.model, point, state, self._system)
        lam, psi, *_ = band_modes(system, point, self._band_hz)
        oscillating = lam.imag > 0
        return Modes(lam[oscillating], unit_shapes(self._shape_rows @ psi[:, oscillating]))


def largest_mode_error(exact: Modes, other: Modes, band: tuple[float, float], edge: float) -> float:
    """How far the approximate modes `other` are from the exact ones: decides if a basis is used.

    It is the largest distance of a mode of either set from the nearest mode of the other set. The
    distance of two modes is |lam - other lam| / |lam| + 1 - MAC, where lam is the exact root. Modes
    within `edge` (relative) of an end of the band [rad/s] do not count: the modes nearest to them
    may lie outside the band.
    """
    size = np.maximum(np.abs(exact.lam), 1e-300)
    distances = np.abs(exact.lam[:, None] - other.lam) / size[:, None]
    distances = distances + 1.0 - mac(exact.shapes, other.shapes)
    worst = 0.0
    for lam, distance in ((exact.lam, distances), (other.lam, distances.T)):
        inside = (np.abs(lam) > band[0] * (1 + edge)) & (np.abs(lam) < band[1] * (1 - edge))
        if inside.any():
            worst = max(worst, float(distance[inside].min(axis=1, initial=np.inf).max()))
    return worst
