"""A batch linearised about steady sliding: the matrices of `system.linearise`, stacked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.linalg.overflow import MAX_SQUARABLE_ENTRY
from squealstudy.stacked.operating import StackedOperating
from squealstudy.stacked.sliding import StackedSliding
from squealstudy.stacked.structures import StackedStructures
from squealstudy.system.contact_weights import over_speed


@dataclass(frozen=True, eq=False)
class StackedDamping:
    """Damping of m design points, and their changes of component modes.

    Attributes
    ----------
    damping_ratio : ndarray (m, n)
        Damping ratio of each real mode of the assembly, ascending in frequency.
    stiffness_damping : ndarray (m,)
        Factor of the stiffness damping beta K_sym, s.
    scale : ndarray (m, n) or (1, n)
        Factor on the frequency of each component mode.
    component_ratio : ndarray (m, n) or (1, n)
        Damping ratio of each component mode at its scaled frequency.
    uniform_ratio : ndarray (m,)
        Damping ratio of the real modes that have no parameter of their own.
    named_modes : tuple of int
        Numbers of the real modes, from 0, whose damping ratio is a parameter of its own.
    named_coordinates : tuple of int
        Coordinates of the component modes that parameters change or damp.
    """

    damping_ratio: np.ndarray
    stiffness_damping: np.ndarray
    scale: np.ndarray
    component_ratio: np.ndarray
    uniform_ratio: np.ndarray
    named_modes: tuple[int, ...]
    named_coordinates: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class StackedLinear:
    """Matrices of m design points in component-mode coordinates; the mass is the identity.

    Attributes
    ----------
    C, K, K_sym : ndarray (m, n, n)
        As in `LinearisedModel`, rad/s and (rad/s)^2.
    elastic : ndarray (m, n)
        Elastic stiffness of the components with their changes, (rad/s)^2.
    normal : ndarray (m, c)
        Contact stiffness of each point, N/m.
    finite : ndarray (m,) of bool
        Design points whose matrices have no entry too large to compute with.
    """

    C: np.ndarray
    K: np.ndarray
    K_sym: np.ndarray
    elastic: np.ndarray
    normal: np.ndarray
    finite: np.ndarray


def linearised(
    structures: StackedStructures,
    sliding: StackedSliding,
    operating: StackedOperating,
    damping: StackedDamping,
) -> StackedLinear:
    """Damping and stiffness of a batch, whose mass is the identity (THEORY.md eq. (17) to (20))."""
    s, p = structures, sliding.pressure
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        friction = operating.rubbing(p, s.speed_factor, s.own_friction)
        normal = s.area * sliding.tangent
        rubbing = s.area * p * s.frictional
        coupling = -friction.following(p) * s.frictional * normal
        speed = operating.sliding_speed[:, None] * s.speed_factor
        across = over_speed(friction.mu * rubbing, speed)
        elastic = s.k_el * damping.scale**2
        omega = np.sqrt(np.maximum(s.k_el, 0.0)) * damping.scale
        dampers = 2.0 * damping.component_ratio * omega
        K_sym = quadratic(s.N, normal, s.N) + s.springs
        diagonal = np.arange(s.n)
        K_sym[:, diagonal, diagonal] += elastic
        K = K_sym + quadratic(s.T, coupling, s.N)
        C = quadratic(s.T_perp, across, s.T_perp)
        if friction.by_speed.any():
            C = C + quadratic(s.T, friction.by_speed * rubbing, s.T)
        if s.C is not None:
            C = C + s.C
        C = C + damping.stiffness_damping[:, None, None] * K_sym
        C[:, diagonal, diagonal] += dampers
        finite = computable(K) & computable(C)
        damped = np.flatnonzero(finite & damping.damping_ratio.any(axis=1))
        if len(damped):
            C[damped] += modal_damping(K_sym[damped], damping.damping_ratio[damped])
    finite &= computable(C)
    return StackedLinear(C, K, K_sym, np.broadcast_to(elastic, (len(K), s.n)), normal, finite)


def computable(A: np.ndarray) -> np.ndarray:
    """Which of m arrays (m, ...) have squares, and sums of squares, that are finite: (m,)."""
    rows = np.abs(A).reshape(len(A), -1)
    is_computable: np.ndarray = (rows <= MAX_SQUARABLE_ENTRY).all(axis=1)  # False for NaN
    return is_computable


def modal_damping(K_sym: np.ndarray, zeta: np.ndarray) -> np.ndarray:
    """Modal damping phi 2 zeta omega phi^T (m, n, n) of the real modes of K_sym; zeta (m, n)."""
    w2, phi = np.linalg.eigh(K_sym)
    weighted = phi * (2.0 * zeta * np.sqrt(np.maximum(w2, 0.0)))[:, None, :]
    damping: np.ndarray = weighted @ phi.swapaxes(1, 2)
    return damping


def quadratic(L: np.ndarray, weights: np.ndarray, R: np.ndarray) -> np.ndarray:
    """L^T diag(weights) R (m, n, n) of L, R (m or 1, c, n) and weights (m, c)."""
    product: np.ndarray = L.swapaxes(1, 2) @ (weights[:, :, None] * R)
    return product
