"""One design point, from its working point to its complex modes."""

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

# relative: modes on an end of the band are in it, whatever round-off says
DENSE = "dense"
EIGENVALUE_REL_ROUND_OFF = 1e-13  # round-off of a dense eigenvalue over its modulus


@dataclass(frozen=True)
class PointModes:
    """Complex modes of one design point inside a band, oscillating ones first.

    Attributes
    ----------
    lam : ndarray (m,) complex
        rad/s; oscillating modes ascending in |lambda|, then overdamped (real) roots.
    residual : ndarray (m,)
        Normwise backward error of each pair in the reduced problem.
    energies : ndarray (n_components + 1, m)
    shapes : ndarray (m, k) complex64
        Coordinates on PreparedModel.shape_basis, unit norm.
    working_point : WorkingPoint or None
        None of a model without contact.
    error_rung : ndarray (m,)
        |lam - lam of the component-mode model|, 1/s; of a family, of the full model. NaN where it
        is not known.
    method : str
        The rung of reanalysis that found them.
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
    """How far the imbalance of a working point may have moved its roots (m,), rad/s.

    Contact stiffness holds at most all of a mode's elastic energy: half of its relative change.
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
    """Working point of a design, component changes taken exactly (Woodbury).

    Gaps `known_gap` that balance are taken as they are. Otherwise Newton's method starts from the
    nominal gaps, never from a neighbour's: results do not depend on the order of points. Only along
    a curve of designs, which has an order, does it start from the gaps `near`. Where it fails, it
    starts once more from uniform gaps. Raises ConvergenceError where that fails too, or where a
    registered law contradicts itself there.
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
        rad/s.
    psi : ndarray (n, m) complex
        Right vectors of unit 2-norm.
    error : ndarray (m,)
        Of the roots, rad/s.
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
    """How many real modes the search for roots up to `top` [rad/s] has to know of, if it is known.

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
        Roots that cannot be told from zero are never listed: motion of a free body, whose growth
        has a random sign.
    gap : ndarray (nc,) or None
        Known working-point gaps; verified and polished by the same Newton.

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
