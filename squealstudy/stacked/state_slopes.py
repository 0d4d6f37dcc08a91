"""Parameters of design states in a batch: values, finite changes and derivatives."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from squealstudy.models.operating import DAMPING, PRESSURE, SLIDING_SPEED, STIFFNESS_DAMPING
from squealstudy.modes.sensitivity.state_derivatives import FREQUENCY, StateParameter
from squealstudy.stacked.law_slopes import friction_slope
from squealstudy.stacked.linear_slopes import (
    MatrixSlope,
    ModalSlopes,
    SlidingSlopes,
    matrix_slope,
)
from squealstudy.stacked.modes import StackedSystem, system_about_sliding
from squealstudy.system.contact_weights import ContactChange


@dataclass(frozen=True, eq=False)
class StackedStep:
    """A parameter of m design points with its finite change at each, as in `Step`.

    Attributes
    ----------
    name : str
    value, reference, size, component_hz : ndarray (m,)
    """

    name: str
    value: np.ndarray
    reference: np.ndarray
    size: np.ndarray
    component_hz: np.ndarray


@dataclass(frozen=True, eq=False)
class StateSlopes:
    """Derivatives of m design points by the parameters of their design states."""

    system: StackedSystem

    @cached_property
    def sliding(self) -> SlidingSlopes:
        """Derivatives of their gaps and contact."""
        return SlidingSlopes(self.system)

    @cached_property
    def modal(self) -> ModalSlopes:
        """Derivatives of their modal damping."""
        return ModalSlopes(self.system)

    def places(self, parameter: StateParameter) -> list[int]:
        """Coordinates of the parameter's component modes, or its real modes from 0; or KeyError."""
        if not parameter.component:
            return [mode - 1 for mode in parameter.modes]
        structures = self.system.structures
        return [structures.coordinate(parameter.component, mode) for mode in parameter.modes]

    def value(self, parameter: StateParameter) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) of a parameter, and whether (m,) all its modes have the same value."""
        damping, count = self.system.damping, len(self.system.linear.K)
        if not parameter.modes:
            is_common = np.ones(count, dtype=bool)
            if parameter.name == DAMPING.name:
                return damping.uniform_ratio, is_common
            if parameter.name == STIFFNESS_DAMPING.name:
                return damping.stiffness_damping, is_common
            return self.system.operating.value(parameter.name), is_common
        values = self._of_modes(parameter)[:, self.places(parameter)]
        values = np.broadcast_to(values, (count, values.shape[1]))
        return values[:, 0], (values == values[:, :1]).all(axis=1)

    def _of_modes(self, parameter: StateParameter) -> np.ndarray:
        damping = self.system.damping
        if not parameter.component:
            return damping.damping_ratio
        return damping.scale if parameter.quantity == FREQUENCY else damping.component_ratio

    def step(self, parameter: StateParameter, change: float, top_hz: float) -> StackedStep:
        """The finite change: upwards, or downwards where it would exceed the maximum."""
        values, _ = self.value(parameter)
        size = np.abs(values)
        reference = np.where(size > 0, size, 1.0)
        if DAMPING.name in (parameter.name, parameter.quantity):
            reference = np.ones(len(values))
        elif parameter.name == STIFFNESS_DAMPING.name:
            reference = np.where(size > 0, size, 1.0 / (math.pi * top_hz))
        change_by = change * reference
        hz = np.full(len(values), np.nan)
        if parameter.component and len(parameter.modes) == 1:
            coordinate = self.places(parameter)[0]
            hz = np.broadcast_to(self._scaled[:, coordinate], len(values)) / (2 * math.pi)
        return StackedStep(
            name=parameter.name,
            value=values,
            reference=reference,
            size=np.where(values + change_by <= parameter.maximum, change_by, -change_by),
            component_hz=hz,
        )

    @property
    def _omega(self) -> np.ndarray:
        """Free frequencies (m or 1, n) of the component modes, rad/s."""
        omega: np.ndarray = np.sqrt(np.maximum(self.system.structures.k_el, 0.0))
        return omega

    @property
    def _scaled(self) -> np.ndarray:
        scaled: np.ndarray = self.system.damping.scale * self._omega
        return scaled

    def moved(self, parameter: StateParameter, value: np.ndarray) -> StackedSystem:
        """The design points with other values (m,) of a parameter, at their own steady sliding."""
        damping, operating = self.system.damping, self.system.operating
        if parameter.modes:
            before = self._of_modes(parameter)
            after = np.broadcast_to(before, (len(value), before.shape[1])).copy()
            after[:, self.places(parameter)] = value[:, None]
            field = "damping_ratio"
            if parameter.component:
                field = "scale" if parameter.quantity == FREQUENCY else "component_ratio"
            changed = {field: after}
            damping = replace(damping, **changed)  # type: ignore[arg-type]
        elif parameter.name == DAMPING.name:
            ratio = np.repeat(value[:, None], damping.damping_ratio.shape[1], axis=1)
            named = list(damping.named_modes)
            ratio[:, named] = damping.damping_ratio[:, named]
            damping = replace(damping, damping_ratio=ratio, uniform_ratio=value)
        elif parameter.name == STIFFNESS_DAMPING.name:
            damping = replace(damping, stiffness_damping=value)
        else:
            operating = operating.with_value(parameter.name, value)
        return system_about_sliding(self.system.structures, operating, damping, {})

    @np.errstate(over="ignore", invalid="ignore", divide="ignore")
    def by(self, parameter: StateParameter) -> MatrixSlope:
        """Derivatives of the matrices by one parameter; steady sliding follows it."""
        if parameter.modes:
            return self._by_modes(parameter)
        system, name = self.system, parameter.name
        if name == DAMPING.name:
            ratios = np.ones(system.structures.n)
            ratios[list(system.damping.named_modes)] = 0.0
            return self.modal.by_ratios(ratios)
        if name == STIFFNESS_DAMPING.name:
            return MatrixSlope(np.zeros(system.linear.K.shape), system.linear.K_sym)
        sliding = self.sliding
        if name == PRESSURE.name:
            unit = np.broadcast_to(system.structures.load[..., 0], system.linear.K.shape[:2])
            gap = sliding.gaps_by_forces(-unit)
            return matrix_slope(system, sliding.contact(gap, ContactChange()))
        operating, by = system.operating, ContactChange()
        gap = np.zeros(system.sliding.gap.shape)
        of_law = [p.name for p in operating.law.parameters]
        of_curve = [p.name for p in operating.curve.parameters]
        if name in of_law:
            dp, dkappa = sliding.by_law[1 + of_law.index(name)]
            by, gap = ContactChange(pressure=dp, tangent=dkappa), sliding.gaps_by_law(dp)
        if name not in of_law or name in of_curve:
            p, factor = system.sliding.pressure, sliding.speed_factor
            mu, by_speed, by_pressure = friction_slope(operating, name, p, factor, sliding.own)
            by = by._replace(
                mu=mu,
                by_speed=by_speed,
                by_pressure=by_pressure,
                speed=factor if name == SLIDING_SPEED.name else 0.0,
            )
            gap = gap + sliding.gaps_by_friction(mu)
        return matrix_slope(system, sliding.contact(gap, by))

    def _by_modes(self, parameter: StateParameter) -> MatrixSlope:
        """Derivatives of the matrices by a frequency scale or damping ratio of modes."""
        system, n = self.system, self.system.structures.n
        coordinates = self.places(parameter)
        if not parameter.component:
            ratios = np.zeros(n)
            ratios[coordinates] = 1.0
            return self.modal.by_ratios(ratios)
        count, chosen = len(system.linear.K), np.zeros(n)
        chosen[coordinates] = 1.0
        if parameter.quantity != FREQUENCY:
            dampers = _diagonal(np.broadcast_to(2.0 * self._scaled * chosen, (count, n)))
            return matrix_slope(system, None, damping=dampers)
        by_scale = np.broadcast_to(2.0 * self._scaled * self._omega * chosen, (count, n))
        ratio = system.damping.component_ratio
        dampers = np.broadcast_to(2.0 * ratio * self._omega * chosen, (count, n))
        gap = self.sliding.gaps_by_forces(by_scale * self.sliding.displacement)
        contact = self.sliding.contact(gap, ContactChange())
        return matrix_slope(system, contact, _diagonal(by_scale), _diagonal(dampers))


def _diagonal(values: np.ndarray) -> np.ndarray:
    diagonal: np.ndarray = values[:, :, None] * np.eye(values.shape[1])
    return diagonal
