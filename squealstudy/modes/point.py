"""Solves one design point, from its working point to its complex modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.dense_qep import backward_error, dense_roots, real_modes_to_know
from squealstudy.linalg.root_error import root_errors
from squealstudy.models.operating import DesignState
from squealstudy.reduction.prepared import PreparedModel, shape_column, unit_shapes
from squealstudy.reduction.working_point import (
    WorkingPoint,
    expect_consistent_laws,
    known_working_point,
    working_point,
)
from squealstudy.root_pairs import angular_band, by_modulus
from squealstudy.system.energies import reduced_energy_shares
from squealstudy.system.linearise import LinearisedModel, linearise, reduced_structure

DENSE = "dense"
EIGENVALUE_REL_ROUND_OFF = 1e-13  # round-off of a dense eigenvalue over its modulus


@dataclass(frozen=True)
class PointModes:
    """Complex modes of one design point inside a band, oscillating ones first.

    Attributes
    ----------
    lam : ndarray (m,) complex
        Roots, rad/s: oscillating modes ascending in |lambda|, then overdamped (real) roots.
    residual : ndarray (m,)
        Normwise backward error of each pair in the reduced problem; NaN where it was not computed.
    energies : ndarray (n_components + 1, m)
        Share of each component, then of the interfaces, in the elastic energy of each mode.
    shapes : ndarray (m, k) complex64
        Coordinates of unit norm on PreparedModel.shape_basis.
    working_point : WorkingPoint or None
        None for a model without contact.
    error_rung : ndarray (m,)
        Distance of each root from that of the component-mode model, 1/s; in a family of matrices
        from that of the full model. NaN where it is not known.
    method : str
        Name of the rung that computed them.
    """

    lam: np.ndarray
    residual: np.ndarray
    energies: np.ndarray
    shapes: np.ndarray
    working_point: WorkingPoint | None
    error_rung: np.ndarray
    method: str = DENSE

    @property
    def overdamped(self) -> np.ndarray:
        """Which roots (m,) are real."""
        real: np.ndarray = self.lam.imag == 0
        return real


def oscillating_first(lam: np.ndarray) -> np.ndarray:
    """Order (m,) of roots as tables have them: see `root_pairs.by_modulus`; real ones last."""
    return by_modulus(lam, lam.imag == 0)


def working_point_error(point: WorkingPoint | None, lam: np.ndarray) -> np.ndarray:
    """Bound (m,) of the shift of roots by the imbalance of their working point, rad/s.

    If contact stiffness had all of a mode's elastic energy, the relative shift would be half of the
    stiffness's relative error.
    """
    error = 0.0 if point is None else point.tangent_error
    shift: np.ndarray = 0.5 * error * np.abs(lam)
    return shift


def state_working_point(
    prepared: PreparedModel,
    state: DesignState,
    known_gap: np.ndarray | None = None,
    near: np.ndarray | None = None,
) -> WorkingPoint:
    """Working point of a design, with its component changes exactly (Woodbury).

    Gaps `known_gap` that are in balance are returned as they are. Otherwise Newton's method starts
    from the nominal gaps, so that results do not depend on the order of points; only along a curve
    of designs, which has an order, it starts from the gaps `near`. Where it fails it starts once
    more from uniform gaps. Raises ConvergenceError where that fails too, or where a registered law
    contradicts itself there.
    """
    omega = reduced_structure(prepared.model).frequencies
    changes = {
        shape_column(prepared.model, *key): dk for key, dk in state.stiffness_changes(omega).items()
    }
    space = prepared.space.changed(changes)
    steady = None if known_gap is None else known_working_point(space, state.operating, known_gap)
    if steady is None:
        try:
            steady = working_point(
                space, state.operating, prepared.nominal_gap if near is None else near
            )
        except ConvergenceError:
            steady = working_point(space, state.operating)
    expect_consistent_laws(space, state.operating, steady)
    return steady


def linearised_point(
    prepared: PreparedModel, state: DesignState, gap: np.ndarray | None = None
) -> tuple[WorkingPoint, LinearisedModel]:
    """The reduced system of a design state about its own working point; ConvergenceError."""
    point = state_working_point(prepared, state, gap)
    return point, linearise(prepared.model, point, state)


class BandModes(NamedTuple):
    """Modes of a reduced system in a band, in the order of tables.

    Attributes
    ----------
    lam : ndarray (m,) complex
        Roots, rad/s.
    psi : ndarray (n, m) complex
        Right vectors of unit 2-norm.
    error : ndarray (m,)
        Errors of the roots, rad/s.
    residual : ndarray (m,)
        Normwise backward error of each pair.
    """

    lam: np.ndarray
    psi: np.ndarray
    error: np.ndarray
    residual: np.ndarray


def band_modes(
    system: LinearisedModel, point: WorkingPoint, band_hz: tuple[float, float]
) -> BandModes:
    """Modes of a reduced system about its working point with |lambda|/2 pi in a band."""
    band = angular_band(band_hz)
    lam, psi = dense_roots(system.C, system.K, band, _known_count(system, band[1]))
    errors = root_errors(system.pencil.M, system.C, system.K, lam, psi)
    resolved = np.flatnonzero(errors.resolved(lam, band[1]))
    order = resolved[oscillating_first(lam[resolved])]
    lam, psi, error = lam[order], psi[:, order], errors.error[order]
    error = np.maximum(error, EIGENVALUE_REL_ROUND_OFF * np.abs(lam)) + working_point_error(
        point, lam
    )
    residual = backward_error(system.C, system.K, lam, psi, errors.residual[order])
    return BandModes(lam, psi, error, residual)


def _known_count(system: LinearisedModel, top: float) -> int | None:
    """Number of real modes that the search for roots up to `top` [rad/s] needs; None if not known.

    Friction's part of the symmetric stiffness is left out.
    """
    if system.known_modes is None:
        return None
    return int((system.known_modes[0] <= real_modes_to_know(top) ** 2).sum())


def solve_point(
    prepared: PreparedModel,
    state: DesignState,
    band_hz: tuple[float, float],
    gap: np.ndarray | None = None,
) -> PointModes:
    """Complex modes with |lambda|/2 pi in `band_hz` at a design point.

    Parameters
    ----------
    prepared : PreparedModel
    state : DesignState
    band_hz : (low, high)
        Band in Hz. Roots that are zero within their error are never listed: they are motion of a
        free body, whose growth has a random sign.
    gap : ndarray (nc,) or None
        Gaps of the working point if known; they are verified.

    Raises
    ------
    ConvergenceError
        Where there is no working point.
    """
    point, system = linearised_point(prepared, state, gap)
    lam, psi, error, residual = band_modes(system, point, band_hz)
    return PointModes(
        lam=lam,
        residual=residual,
        energies=reduced_energy_shares(prepared.model, system.weights, psi),
        shapes=unit_shapes(prepared.shape_rows @ psi),
        working_point=point,
        error_rung=error,
    )
