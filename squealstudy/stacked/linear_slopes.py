"""Derivatives of linearised matrices by parameters, for sensitivities of many small models.

Steady sliding changes with the parameter, and the contact with it: derivatives are total.

`StateDerivatives` and `WorkingPointDerivatives` give the same for one design point. Derivatives
come from implicit differentiation of the gap equations, and are exact where laws give their slopes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from squealstudy.laws.own_friction import has_own
from squealstudy.modes.sensitivity.mode_gradient import damping_factors
from squealstudy.stacked.law_slopes import friction_by_pressure, point_slopes
from squealstudy.stacked.linear import quadratic
from squealstudy.stacked.modes import StackedSystem
from squealstudy.stacked.sliding import PointRows, gap_equations
from squealstudy.system.contact_weights import ContactChange, ContactWeights, changed_weights


@dataclass(frozen=True, eq=False)
class MatrixSlope:
    """Derivatives by one parameter of the matrices of m design points.

    Each design point has the coordinates of its own component modes.

    Attributes
    ----------
    K, C : ndarray (m, n, n)
        Derivatives of stiffness and damping. The change of modal damping with the stiffness is left
        out: `ModalSlopes.following` gives it.
    K_sym : ndarray (m, n, n) or None
        Derivative of the symmetric stiffness; None where it is zero.
    M : ndarray (m, n, n) or None
        Derivative of the mass; None where it is zero.
    """

    K: np.ndarray
    C: np.ndarray
    K_sym: np.ndarray | None = None
    M: np.ndarray | None = None


class SlidingSlopes:
    """Derivatives of gaps and contact weights of m design points, by the implicit function theorem.

    A parameter disturbs the equations of steady sliding at fixed gaps. The methods `gaps...` return
    how the gaps change so that the equations hold again.

    Parameters
    ----------
    system : StackedSystem
        Rows of design points that failed give meaningless derivatives.
    """

    def __init__(self, system: StackedSystem) -> None:
        s, sliding, operating = system.structures, system.sliding, system.operating
        self._system = system
        shape = sliding.gap.shape
        elastic = np.broadcast_to(system.linear.elastic, (len(sliding.gap), s.n))
        self._equations, _ = gap_equations(s, elastic, operating)
        gap0 = np.broadcast_to(s.gap0, shape)
        self._rows = PointRows(self._equations, gap0, np.arange(shape[0]))
        self.area, self.frictional = self._equations.area, np.broadcast_to(s.frictional, shape)
        self.speed_factor = np.broadcast_to(s.speed_factor, shape)
        self.own = s.own_friction
        self.friction = operating.rubbing(sliding.pressure, self.speed_factor, self.own)
        self._normal = self._equations.moved[:, :, : shape[1]]  # by normal forces

    @cached_property
    def by_law(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Derivatives of pressure and tangent at the gaps of steady sliding (`point_slopes`)."""
        system = self._system
        springs = system.structures.spring_points
        return point_slopes(system.operating, system.sliding.gap, springs)

    @cached_property
    def displacement(self) -> np.ndarray:
        """Static displacement (m, n) of steady sliding, m sqrt(kg)."""
        e, p, gap = self._equations, self._system.sliding.pressure, self._system.sliding.gap
        gap0 = self._system.structures.gap0
        normal = self.area * (p + e.k_c * (gap - gap0))
        drag = self.area * self.friction.mu * self.frictional * p
        forces = np.concatenate([normal, -drag, np.ones((len(p), 1))], axis=1)
        displacement: np.ndarray = np.einsum("mij,mj->mi", e.moved, forces)
        return displacement

    def gaps(self, imbalance: np.ndarray) -> np.ndarray:
        """Change (m, c) of the gaps by a change `imbalance` (m, c) of the gap equations."""
        sliding = self._system.sliding
        return -self._rows.newton(imbalance, sliding.pressure, sliding.tangent)

    def gaps_by_forces(self, unbalanced: np.ndarray) -> np.ndarray:
        """Change (m, c) of the gaps by unbalanced forces (m, n) on the coordinates."""
        return self.gaps(np.einsum("mic,mi->mc", self._normal, unbalanced))

    def gaps_by_opening(self, opening: np.ndarray) -> np.ndarray:
        """Change (m, c) of the gaps by a change `opening` (m, c) of the gaps without load."""
        if not opening.any():
            return np.zeros(opening.shape)
        e = self._equations
        pushed = np.einsum("mij,mj->mi", e.by_normal, self.area * e.k_c * opening)
        return self.gaps(pushed - opening)

    def gaps_by_friction(self, mu: np.ndarray) -> np.ndarray:
        """Change (m, c) of the gaps by a change `mu` (m, c) of the friction coefficients."""
        drag = self.area * self.frictional * self._system.sliding.pressure * mu
        return self.gaps(np.einsum("mij,mj->mi", self._equations.by_sliding, drag))

    def gaps_by_law(self, dp: np.ndarray) -> np.ndarray:
        """Change (m, c) of the gaps by a change `dp` (m, c) of the pressures that the law gives."""
        e, p = self._equations, self._system.sliding.pressure
        force = self.area * dp
        grip = self.friction.following(p) * self.frictional
        opened = np.einsum("mij,mj->mi", e.by_normal, force)
        return self.gaps(np.einsum("mij,mj->mi", e.by_sliding, grip * force) - opened)

    def contact(self, gap: np.ndarray, by: ContactChange) -> ContactWeights:
        """Derivatives (m, c) of the contact weights, with the change `gap` (m, c) of the gaps.

        `by` holds what changes at fixed gaps.
        """
        system, p = self._system, self._system.sliding.pressure
        dp, dkappa = self.by_law[0]
        total = by._replace(pressure=by.pressure + dp * gap, tangent=by.tangent + dkappa * gap)
        operating, curve = system.operating, system.operating.curve
        if curve.pressure_dependent and (has_own(self.own) or not self._constant):
            rows = friction_by_pressure(operating, p, self.speed_factor, self.own)
            rows = rows * total.pressure
            total = total._replace(
                mu=by.mu + rows[0],
                by_speed=by.by_speed + rows[1],
                by_pressure=by.by_pressure + rows[2],
            )
        speed = operating.sliding_speed[:, None] * self.speed_factor
        tangent = system.sliding.tangent
        return changed_weights(self.area, self.frictional, p, tangent, self.friction, speed, total)

    @property
    def _constant(self) -> bool:
        """Whether friction is the same at all pressures and speeds, by the curve's parameters."""
        operating = self._system.operating
        constant = operating.curve.constant
        return constant is not None and bool(np.all(constant(*operating.curve_values)))


def matrix_slope(
    system: StackedSystem,
    contact: ContactWeights | None,
    stiffness: np.ndarray | None = None,
    damping: np.ndarray | None = None,
    mass: np.ndarray | None = None,
) -> MatrixSlope:
    """Derivatives of the matrices from those of components, springs and contact.

    Parameters
    ----------
    system : StackedSystem
    contact : ContactWeights or None
        Derivatives (m, c) of the contact weights, the moving working point included; None where
        they are zero.
    stiffness, damping, mass : ndarray (m, n, n) or None
        Derivatives of components and springs. Damping that is proportional to stiffness is added
        here.
    """
    s = system.structures
    zeros = np.zeros(system.linear.K.shape)
    symmetric = zeros if stiffness is None else stiffness
    C = zeros if damping is None else damping
    K = symmetric
    if contact is not None:
        symmetric = symmetric + quadratic(s.N, contact.normal, s.N)
        K = symmetric + quadratic(s.T, contact.coupling, s.N)
        C = C + quadratic(s.T_perp, contact.across, s.T_perp)
        if np.any(contact.along):
            C = C + quadratic(s.T, contact.along, s.T)
    C = C + system.damping.stiffness_damping[:, None, None] * symmetric
    changes_stiffness = stiffness is not None or contact is not None
    return MatrixSlope(K, C, symmetric if changes_stiffness else None, mass)


class ModalSlopes:
    """Derivatives of the modal damping of m design points by damping ratios, stiffness and mass.

    Real modes are those of the symmetric stiffness; `mode_gradient` explains the factors.
    """

    def __init__(self, system: StackedSystem) -> None:
        self._system = system
        self._damped = bool(system.damping.damping_ratio.any())

    @cached_property
    def _real(self) -> tuple[np.ndarray, np.ndarray]:
        w2, phi = np.linalg.eigh(self._system.linear.K_sym)
        return w2, phi

    @cached_property
    def _factors(self) -> tuple[np.ndarray, np.ndarray]:
        return damping_factors(self._real[0], self._system.damping.damping_ratio)

    def by_ratios(self, ratios: np.ndarray) -> MatrixSlope:
        """Derivatives of the matrices by damping ratios of real modes, summed with weights (n,)."""
        w2, phi = self._real
        weighted = phi * (2.0 * np.sqrt(np.maximum(w2, 0.0)) * ratios)[:, None, :]
        C = weighted @ phi.swapaxes(1, 2)
        return MatrixSlope(np.zeros(C.shape), C)

    def following(self, by: MatrixSlope) -> np.ndarray | None:
        """Change (m, n, n) of modal damping with stiffness and mass; None where it is zero."""
        if not self._damped or (by.K_sym is None and by.M is None):
            return None
        phi = self._real[1]
        phi_T = phi.swapaxes(1, 2)
        mode_change = np.zeros(phi.shape)
        for factor, matrix in zip(self._factors, (by.K_sym, by.M), strict=True):
            if matrix is not None:
                mode_change = mode_change + factor * (phi_T @ matrix @ phi)
        damping: np.ndarray = phi @ mode_change @ phi_T
        return damping
