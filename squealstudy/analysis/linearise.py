"""The reduced quadratic problem at a design point: lambda^2 I + lambda C + K."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg as la

from squealstudy.models.interface import ContactInterface
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.cmt import ReducedModel
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.design_state import DesignState, ModeKey


@dataclass(frozen=True)
class ReducedSystem:
    """Matrices of one design point in component-mode coordinates; the mass is the identity.

    Attributes
    ----------
    C, K : ndarray (n, n)
        Damping [rad/s] and non-symmetric stiffness [(rad/s)^2].
    k_el : ndarray (n,)
        Elastic diagonal with the component changes, for energies.
    K_sym : ndarray (n, n)
        Symmetric part without friction: elastic, springs and contact.
    """

    C: np.ndarray
    K: np.ndarray
    k_el: np.ndarray
    K_sym: np.ndarray


class ContactCoefficients(NamedTuple):
    """What contact and friction add to a linearised system, one figure a contact point (nc,).

    Attributes
    ----------
    stiffness : ndarray
        k_n of N^T k_n N, N/m.
    coupling : ndarray
        mu k_n of -T^T (mu k_n) N, N/m.
    damping : ndarray
        mu A p / |w0| of T_perp^T (.) T_perp, N s/m.
    falling : ndarray
        dmu/ds A p of T^T (.) T, N s/m.
    """

    stiffness: np.ndarray
    coupling: np.ndarray
    damping: np.ndarray
    falling: np.ndarray


def contact_coefficients(
    contact: ReducedModel | ContactInterface, point: WorkingPoint, operating: OperatingPoint
) -> ContactCoefficients:
    """Coefficients of a working point (theory.md section 1), reduced or not."""
    k_n, normal = contact.area * point.tangent, contact.area * point.pressure
    mu = operating.mu_steady * contact.frictional
    falling = operating.friction_slope * contact.frictional * normal
    return ContactCoefficients(k_n, mu * k_n, mu * normal / operating.sliding_speed, falling)


def component_frequencies(model: ReducedModel) -> dict[ModeKey, float]:
    """Free-free frequency [rad/s] of every component mode held by the basis."""
    return {
        (name, j + 1): float(np.sqrt(max(model.k_el[int(start) + j], 0.0)))
        for name, start, count in zip(model.components, model.offsets, model.n_modes, strict=False)
        for j in range(count)
    }


def linearise(model: ReducedModel, point: WorkingPoint, state: DesignState) -> ReducedSystem:
    """Tangent system about a working point (theory.md section 1).

    K = diag(k_el) + K_springs + N^T k_n N - T^T (mu k_n) N,
    C = 2 zeta omega of damped component modes + T_perp^T (mu A p / |w0|) T_perp
        + T^T (dmu/ds A p) T + modal damping + beta K_sym.

    mu and dmu/ds are those of the sliding speed; friction that falls with it damps negatively.

    Raises
    ------
    ParameterError
        Damping of an assembly mode that the basis does not have.
    """
    omega = component_frequencies(model)
    k_el = model.k_el.copy()
    for key, change in state.stiffness_changes(omega).items():
        k_el[model.mode_coordinate(*key)] += change
    contact = contact_coefficients(model, point, state.operating)
    K_sym = model.K_springs + model.N.T @ (contact.stiffness[:, None] * model.N)
    K_sym[np.diag_indices_from(K_sym)] += k_el
    K = K_sym - model.T.T @ (contact.coupling[:, None] * model.N)
    C = model.T_perp.T @ (contact.damping[:, None] * model.T_perp)
    if state.operating.friction_slope:
        C += model.T.T @ (contact.falling[:, None] * model.T)
    for key, c in state.modal_dampers(omega).items():
        j = model.mode_coordinate(*key)
        C[j, j] += c
    C += assembly_damping(K_sym, state, model.damped_to)
    if state.stiffness_damping:
        C += state.stiffness_damping * K_sym
    return ReducedSystem(C, K, k_el, K_sym)


def assembly_damping(
    K_sym: np.ndarray, state: DesignState, damped_to: float = np.inf
) -> np.ndarray | float:
    """Modal damping (n, n) of a design point's assembly, rad/s; 0 where it has none.

    Real modes beyond `damped_to` [rad/s] have the coefficient of a mode there.

    Raises
    ------
    ParameterError
        Damping of an assembly mode that the basis does not have.
    """
    zeta = state.assembly_damping_ratios(len(K_sym))
    return modal_damping(K_sym, zeta, damped_to) if zeta.any() else 0.0


def modal_damping(K_sym: np.ndarray, zeta: np.ndarray, damped_to: float = np.inf) -> np.ndarray:
    """Modal damping (eq. 8): sum of phi 2 zeta min(omega, damped_to) phi^T, zeta (n,)."""
    w2, phi = la.eigh(K_sym)
    omega = np.sqrt(np.maximum(w2, 0.0))
    return (phi * (2.0 * zeta * np.minimum(omega, damped_to))) @ phi.T
