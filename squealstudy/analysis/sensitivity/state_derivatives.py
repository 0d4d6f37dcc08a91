"""Derivatives of a reduced system's weights by the parameters of a design state.

They are total: the working point moves with the parameter.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from squealstudy.analysis.sensitivity.law_change import (
    FRICTION_PARAMETERS,
    friction_change,
    law_change,
    tangent_slope,
)
from squealstudy.analysis.sensitivity.state_parameter import (
    DAMPING,
    FREQUENCY,
    PRESSURE,
    STIFFNESS_DAMPING,
    StateParameter,
)
from squealstudy.analysis.sensitivity.working_point_motion import WorkingPointMotion
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
        if name in FRICTION_PARAMETERS:
            change = friction_change(operating, name)
            by = ContactChange(mu=change.mu, by_speed=change.slope, speed=change.speed)
            return self._moved(self.motion.by_friction(by.mu), by)
        dp, dkappa = law_change(operating.law, name, self._point.gap)
        return self._moved(self.motion.by_law(dp), ContactChange(pressure=dp, tangent=dkappa))

    def contact(self, gap: np.ndarray, by: ContactChange) -> ContactWeights:
        """Derivative of the contact weights with the motion `gap` (nc,) of the gaps."""
        point, law = self._point, self._state.operating.law
        total = by._replace(
            pressure=by.pressure - point.tangent * gap,
            tangent=by.tangent + tangent_slope(law, point.gap) * gap,
        )
        return contact_weights_change(self.structure, point, self._state.operating, total)

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
