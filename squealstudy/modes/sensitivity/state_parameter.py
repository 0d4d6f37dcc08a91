"""Parameters of a design state: what each one is, and the state with it changed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from squealstudy.errors import ParameterError
from squealstudy.system.design_state import DesignState, ModeKey

PRESSURE, DAMPING, STIFFNESS_DAMPING = "pressure", "damping_ratio", "stiffness_damping"
FREQUENCY = "frequency_scale"


@dataclass(frozen=True)
class StateParameter:
    """A number that a design state depends on, without a new structure.

    Attributes
    ----------
    name : str
        As in study files.
    component : str
        Of a component-mode parameter; empty otherwise.
    modes : tuple of int
        Component modes, or assembly modes where `component` is empty, that move together.
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
        """Value in a state.

        Raises
        ------
        ParameterError
            Modes that have different values; a parameter that the contact law does not have.
        """
        if not self.modes:
            return self._plain_value(state)
        values = {self._mode_value(state, mode) for mode in self.modes}
        if len(values) > 1:
            raise ParameterError(self.name, "its modes have different values in this study")
        return values.pop()

    def reference(self, value: float, top_hz: float) -> float:
        """The change that counts as 100 %.

        The value itself; for damping ratios 1, so that 1 % is one point of critical damping, and
        for values of zero 1. Stiffness damping of zero is told by what it adds at `top_hz`.
        """
        if DAMPING in (self.name, self.quantity):
            return 1.0
        if not value and self.name == STIFFNESS_DAMPING:
            return 1.0 / (math.pi * top_hz)
        return abs(value) or 1.0

    def component_hz(self, state: DesignState, omega: Mapping[ModeKey, float]) -> float:
        """Frequency of the component mode, as scaled; NaN where it is not one mode's parameter."""
        if not self.component or len(self.modes) > 1:
            return math.nan
        key = self.component, self.modes[0]
        return state.frequency_scale.get(key, 1.0) * omega[key] / (2 * math.pi)

    def moved(self, state: DesignState, value: float) -> DesignState:
        """The state with this parameter at `value`."""
        if self.modes:
            return self._moved_modes(state, value)
        if self.name == DAMPING:
            return replace(state, damping_ratio=value)
        if self.name == STIFFNESS_DAMPING:
            return replace(state, stiffness_damping=value)
        return replace(state, operating=state.operating.with_value(self.name, value))

    def _plain_value(self, state: DesignState) -> float:
        operating = state.operating
        if self.name == DAMPING:
            return float(state.damping_ratio)
        if self.name == STIFFNESS_DAMPING:
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
        if not self.component:
            damping = {**state.assembly_damping, **dict.fromkeys(self.modes, value)}
            return replace(state, assembly_damping=damping)
        changed = {(self.component, mode): value for mode in self.modes}
        if self.quantity == FREQUENCY:
            return replace(state, frequency_scale={**state.frequency_scale, **changed})
        return replace(state, mode_damping={**state.mode_damping, **changed})
