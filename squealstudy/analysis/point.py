"""One design point, from its working point to its complex modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.analysis.design_state import DesignState
from squealstudy.analysis.energy import energy_shares
from squealstudy.analysis.linearise import component_frequencies, linearise
from squealstudy.analysis.quadratic import QuadraticSolver, backward_error, dense_roots
from squealstudy.errors import ConvergenceError
from squealstudy.reduction.prepared import PreparedModel, shape_column
from squealstudy.reduction.working_point import (
    WorkingPoint,
    known_working_point,
    working_point,
)

RIGID_HZ = 1.0
DENSE = "dense"
ROUND_OFF = 1e-13  # of a dense eigenvalue, relative to its modulus


@dataclass(frozen=True)
class PointModes:
    """Complex modes of one design point inside a band, oscillating ones first.

    Attributes
    ----------
    lam : ndarray (m,) complex
        rad/s; oscillating modes ascending in |lambda|, then overdamped (real) roots.
    overdamped : ndarray (m,) of bool
    residual : ndarray (m,)
        Normwise backward error of each pair in the reduced problem.
    energies : ndarray (n_components + 1, m)
    shapes : ndarray (m, k) complex64
        Coordinates on PreparedModel.shape_basis, unit norm.
    working_point : WorkingPoint
    error_estimate : ndarray (m,) or None
        |lam - lam of the component-mode model|, 1/s; of a family, of the full model.
    method : str
        The rung of reanalysis that found them.
    """

    lam: np.ndarray
    overdamped: np.ndarray
    residual: np.ndarray
    energies: np.ndarray
    shapes: np.ndarray
    working_point: WorkingPoint
    error_estimate: np.ndarray | None = None
    method: str = DENSE


def state_working_point(
    prepared: PreparedModel, state: DesignState, known: np.ndarray | None = None
) -> WorkingPoint:
    """Working point of a design, component changes taken exactly (Woodbury).

    `known` gaps are taken as they are where they balance. Otherwise Newton starts from the
    nominal gaps, never from a neighbour: results do not depend on the order of points. A uniform
    start is the fallback. Raises ConvergenceError where that fails too.
    """
    omega = component_frequencies(prepared.model)
    changes = {
        shape_column(prepared.model, *key): dk for key, dk in state.stiffness_changes(omega).items()
    }
    space = prepared.space.changed(changes)
    found = None if known is None else known_working_point(space, state.operating, known)
    if found is not None:
        return found
    try:
        return working_point(space, state.operating, prepared.nominal_gap)
    except ConvergenceError:
        return working_point(space, state.operating)


def solve_point(
    prepared: PreparedModel,
    state: DesignState,
    band_hz: tuple[float, float],
    gap: np.ndarray | None = None,
    solver: QuadraticSolver = dense_roots,
) -> PointModes:
    """Complex modes with |lambda|/2 pi in `band_hz` at a design point.

    Parameters
    ----------
    prepared : PreparedModel
    state : DesignState
    band_hz : (low, high)
        Roots below 1 Hz are never listed: rigid-body noise, whose growth has a random sign.
    gap : ndarray (nc,) or None
        Known working-point gaps; verified and polished by the same Newton.
    solver : QuadraticSolver

    Raises
    ------
    ConvergenceError
        Where there is no working point.
    """
    point = state_working_point(prepared, state, gap)
    system = linearise(prepared.model, point, state)
    low, high = 2 * np.pi * max(band_hz[0], RIGID_HZ), 2 * np.pi * band_hz[1]
    lam, psi = solver(system.C, system.K, (low, high))
    overdamped = lam.imag == 0
    order = np.argsort(overdamped, kind="stable")
    lam, psi, overdamped = lam[order], psi[:, order], overdamped[order]
    shapes = (prepared.shape_basis.T @ psi).T
    shapes /= np.maximum(np.linalg.norm(shapes, axis=1, keepdims=True), 1e-300)
    return PointModes(
        lam,
        overdamped,
        backward_error(system.C, system.K, lam, psi),
        energy_shares(prepared.model, system, psi),
        shapes.astype(np.complex64),
        point,
        ROUND_OFF * np.abs(lam),
    )
