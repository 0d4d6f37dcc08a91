"""Derivatives of a reduced system's weights by the parameters of a design state.

They are total: the working point moves with the parameter.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from squealstudy.models.operating import FRICTION, SLIDING_SPEED, OperatingPoint
from squealstudy.modes.sensitivity.state_parameter import (
    DAMPING,
    FREQUENCY,
    PRESSURE,
    STIFFNESS_DAMPING,
    StateParameter,
)
from squealstudy.modes.sensitivity.working_point_motion import WorkingPointMotion
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
        self.motion = WorkingPointMotion(prepared.space, columns, state.operating, point)

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
