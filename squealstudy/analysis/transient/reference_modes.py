"""The reduced assembly in the modes of a reference working point: one model for both domains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from squealstudy.analysis.transient.system import ModalSystem
from squealstudy.reduction.cmt import ReducedModel
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.design_state import DesignState, ModeKey
from squealstudy.system.energy import reduced_energy_shares
from squealstudy.system.linearise import linearise


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
    """

    system: ModalSystem
    phi: np.ndarray
    C: np.ndarray
    K: np.ndarray
    energies: np.ndarray
    n_exact: int
    rates: np.ndarray
    coupling: np.ndarray


def reference_modes(
    model: ReducedModel,
    point: WorkingPoint,
    state: DesignState,
    component_modes: tuple[ModeKey, ...] = (),
    sensors: np.ndarray | None = None,
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
    sensors : ndarray (ns, n) or None
        Rows on component-mode coordinates whose products are kept in histories.
    """
    tangent = linearise(model, point, state)
    omega2, phi = la.eigh(tangent.K_sym)
    normal = model.area * point.pressure
    drag = -state.operating.mu_steady * model.frictional * normal
    rows = [model.mode_coordinate(*key) for key in component_modes]
    system = ModalSystem(
        omega2,
        model.N @ phi,
        model.T @ phi,
        model.T_perp @ phi,
        model.area,
        model.frictional,
        model.radius,
        point.gap,
        model.area * point.tangent,
        np.column_stack([normal, drag, np.zeros_like(normal)]),
        phi[rows],
        np.zeros((0, model.n)) if sensors is None else sensors @ phi,
    )
    return ReferenceModes(
        system,
        phi,
        phi.T @ tangent.C @ phi,
        phi.T @ tangent.K @ phi,
        reduced_energy_shares(model, tangent.weights, phi),
        len(omega2),
        2.0 * np.sqrt(np.maximum(omega2, 0.0)),
        np.zeros(0),
    )


def growth_sensors(C: np.ndarray, lam: complex, left: np.ndarray) -> np.ndarray:
    """Sensor rows that see one complex mode alone.

    The projection xi(t) = y^H ((lambda + C) q + q') on the left vector y (M = I) of a linear
    system obeys xi' = lambda xi, whatever else is in the motion.

    Parameters
    ----------
    C : ndarray (n, n)
    lam : complex
        Root, rad/s.
    left : ndarray (n,) complex
        Left vector: y^H (lambda^2 + lambda C + K) = 0.

    Returns
    -------
    ndarray (4, n)
        Real and imaginary part of y^H (for velocities), then of y^H (lambda + C) (displacements);
        `projection` puts them together.
    """
    y = left.conj()
    z = lam * y + y @ C
    return np.stack([y.real, y.imag, z.real, z.imag])


def projection(displacement: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Complex amplitude (rows,) from the histories (rows, 4) of `growth_sensors`."""
    xi: np.ndarray = (
        velocity[:, 0] + 1j * velocity[:, 1] + displacement[:, 2] + 1j * displacement[:, 3]
    )
    return xi
