"""The parameters of a sensitivity study: names and families of names, checked and expanded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from squealstudy.errors import ParameterError, StudyFileError
from squealstudy.kinds.sensitivity.section import UNSTABLE, SensitivitySection
from squealstudy.models.acting_laws import expect_acting
from squealstudy.models.operating import (
    DAMPING,
    IN_TIME_ONLY,
    ModeKey,
    contact_parameters,
)
from squealstudy.models.parameter_names import (
    ModeParameter,
    PlainParameter,
    StudyParameter,
    parse_parameter,
)
from squealstudy.modes.sensitivity.reduced import ModeChoice
from squealstudy.modes.sensitivity.state_derivatives import FREQUENCY, StateParameter
from squealstudy.modes.sensitivity.structural import StructureBuilder
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.design import DesignPoint

EVERY, ONE = "[*]", "[1]"
DEFAULTS = ("friction", "pressure", "contact.lambda", "sliding_speed")
LARGEST_SCALE = 10.0
RIGID = 1e-4  # of the highest frequency of a component mode that is held: zero but for round-off


@dataclass(frozen=True)
class RequestedParameter:
    """A parameter asked for, or every elastic mode of a component (`every`)."""

    name: str
    parameter: StudyParameter
    every: bool

    @property
    def structural(self) -> bool:
        """Whether the parameter changes masses or stiffnesses of the assembly."""
        return self.parameter.structural


def asked_parameters(study: ResolvedStudy, design: DesignPoint) -> tuple[RequestedParameter, ...]:
    """The parameters of the [sensitivity] section, or the default ones.

    Raises
    ------
    StudyFileError
        A name that the model does not know, or that has no derivative here.
    """
    if not study.model.components:
        raise study.error(
            ("study", "kind"),
            f"model '{study.model.name}' has no components and no contact: there are no "
            "sensitivities of it",
        )
    section = study.section
    if not section.parameters:
        return tuple(_asked(name, study, design) for name in _default_names(study, design))
    found = []
    for number, name in enumerate(section.parameters):
        try:
            found.append(_asked(name, study, design))
        except ParameterError as error:
            raise study.error(("sensitivity", "parameters", number), error.message) from None
    return tuple(found)


def _asked(name: str, study: ResolvedStudy, design: DesignPoint) -> RequestedParameter:
    every = EVERY in name
    parameter = parse_parameter(name.replace(EVERY, ONE), study.model)
    if every and not (isinstance(parameter, ModeParameter) and parameter.component):
        raise ParameterError(name, f"expected mode numbers of the assembly, got '{name}'")
    if name in IN_TIME_ONLY:
        raise ParameterError(name, f"'{name}' acts in time only, complex modes do not see it")
    expect_acting(parameter, design)
    return RequestedParameter(name, parameter, every)


def _default_names(study: ResolvedStudy, design: DesignPoint) -> Iterator[str]:
    known = {p.name for p in study.model.parameters}
    ignored = {p.name for p in contact_parameters()} - set(design.operating_point().law.names)
    yield from (name for name in DEFAULTS if name in known - ignored)
    for component in study.model.components:
        yield f"{component}.modes{EVERY}.{FREQUENCY}"
        yield f"{component}.modes{EVERY}.{DAMPING.name}"


def mode_choice(section: SensitivitySection, stability_tolerance: float) -> ModeChoice:
    """Which modes the section asks for."""
    if section.modes == UNSTABLE:
        return ModeChoice(stability_tolerance=stability_tolerance)
    if isinstance(section.modes, int):
        return ModeChoice(count=section.modes, stability_tolerance=stability_tolerance)
    frequencies = tuple(float(f) for f in section.modes)
    return ModeChoice(frequencies_hz=frequencies, stability_tolerance=stability_tolerance)


def state_parameters(
    asked: Sequence[RequestedParameter], omega: Mapping[ModeKey, float]
) -> list[StateParameter]:
    """Parameters of the design state, families expanded to the elastic modes of the basis.

    Parameters
    ----------
    omega : mapping of (component, mode) -> float
        Free-free frequencies of all component modes held, rad/s.

    Raises
    ------
    ParameterError
        A component mode that the basis does not hold.
    """
    found: dict[tuple[object, ...], StateParameter] = {}
    for item in asked:
        for parameter in _expanded(item, omega):
            name = "" if parameter.modes else parameter.name
            key = (name, parameter.component, parameter.modes, parameter.quantity)
            found.setdefault(key, parameter)
    return list(found.values())


def _expanded(item: RequestedParameter, omega: Mapping[ModeKey, float]) -> Iterator[StateParameter]:
    if item.structural:
        return
    parameter = item.parameter
    if isinstance(parameter, PlainParameter):
        yield StateParameter(item.name, maximum=parameter.parameter.maximum)
        return
    component, quantity = parameter.component, parameter.quantity
    maximum = LARGEST_SCALE if quantity == FREQUENCY else 1.0
    if item.every:
        least = RIGID * max(omega.values(), default=0.0)
        for owner, mode in omega:
            if owner == component and omega[owner, mode] > least:
                name = item.name.replace(EVERY, f"[{mode}]")
                yield StateParameter(name, component, (mode,), quantity, maximum)
        return
    held, highest = sum(owner == component for owner, _ in omega), max(parameter.modes)
    if component and highest > held:
        raise ParameterError(
            item.name, f"{component} has modes 1 to {held} in this basis, got {highest}"
        )
    yield StateParameter(item.name, component, parameter.modes, quantity, maximum)


def design_structure(
    design: DesignPoint, settings: ReductionSettings, sizes: Mapping[str, float] | None = None
) -> StructureBuilder:
    """How the assembly of a design is built; `sizes` as of a StructureBuilder."""
    return StructureBuilder(
        partial(design.model.build, design.options),
        design.plain_values(),
        settings.component_cutoff,
        settings.damped_to,
        {p.name: 0.0 if p.positive else p.minimum for p in design.model.parameters},
        sizes or {},
    )


def structural_names(asked: Sequence[RequestedParameter]) -> list[str]:
    """Names of the requested parameters that change the assembly."""
    return [item.name for item in asked if item.structural]


def error_at_name(study: ResolvedStudy, error: ParameterError) -> StudyFileError:
    """The error of a parameter as one of the study file, where its name stands in it."""
    names = study.section.parameters
    if error.key in names:
        return study.error(("sensitivity", "parameters", names.index(error.key)), error.message)
    return study.error(("sensitivity",), f"{error.key}: {error.message}")
