"""Complex modes of one design point with their vectors and errors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from squealstudy.mechanics.reduction import Reduction
from squealstudy.models.model_point import ModelPoint
from squealstudy.modes.full_order.finer_model import relative_errors
from squealstudy.modes.point import DENSE, PointModes, band_modes, linearised_point
from squealstudy.system.energies import reduced_energy_shares


@dataclass(frozen=True, eq=False)
class PointPairs:
    """Complex modes of one design point.

    Attributes
    ----------
    lam : ndarray (k,) complex
        Roots, rad/s.
    right : ndarray (n, k) complex
        Right vectors.
    residual : ndarray (k,)
        Normwise backward errors.
    error_rung, error_reduction : ndarray (k,)
        Errors of the roots by the solver and by the reduction, rad/s; NaN where not estimated.
    energies : ndarray (parts, k)
        Shares of elastic energy, 0 to 1.
    method : str
        Name of the rung that solved the point.
    """

    lam: np.ndarray
    right: np.ndarray
    residual: np.ndarray
    error_rung: np.ndarray
    error_reduction: np.ndarray
    energies: np.ndarray
    method: str


def point_pairs(
    point: ModelPoint, reduction: Reduction, band_hz: tuple[float, float], tells_error: bool
) -> PointPairs:
    """Complex modes of a design point in a band [Hz], with their errors.

    Raises
    ------
    ConvergenceError
        Where there is no steady sliding.
    """
    prepared, state = reduction.prepared, point.state()
    sliding, system = linearised_point(prepared, state)
    lam, psi, error, residual = band_modes(system, sliding, band_hz)
    energies = reduced_energy_shares(prepared.model, system.weights, psi)
    pairs = PointPairs(lam, psi, residual, error, np.zeros(len(lam)), energies, DENSE)
    if not point.model.meshed:
        return pairs
    if not (tells_error and prepared.finer is not None):
        return replace(pairs, error_reduction=np.full(len(lam), np.nan))
    modes = PointModes(lam, residual, energies, np.zeros((len(lam), 0)), sliding, error)
    relative = relative_errors(prepared, state, band_hz, modes)
    return replace(pairs, error_reduction=relative * np.abs(lam))
