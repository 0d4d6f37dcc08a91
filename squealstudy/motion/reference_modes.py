"""The reduced assembly in the modes of a reference working point: one model for both domains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from squealstudy.motion.system import ModalSystem
from squealstudy.reduction.cmt import ReducedModel
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.design_state import DesignState, ModeKey
from squealstudy.system.energy import reduced_energy_shares
from squealstudy.system.linearise import component_frequencies, linearise


@dataclass(frozen=True)
class ReferenceModes:
    """Component-mode coordinates diagonalised at a reference working point.

    Attributes
    ----------
    system : ModalSystem
        For time integration; its state is the deviation from steady sliding at the reference.
    phi : ndarray (n, n)
        Modes in component-mode coordinates, M-orthonormal.
    C, K : ndarray (n, n)
        The linearised damping and stiffness of the same reference in modal coordinates: what
        complex modes are computed from.
    energies : ndarray (n_components + 1, n)
        Share of each component, then of the interfaces, in the elastic energy of each mode.
    n_exact : int
        Leading coordinates that are assembly modes; all of them unless the basis was reduced.
    rates : ndarray (n,)
        Diagonal damping for a damping ratio of one, 2 omega of assembly modes, rad/s.
    coupling : ndarray (m,)
        Damping, for a damping ratio of one, of the last m rows of `system.shapes`: what is not
        diagonal in a reduced basis, rad/s.
    component_modes : tuple of (component, mode)
        In the order of the rows of `system.shapes` before those: what design points may change.
    component_frequencies : mapping of (component, mode) -> float
        Free-free, of every component mode of the reduced assembly, rad/s.
    """

    system: ModalSystem
    phi: np.ndarray
    C: np.ndarray
    K: np.ndarray
    energies: np.ndarray
    n_exact: int
    rates: np.ndarray
    coupling: np.ndarray
    component_modes: tuple[ModeKey, ...]
    component_frequencies: Mapping[ModeKey, float]


def reference_modes(
    model: ReducedModel,
    point: WorkingPoint,
    state: DesignState,
    component_modes: tuple[ModeKey, ...] = (),
) -> ReferenceModes:
    """Diagonalise the reduced assembly with the contact tangents of a working point.

    Parameters
    ----------
    model : ReducedModel
    point : WorkingPoint
        Of `state`.
    state : DesignState
        The reference design; its friction and damping enter C and K only, design points bring
        their own.
    component_modes : tuple of (component, mode)
        Component modes that design points damp or shift: rows of `system.shapes`, exact in these
        coordinates.
    """
    tangent = linearise(model, point, state)
    omega2, phi = la.eigh(tangent.K_sym)
    normal = model.area * point.pressure
    drag = -model.area * model.frictional * state.operating.traction(point.pressure)
    rows = [model.mode_coordinate(*key) for key in component_modes]
    system = ModalSystem(
        omega2=omega2,
        N=model.N @ phi,
        T1=model.T @ phi,
        T2=model.T_perp @ phi,
        area=model.area,
        frictional=model.frictional,
        radius=model.radius,
        gap=point.gap,
        k_ref=model.area * point.tangent,
        force=np.column_stack([normal, drag, np.zeros_like(normal)]),
        shapes=phi[rows],
    )
    return ReferenceModes(
        system=system,
        phi=phi,
        C=phi.T @ tangent.C @ phi,
        K=phi.T @ tangent.K @ phi,
        energies=reduced_energy_shares(model, tangent.weights, phi),
        n_exact=len(omega2),
        rates=2.0 * system.frequencies,
        coupling=np.zeros(0),
        component_modes=component_modes,
        component_frequencies=component_frequencies(model),
    )
