"""A design point of the brake solved at full order, read as the reduced rungs are."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.linalg as la

from squealstudy.analysis.full_order.modes import (
    component_terms,
    full_order_modes,
    mode_frequencies,
)
from squealstudy.analysis.point import PointModes, angular_band, state_working_point
from squealstudy.models.assembly import Assembly
from squealstudy.reduction.cmt import ComponentModes, ReducedModel
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.design_state import DesignState

FULL = "full"


def solve_full_order(
    prepared: PreparedModel,
    assembly: Assembly,
    modes: Mapping[str, ComponentModes],
    state: DesignState,
    band_hz: tuple[float, float],
    damped_to_hz: float,
) -> PointModes:
    """Complex modes of the unreduced assembly in a band.

    Shapes are the least-squares coordinates, at the prepared model's sensors, on its shape basis.
    The error estimate is that of the eigenproblem (`root_errors`).

    Raises
    ------
    ConvergenceError
        Where there is no working point, or ARPACK does not converge.
    """
    point = state_working_point(prepared, state)
    low, high = angular_band(band_hz)
    band = (low / (2 * np.pi), high / (2 * np.pi))
    expected = expected_roots(prepared.model, point, band_hz[1])
    found = full_order_modes(
        assembly,
        modes,
        point,
        state,
        band,
        damped_to_hz,
        expected,
    )
    order = np.argsort(found.lam.imag == 0, kind="stable")
    lam, psi, residual = found.lam[order], found.psi[:, order], found.residual[order]
    seen = assembly.correspondence @ psi
    shapes = la.lstsq(prepared.sensor_shapes, seen)[0].T
    shapes /= np.maximum(np.linalg.norm(shapes, axis=1, keepdims=True), 1e-300)
    return PointModes(
        lam,
        lam.imag == 0,
        residual,
        _energies(assembly, modes, point, state, psi),
        shapes.astype(np.complex64),
        point,
        found.error[order],
        FULL,
    )


def expected_roots(model: ReducedModel, point: WorkingPoint, top_hz: float) -> int:
    """How many roots lie below a frequency: twice the real modes of the reduced model."""
    K = model.K_springs + model.N.T @ ((model.area * point.tangent)[:, None] * model.N)
    K[np.diag_indices_from(K)] += model.k_el
    limit = (2 * np.pi * top_hz) ** 2
    return 2 * len(la.eigvalsh(K, subset_by_value=(-np.inf, limit)))


def _energies(
    assembly: Assembly,
    modes: Mapping[str, ComponentModes],
    point: WorkingPoint,
    state: DesignState,
    psi: np.ndarray,
) -> np.ndarray:
    """Shares of the components, then of the interfaces, in the elastic energy (c + 1, m)."""
    changes = state.stiffness_changes(mode_frequencies(modes))
    U, dk = component_terms(assembly, modes, changes)
    added = dk[:, None] * np.abs(U.T @ psi) ** 2
    parts = []
    for component in assembly.components:
        own = psi[assembly.slices[component.name]]
        energy = np.einsum("im,im->m", own.conj(), component.K @ own).real
        rows = [i for i, (name, _) in enumerate(changes) if name == component.name]
        parts.append(energy + added[rows].sum(axis=0))
    c = assembly.contact
    springs = np.einsum("im,im->m", psi.conj(), assembly.K_springs() @ psi).real
    contact = (c.area * point.tangent) @ np.abs(c.N @ psi) ** 2
    energies = np.vstack([*parts, springs + contact])
    shares: np.ndarray = energies / np.maximum(energies.sum(axis=0), 1e-300)
    return shares
