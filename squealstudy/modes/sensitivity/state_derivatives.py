"""Derivatives of a reduced system's weights by the parameters of a design state.

They are total: the working point moves with the parameter, by implicit differentiation. The gaps
obey F(g; theta) = 0 (reduction.working_point), so dF/dg dg = -dF/dtheta. The right side is the
static response N K0^-1 of forces out of balance at fixed gaps: K_s u = f + N^T A p - mu T^T A p
with u the static displacement and K_s the stiffness without contact.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import scipy.linalg as la

from squealstudy.models.operating import FRICTION, SLIDING_SPEED, OperatingPoint
from squealstudy.modes.sensitivity.state_parameter import (
    DAMPING,
    FREQUENCY,
    PRESSURE,
    STIFFNESS_DAMPING,
    StateParameter,
)
from squealstudy.reduction.contact_space import ContactSpace
from squealstudy.reduction.prepared import PreparedModel, shape_column
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.contact_weights import (
    ContactChange,
    ContactWeights,
    contact_weights_change,
)
from squealstudy.system.design_state import DesignState
from squealstudy.system.linearise import StructureWeights, reduced_structure, structure_weights


class WeightChange(NamedTuple):
    """Derivative of a reduced system by one parameter.

    Attributes
    ----------
    weights : StructureWeights
    ratios : ndarray (n,) or None
        Of the damping ratios of the assembly's real modes.
    """

    weights: StructureWeights
    ratios: np.ndarray | None = None


def friction_change(operating: OperatingPoint, name: str, p: np.ndarray) -> ContactChange:
    """Friction by the sliding speed, its coefficient or a parameter of its curve.

    At fixed pressures p (nc,) [Pa].
    """
    rows = operating.curve.slopes(operating.friction, operating.sliding_speed, p)
    if name == SLIDING_SPEED.name:
        mu, by_speed, by_pressure = rows[0]
        return ContactChange(mu=mu, by_speed=by_speed, by_pressure=by_pressure, speed=1.0)
    mu, by_speed, by_pressure = rows[2 + [FRICTION.name, *operating.curve.names].index(name)]
    return ContactChange(mu=mu, by_speed=by_speed, by_pressure=by_pressure)


class StateDerivatives:
    """What the reduced system of one design point does under each of its parameters."""

    def __init__(self, prepared: PreparedModel, state: DesignState, point: WorkingPoint) -> None:
        self._model, self._state, self._point = prepared.model, state, point
        self.structure = reduced_structure(prepared.model)
        changes = state.stiffness_changes(self.structure.frequencies)
        columns = {shape_column(prepared.model, *key): dk for key, dk in changes.items()}
        self.motion = WorkingPointMotion(
            space=prepared.space, stiffness_changes=columns, operating=state.operating, point=point
        )

    def by(self, parameter: StateParameter) -> WeightChange:
        """Derivative by one parameter."""
        if parameter.modes:
            return self._by_modes(parameter)
        operating, name = self._state.operating, parameter.name
        if name == DAMPING:
            ratios = np.ones(self._model.n)
            ratios[[mode - 1 for mode in self._state.assembly_damping]] = 0.0
            return WeightChange(StructureWeights(), ratios)
        if name == STIFFNESS_DAMPING:
            own = self.structure.weights(self._point, self._state)
            by_beta = {"spring_damping": own.springs, "normal_damping": own.normal}
            return WeightChange(StructureWeights(elastic_damping=own.elastic, **by_beta))
        if name == PRESSURE:
            return self._moved(self.motion.by_pressure())
        if name in operating.law.names:
            dp, dkappa = operating.law.slopes(self._point.gap)[1 + operating.law.names.index(name)]
            return self._moved(self.motion.by_law(dp), ContactChange(pressure=dp, tangent=dkappa))
        by = friction_change(operating, name, self._point.pressure)
        return self._moved(self.motion.by_friction(by.mu), by)

    def contact(self, gap: np.ndarray, by: ContactChange) -> ContactWeights:
        """Derivative of the contact weights with the motion `gap` (nc,) of the gaps."""
        point, operating = self._point, self._state.operating
        dp, dkappa = operating.law.slopes(point.gap)[0]
        total = by._replace(pressure=by.pressure + dp * gap, tangent=by.tangent + dkappa * gap)
        if operating.curve.pressure_dependent:
            rows = operating.curve.slopes(
                operating.friction, operating.sliding_speed, point.pressure
            )
            mu, by_speed, by_pressure = rows[1] * total.pressure
            total = total._replace(
                mu=by.mu + mu,
                by_speed=by.by_speed + by_speed,
                by_pressure=by.by_pressure + by_pressure,
            )
        return contact_weights_change(self.structure, point, operating, total)

    def _moved(self, gap: np.ndarray, by: ContactChange | None = None) -> WeightChange:
        contact = self.contact(gap, by or ContactChange())
        beta = self._state.stiffness_damping
        return WeightChange(structure_weights((0.0, 0.0, 0.0), contact, beta=beta, mass=0.0))

    def _by_modes(self, parameter: StateParameter) -> WeightChange:
        if not parameter.component:
            ratios = np.zeros(self._model.n)
            ratios[[mode - 1 for mode in parameter.modes]] = 1.0
            return WeightChange(StructureWeights(), ratios)
        state, omega = self._state, self.structure.frequencies
        keys = [(parameter.component, mode) for mode in parameter.modes]
        scaled = {key: state.frequency_scale.get(key, 1.0) * omega[key] for key in keys}
        if parameter.quantity != FREQUENCY:
            dampers, _ = self.structure.by_mode({key: 2.0 * scaled[key] for key in keys})
            return WeightChange(StructureWeights(elastic_damping=dampers))
        by_key = {key: 2.0 * scaled[key] * omega[key] for key in keys}
        stiffness, _ = self.structure.by_mode(by_key)
        dampers, _ = self.structure.by_mode(
            {key: 2.0 * state.mode_damping.get(key, 0.0) * omega[key] for key in keys}
        )
        gap = np.zeros(len(self._point.gap))
        for key, dk in by_key.items():
            gap += dk * self.motion.by_mode_stiffness(shape_column(self._model, *key))
        contact = self.contact(gap, ContactChange())
        return WeightChange(
            structure_weights(
                (stiffness, 0.0, 0.0), contact, (dampers, 0.0), state.stiffness_damping, mass=0.0
            )
        )


class WorkingPointMotion:
    """Derivatives of the gaps at one working point, from one factorisation of dF/dg.

    Parameters
    ----------
    space : ContactSpace
        Unchanged, of the prepared structure.
    stiffness_changes : mapping of column of U -> float
        Changes of component modes' modal stiffness in force, (rad/s)^2.
    operating : OperatingPoint
    point : WorkingPoint
    """

    def __init__(
        self,
        space: ContactSpace,
        stiffness_changes: Mapping[int, float],
        operating: OperatingPoint,
        point: WorkingPoint,
    ) -> None:
        self._space, self._operating = space, operating
        self._changes = {j: dk for j, dk in stiffness_changes.items() if dk}
        self._now = space.changed(self._changes)
        following = operating.friction_at(point.pressure).following(point.pressure)
        self._grip = following * space.frictional
        self.point = point
        A = space.area
        J = self._now.H_NN * (A * (point.tangent - space.k_c))
        J -= self._now.H_NT * (A * self._grip * point.tangent)
        J[np.diag_indices_from(J)] += 1.0
        self._lu = la.lu_factor(J, overwrite_a=True, check_finite=False)
        self._normal = A * (point.pressure + space.k_c * (point.gap - space.gap0))
        self._sliding = A * space.frictional * operating.traction(point.pressure)

    def solve(self, imbalance: np.ndarray) -> np.ndarray:
        """Motion dg (nc,) from dF/dtheta (nc,) at fixed gaps."""
        moved: np.ndarray = la.lu_solve(self._lu, -imbalance, check_finite=False)
        return moved

    def by_friction(self, mu: float | np.ndarray) -> np.ndarray:
        """Motion by a change of the friction coefficient, a number or (nc,)."""
        if not np.any(mu):
            return np.zeros(len(self.point.gap))
        drag = self._space.area * self._space.frictional * self.point.pressure
        return self.solve(self._now.H_NT @ (drag * mu))

    def by_pressure(self) -> np.ndarray:
        """Motion by the brake pressure, m/Pa."""
        return self.solve(-self._now.H_Nf[:, 0])

    def by_law(self, dp: np.ndarray) -> np.ndarray:
        """Motion by a change dp (nc,) of the pressure at fixed gaps."""
        force = self._space.area * dp
        return self.solve(self._now.H_NT @ (self._grip * force) - self._now.H_NN @ force)

    def by_mode_stiffness(self, column: int) -> np.ndarray:
        """Motion by a component mode's modal stiffness, m s^2: column of U of the space."""
        h_N, h_T, h_f = self._shape_compliances(column)
        loads = np.array([self._operating.pressure, 1.0])
        displacement = h_f @ loads + h_N @ self._normal - h_T @ self._sliding
        return self.solve(h_N * displacement)

    def _shape_compliances(self, column: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """N, T and load compliances to the shape U of one mode, with the changes in force."""
        s = self._space
        parts = (s.H_NU, s.H_TU, s.H_fU)
        own = [np.asarray(H[:, column]) for H in parts]
        if not self._changes:
            return own[0], own[1], own[2]
        j = np.fromiter(self._changes.keys(), dtype=int)
        d = np.fromiter(self._changes.values(), dtype=float)
        core = np.eye(len(j)) + d[:, None] * s.H_UU[np.ix_(j, j)]
        share = la.solve(core, d * s.H_UU[j, column])
        changed = [h - H[:, j] @ share for h, H in zip(own, parts, strict=True)]
        return changed[0], changed[1], changed[2]
