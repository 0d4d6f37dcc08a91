"""A model at values of its parameters: assembly, operating point, design state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from squealstudy.laws import (
    CONTACT_LAWS,
    DEFAULT_CURVE,
    FRICTION_CURVES,
    ContactLaw,
    FrictionCurve,
)
from squealstudy.models.assembly import Assembly
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.models.operating import (
    CONTACT_OPTION,
    FRICTION_OPTION,
    GYROSCOPIC,
    DesignState,
    ModeKey,
    OperatingPoint,
)
from squealstudy.models.parameter import ModelDefinition
from squealstudy.models.parameter_names import FREQUENCY_SCALE, ModeParameter, parse_parameter


@dataclass(frozen=True)
class ModelPoint:
    """A model with values of its options and parameters.

    Attributes
    ----------
    model : ModelDefinition
    options : mapping of str -> str or int
        A value of every option of the model.
    values : mapping of parameter name -> float
        Every plain parameter of the model, and the mode parameters in use.
    """

    model: ModelDefinition
    options: Mapping[str, str | int]
    values: Mapping[str, float]

    @property
    def law_kind(self) -> str:
        """Contact law of the model's options; models without a choice are bilateral."""
        return str(self.options.get(CONTACT_OPTION.name, "bilateral"))

    @property
    def law_identity(self) -> list[str]:
        """Contact law and friction curve, with the hashes of their files."""
        laws = (CONTACT_LAWS[self.law_kind], FRICTION_CURVES[self.curve_kind])
        return [text for law in laws for text in (law.name, law.source)]

    @property
    def own_values(self) -> dict[str, float]:
        """Values that identify the design point: without those of laws from outside not in use."""
        used = {p.name for p in CONTACT_LAWS[self.law_kind].parameters}
        used |= {p.name for p in FRICTION_CURVES[self.curve_kind].parameters}
        unused = (CONTACT_LAWS.names_outside() | FRICTION_CURVES.names_outside()) - used
        return {k: v for k, v in self.values.items() if k not in unused}

    @property
    def curve_kind(self) -> str:
        """Friction curve of the model's options; the default one for models without a choice."""
        return str(self.options.get(FRICTION_OPTION.name, DEFAULT_CURVE))

    @property
    def has_working_point(self) -> bool:
        """Whether there is contact to balance; a family of matrices has none."""
        return not isinstance(self.model, FamilyDefinition)

    def structural_values(self) -> dict[str, float]:
        """Values of the structural parameters, on which masses and stiffnesses depend, by name."""
        return {
            p.name: self.values[p.name]
            for p in sorted(self.model.parameters, key=lambda p: p.name)
            if p.structural
        }

    def assembly(self) -> Assembly:
        """The unreduced model, meshed and assembled; ModelError where that is impossible."""
        return self.model.build(self.options, self.plain_values())

    def plain_values(self) -> dict[str, float]:
        """Values of the model's own parameters, by name."""
        return {p.name: self.values[p.name] for p in self.model.parameters}

    def operating_point(self) -> OperatingPoint:
        """Friction and its law, pressure, sliding speed and contact law."""
        v = self.values
        return OperatingPoint(
            friction=v["friction"],
            brake_pressure=v.get("pressure", 1.0),
            sliding_speed=v["sliding_speed"],
            law=ContactLaw.from_values(self.law_kind, v),
            curve=FrictionCurve.from_values(self.curve_kind, v),
            gyroscopic=v.get(GYROSCOPIC.name, 0.0),
        )

    def state(self) -> DesignState:
        """The design state: operating point, changes of component modes, modal damping."""
        scale: dict[ModeKey, float] = {}
        damping: dict[ModeKey, float] = {}
        assembly_damping: dict[int, float] = {}
        for parameter in self._parsed():
            number = self.values[parameter.name]
            if not parameter.component:
                assembly_damping |= dict.fromkeys(parameter.modes, number)
                continue
            target = scale if parameter.quantity == FREQUENCY_SCALE else damping
            target |= {(parameter.component, mode): number for mode in parameter.modes}
        return DesignState(
            operating=self.operating_point(),
            frequency_scale=scale,
            mode_damping=damping,
            damping_ratio=self.values.get("damping_ratio", 0.0),
            assembly_damping=assembly_damping,
            stiffness_damping=self.values.get("stiffness_damping", 0.0),
        )

    def mode_parameters(self) -> list[ModeParameter]:
        """Parameters of component modes that have a value."""
        return [p for p in self._parsed() if p.component]

    def assembly_parameters(self) -> list[ModeParameter]:
        """Parameters of assembly modes that have a value."""
        return [p for p in self._parsed() if not p.component]

    def _parsed(self) -> list[ModeParameter]:
        of_modes = (name for name in self.values if "[" in name)  # no other name has a bracket
        parsed = (parse_parameter(name, self.model) for name in of_modes)
        return [p for p in parsed if isinstance(p, ModeParameter)]
