"""Derivatives of a reduced system's weights by the parameters of a design state.

They are total derivatives: the working point moves with the parameter. The gaps g obey
F(g; theta) = 0 (reduction.working_point), so implicit differentiation gives
dF/dg dg = -dF/dtheta. The right side is the static response N K0^-1 to the forces that are out of
balance at fixed gaps, in K_s u = f + N^T A p - mu T^T A p. There u is the static displacement and
K_s the stiffness without contact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg as la

from squealstudy.errors import ParameterError
from squealstudy.laws.own_friction import NO_OWN_FRICTION
from squealstudy.laws.spring import slopes_of_points
from squealstudy.models.operating import (
    DAMPING,
    FRICTION,
    GYROSCOPIC,
    PRESSURE,
    SLIDING_SPEED,
    STIFFNESS_DAMPING,
    DesignState,
    ModeKey,
    OperatingPoint,
)
from squealstudy.reduction.contact_space import ContactSpace
from squealstudy.reduction.gap_equations import GapJacobian
from squealstudy.reduction.prepared import PreparedModel, shape_column
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.contact_weights import (
    ContactChange,
    ContactWeights,
    contact_weights_change,
)
from squealstudy.system.linearise import (
    StructureWeights,
    reduced_structure,
    structure_weights,
)


class WeightChange(NamedTuple):
    """Derivative of a reduced system by one parameter.

    Attributes
    ----------
    weights : StructureWeights
        Derivatives of the weights.
    ratios : ndarray (n,) or None
        Derivatives of the damping ratios of the assembly's real modes; None where all are zero.
    """

    weights: StructureWeights
    ratios: np.ndarray | None = None


def friction_change(
    operating: OperatingPoint,
    name: str,
    p: np.ndarray,
    speed_factor: np.ndarray,
    own_friction: np.ndarray = NO_OWN_FRICTION,
) -> ContactChange:
    """Derivative of the friction by the sliding speed, the coefficient or a curve's parameter.

    Parameters
    ----------
    operating : OperatingPoint
        Friction curve and sliding speed.
    name : str
        The parameter.
    p : ndarray (nc,)
        Contact pressures, which do not change, Pa.
    speed_factor : ndarray (nc,)
        Sliding speed of each point over that of the study.
    own_friction : ndarray (nc, k)
        Friction of the points that do not follow the study's friction.
    """
    rows = operating.friction_slopes(p, speed_factor, own_friction)
    if name == SLIDING_SPEED.name:
        mu, by_speed, by_pressure = rows[0]
        return ContactChange(mu=mu, by_speed=by_speed, by_pressure=by_pressure, speed=speed_factor)
    mu, by_speed, by_pressure = rows[2 + [FRICTION.name, *operating.curve.names].index(name)]
    return ContactChange(mu=mu, by_speed=by_speed, by_pressure=by_pressure)


class StateDerivatives:
    """Derivatives of the reduced system of one design point by parameters of its state."""

    def __init__(self, prepared: PreparedModel, state: DesignState, point: WorkingPoint) -> None:
        self._model, self._state, self._point = prepared.model, state, point
        self.structure = reduced_structure(prepared.model)
        self._springs = prepared.space.spring_points
        changes = state.stiffness_changes(self.structure.frequencies)
        columns = {shape_column(prepared.model, *key): dk for key, dk in changes.items()}
        self.motion = WorkingPointDerivatives(
            space=prepared.space, stiffness_changes=columns, operating=state.operating, point=point
        )

    def by(self, parameter: StateParameter) -> WeightChange:
        """Derivatives of the weights by one parameter of the design state, at the working point."""
        if parameter.modes:
            return self._by_modes(parameter)
        operating, name = self._state.operating, parameter.name
        if name == DAMPING.name:
            ratios = np.ones(self._model.n)
            ratios[[mode - 1 for mode in self._state.assembly_damping]] = 0.0
            return WeightChange(StructureWeights(), ratios)
        if name == STIFFNESS_DAMPING.name:
            weights = self.structure.weights(self._point, self._state)
            by_beta = {"spring_damping": weights.springs, "normal_damping": weights.normal}
            return WeightChange(StructureWeights(elastic_damping=weights.elastic, **by_beta))
        if name == PRESSURE.name:
            return self._moved(self.motion.by_pressure())
        if name == GYROSCOPIC.name:
            turned = replace(operating, gyroscopic=1.0)
            turned.expect_turning(self.structure.turning, self.structure.unturned)
            return WeightChange(StructureWeights(turning=operating.sliding_speed))
        by, law = ContactChange(), operating.law
        gap = np.zeros(len(self._point.gap))
        if name in law.names:
            dp, dkappa = self._law_slopes[1 + law.names.index(name)]
            by, gap = ContactChange(pressure=dp, tangent=dkappa), self.motion.by_law(dp)
        if name not in law.names or name in operating.curve.names:
            p, of_points = self._point.contact_pressure, self.structure
            friction = friction_change(
                operating, name, p, of_points.speed_factor, of_points.own_friction
            )
            by = friction._replace(pressure=by.pressure, tangent=by.tangent)
            gap = gap + self.motion.by_friction(by.mu)
        weights, _ = self._moved(gap, by)
        if name == SLIDING_SPEED.name:
            weights = weights._replace(turning=operating.gyroscopic)
        return WeightChange(weights)

    @cached_property
    def _law_slopes(self) -> list[tuple[np.ndarray, np.ndarray]]:
        return slopes_of_points(self._state.operating.law, self._springs, self._point.gap)

    def contact(self, gap: np.ndarray, by: ContactChange) -> ContactWeights:
        """Derivative of the contact weights, with the derivative `gap` (nc,) of the gaps.

        `by` holds the derivatives at fixed gaps.
        """
        point, operating = self._point, self._state.operating
        dp, dkappa = self._law_slopes[0]
        total = by._replace(pressure=by.pressure + dp * gap, tangent=by.tangent + dkappa * gap)
        if operating.curve.pressure_dependent:
            of_points = (self.structure.speed_factor, self.structure.own_friction)
            rows = operating.friction_slopes(point.contact_pressure, *of_points)
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
        """Change of the weights by a frequency scale or damping ratio of modes."""
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


class WorkingPointDerivatives:
    """Derivatives of the gaps at one working point, from one factorisation of dF/dg.

    Parameters
    ----------
    space : ContactSpace
        That of the prepared structure, without the changes of component modes.
    stiffness_changes : mapping of column of U -> float
        Changes of component modes' modal stiffness at this design point, (rad/s)^2.
    operating : OperatingPoint
        Friction curve, contact law and loads.
    point : WorkingPoint
        The working point.
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
        p, of_points = point.contact_pressure, (space.speed_factor, space.own_friction)
        self._grip = operating.friction_at(p, *of_points).following(p) * space.frictional
        self.point = point
        A = space.area
        self._jacobian = GapJacobian(self._now, operating, p, point.tangent)
        self._normal = A * (point.contact_pressure + space.k_c * (point.gap - space.gap0))
        self._sliding = A * space.frictional * operating.traction(p, *of_points)

    def solve(self, imbalance: np.ndarray) -> np.ndarray:
        """Derivative dg (nc,) of the gaps from dF/dtheta (nc,) at fixed gaps."""
        return self._jacobian.solve(-imbalance)

    def by_friction(self, mu: float | np.ndarray) -> np.ndarray:
        """Change of the gaps (nc,) with a change `mu` of the friction coefficient, one or (nc,)."""
        if not np.any(mu):
            return np.zeros(len(self.point.gap))
        drag = self._space.area * self._space.frictional * self.point.contact_pressure
        return self.solve(-self._now.opening(np.zeros_like(drag), drag * mu))

    def by_pressure(self) -> np.ndarray:
        """Derivative of the gaps (nc,) by the brake pressure, m/Pa."""
        return self.solve(-self._now.S_N @ self._now.C_Nf[:, 0])

    def by_law(self, dp: np.ndarray) -> np.ndarray:
        """Change of the gaps (nc,) with a change dp (nc,) of the pressure at fixed gaps."""
        force = self._space.area * dp
        return self.solve(-self._now.opening(force, self._grip * force))

    def by_mode_stiffness(self, column: int) -> np.ndarray:
        """Derivative of the gaps (nc,) by a component mode's modal stiffness, m s^2.

        `column` is that of the mode in U of the space.
        """
        h_N, h_T, h_f = self._shape_compliances(column)
        loads = np.array([self._operating.brake_pressure, 1.0])
        displacement = h_f @ loads + h_N @ self._normal - h_T @ self._sliding
        return self.solve(h_N * displacement)

    def _shape_compliances(self, column: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Compliances of gaps, sliding and loads to the shape of one mode of U, with changes."""
        s = self._space
        parts = (s.C_NU, s.C_TU, s.C_fU)
        shape_columns = [np.asarray(H[:, column]) for H in parts]
        if not self._changes:
            return s.S_N @ shape_columns[0], s.S_T @ shape_columns[1], shape_columns[2]
        j = np.fromiter(self._changes.keys(), dtype=int)
        d = np.fromiter(self._changes.values(), dtype=float)
        core = np.eye(len(j)) + d[:, None] * s.C_UU[np.ix_(j, j)]
        share = la.solve(core, d * s.C_UU[j, column])
        changed = [h - H[:, j] @ share for h, H in zip(shape_columns, parts, strict=True)]
        return s.S_N @ changed[0], s.S_T @ changed[1], changed[2]


FREQUENCY = "frequency_scale"


@dataclass(frozen=True)
class StateParameter:
    """A parameter that changes the design state and leaves the structure as it is.

    Attributes
    ----------
    name : str
        As in study files.
    component : str
        The component whose modes the parameter changes; empty otherwise.
    modes : tuple of int
        Numbers of the modes, from 1, that all take its value: modes of the component, or of the
        assembly where `component` is empty. Empty for a parameter of no mode.
    quantity : str
        ``frequency_scale`` or ``damping_ratio`` of those modes; empty without modes.
    maximum : float
        Largest value that it can take.
    """

    name: str
    component: str = ""
    modes: tuple[int, ...] = ()
    quantity: str = ""
    maximum: float = math.inf

    def value(self, state: DesignState) -> float:
        """Value of the parameter in a design state.

        Raises
        ------
        ParameterError
            Where its modes have different values, or neither the contact law nor the friction
            depends on it.
        """
        if not self.modes:
            return self._plain_value(state)
        values = {self._mode_value(state, mode) for mode in self.modes}
        if len(values) > 1:
            raise ParameterError(self.name, "its modes have different values in this study")
        return values.pop()

    def reference(self, value: float, top_hz: float) -> float:
        """The change that counts as 100 %.

        It is the size of the value. For damping ratios it is 1, so that 1 % is one point of
        critical damping; for a value of zero it is 1 too. For stiffness damping of zero it is the
        change that adds critical damping at `top_hz`.
        """
        if DAMPING.name in (self.name, self.quantity):
            return 1.0
        if not value and self.name == STIFFNESS_DAMPING.name:
            return 1.0 / (math.pi * top_hz)
        return abs(value) or 1.0

    def component_hz(self, state: DesignState, omega: Mapping[ModeKey, float]) -> float:
        """Scaled frequency of the component mode, Hz; NaN unless this is one such mode's value.

        `omega` holds the frequencies without the scale, rad/s.
        """
        if not self.component or len(self.modes) > 1:
            return math.nan
        key = self.component, self.modes[0]
        return state.frequency_scale.get(key, 1.0) * omega[key] / (2 * math.pi)

    def moved(self, state: DesignState, value: float) -> DesignState:
        """A copy of the design state with this parameter at `value`."""
        if self.modes:
            return self._moved_modes(state, value)
        if self.name == DAMPING.name:
            return replace(state, damping_ratio=value)
        if self.name == STIFFNESS_DAMPING.name:
            return replace(state, stiffness_damping=value)
        return replace(state, operating=state.operating.with_value(self.name, value))

    def _plain_value(self, state: DesignState) -> float:
        """Value of a parameter of the operating point or of damping."""
        operating = state.operating
        if self.name == DAMPING.name:
            return float(state.damping_ratio)
        if self.name == STIFFNESS_DAMPING.name:
            return float(state.stiffness_damping)
        if self.name not in operating.names:
            laws = f"the {operating.law.kind} contact law and {operating.curve.kind} friction"
            raise ParameterError(
                self.name, f"{laws} do not depend on it, they have {', '.join(operating.names)}"
            )
        return operating.value(self.name)

    def _mode_value(self, state: DesignState, mode: int) -> float:
        if not self.component:
            return float(state.assembly_damping.get(mode, state.damping_ratio))
        if self.quantity == FREQUENCY:
            return float(state.frequency_scale.get((self.component, mode), 1.0))
        return float(state.mode_damping.get((self.component, mode), 0.0))

    def _moved_modes(self, state: DesignState, value: float) -> DesignState:
        """The state with another value for the modes of the parameter."""
        if not self.component:
            damping = {**state.assembly_damping, **dict.fromkeys(self.modes, value)}
            return replace(state, assembly_damping=damping)
        changed = {(self.component, mode): value for mode in self.modes}
        if self.quantity == FREQUENCY:
            return replace(state, frequency_scale={**state.frequency_scale, **changed})
        return replace(state, mode_damping={**state.mode_damping, **changed})
