"""Parameters of requested derivatives: by name, for all modes of a component, or structural."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from squealstudy.errors import ParameterError
from squealstudy.linalg.overflow import MAX_SQUARABLE_ENTRY
from squealstudy.models.acting_laws import expect_acting
from squealstudy.models.model_point import ModelPoint
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
from squealstudy.modes.sensitivity.state_derivatives import FREQUENCY, StateParameter
from squealstudy.modes.sensitivity.structural import StructureBuilder
from squealstudy.reduction.cmt import ReductionSettings

EVERY, ONE = "[*]", "[1]"
DEFAULTS = ("friction", "pressure", "contact.lambda", "sliding_speed")
LARGEST_SCALE = 10.0  # largest factor on the frequency of a component mode
# frequency, over the highest one of the basis, up to which a component mode counts as rigid
RIGID_FREQUENCY_RATIO = 1e-4


@dataclass(frozen=True)
class RequestedParameter:
    """A parameter that was asked for; `every`: it stands for a component's elastic modes."""

    name: str
    parameter: StudyParameter
    every: bool

    @property
    def structural(self) -> bool:
        """Whether the parameter changes masses or stiffnesses of the assembly."""
        return self.parameter.structural


def requested(name: str, design: ModelPoint) -> RequestedParameter:
    """The parameter that a name stands for, or with ``disc.modes[*].`` those of all modes.

    Raises
    ------
    ParameterError
        Where the model does not know the name, or there is no derivative by it here.
    """
    every = EVERY in name
    parameter = parse_parameter(name.replace(EVERY, ONE), design.model)
    if every and not (isinstance(parameter, ModeParameter) and parameter.component):
        raise ParameterError(name, f"expected mode numbers of the assembly, got '{name}'")
    if name in IN_TIME_ONLY:
        raise ParameterError(name, f"'{name}' acts in time only, complex modes do not see it")
    for table in design.model.tables:
        if name in table.over:
            text = f"'{table.name}' follows it by a table, which no derivative knows"
            raise ParameterError(name, f"{text}: expected '{table.name}', or '{name}' in [[sweep]]")
    expect_acting(parameter, design)
    if not every and abs(design.values.get(name, 0.0)) > MAX_SQUARABLE_ENTRY:
        raise ParameterError(
            name, f"derivatives by a value beyond {MAX_SQUARABLE_ENTRY:g} overflow"
        )
    return RequestedParameter(name, parameter, every)


def default_names(design: ModelPoint) -> Iterator[str]:
    """Yield those of DEFAULTS that act here, and frequencies and damping of component modes."""
    names_there = {p.name for p in design.model.parameters}
    ignored = {p.name for p in contact_parameters()} - set(design.operating_point().law.names)
    ignored |= {name for table in design.model.tables for name in table.over}
    yield from (name for name in DEFAULTS if name in names_there - ignored)
    for component in design.model.components:
        yield f"{component}.modes{EVERY}.{FREQUENCY}"
        yield f"{component}.modes{EVERY}.{DAMPING.name}"


def state_parameters(
    requested: Sequence[RequestedParameter], omega: Mapping[ModeKey, float]
) -> list[StateParameter]:
    """Parameters of the design state; ``[*]`` is expanded to the elastic modes of the basis.

    Parameters
    ----------
    omega : mapping of (component, mode) -> float
        Free-free frequencies of all component modes in the basis, rad/s.

    Raises
    ------
    ParameterError
        Where the basis does not hold a component mode.
    """
    by_key: dict[tuple[object, ...], StateParameter] = {}
    for request in requested:
        for parameter in _expanded(request, omega):
            name = "" if parameter.modes else parameter.name
            key = (name, parameter.component, parameter.modes, parameter.quantity)
            by_key.setdefault(key, parameter)
    return list(by_key.values())


def _expanded(
    requested: RequestedParameter, omega: Mapping[ModeKey, float]
) -> Iterator[StateParameter]:
    """State parameters of a requested one: of each mode of a component if all are asked for."""
    if requested.structural:
        return
    parameter = requested.parameter
    if isinstance(parameter, PlainParameter):
        yield StateParameter(requested.name, maximum=parameter.parameter.maximum)
        return
    component, quantity = parameter.component, parameter.quantity
    maximum = LARGEST_SCALE if quantity == FREQUENCY else 1.0
    if requested.every:
        rigid_below = RIGID_FREQUENCY_RATIO * max(omega.values(), default=0.0)
        for owner, mode in omega:
            if owner == component and omega[owner, mode] > rigid_below:
                name = requested.name.replace(EVERY, f"[{mode}]")
                yield StateParameter(name, component, (mode,), quantity, maximum)
        return
    n_modes, highest = sum(owner == component for owner, _ in omega), max(parameter.modes)
    if component and highest > n_modes:
        raise ParameterError(
            requested.name,
            f"{component} has modes 1 to {n_modes} in this basis, got {highest}",
        )
    yield StateParameter(requested.name, component, parameter.modes, quantity, maximum)


def design_structure(
    design: ModelPoint, settings: ReductionSettings, sizes: Mapping[str, float] | None = None
) -> StructureBuilder:
    """Builder of a design's assembly at other values; `sizes` are those of a StructureBuilder."""
    return StructureBuilder(
        partial(design.model.build, design.options),
        design.plain_values(),
        settings.component_cutoff,
        settings.damped_to,
        {p.name: 0.0 if p.positive else p.minimum for p in design.model.parameters},
        sizes or {},
    )


def structural_names(requested: Sequence[RequestedParameter]) -> list[str]:
    """Names of the requested parameters that change the assembly."""
    return [request.name for request in requested if request.structural]
