"""The grammar of parameter names: parameters of the model, of component and of assembly modes."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from squealstudy.errors import ParameterError
from squealstudy.parameter import Parameter
from squealstudy.wording import did_you_mean

if TYPE_CHECKING:  # scipy stays out of `squealstudy schema`
    from squealstudy.models.parameter import ModelDefinition

FREQUENCY_SCALE, DAMPING_RATIO = "frequency_scale", "damping_ratio"
QUANTITIES = (FREQUENCY_SCALE, DAMPING_RATIO)
LARGEST_MODE = 10_000
ADDED = ("added_mass", "stiffener")  # first parts of names of what a variable adds
MODE_NAME = re.compile(
    r"(?:(?P<component>[^\[\]]+)\.)?modes\[(?P<modes>[^\[\]]*)\]\.(?P<quantity>\w+)"
)
MODE_RANGE = re.compile(r"([0-9]{1,9})(?:-([0-9]{1,9}))?")
EXAMPLE = (
    "'<component>.modes[12-14].frequency_scale', '<component>.modes[3,7].damping_ratio' "
    "or, of the assembly, 'modes[44].damping_ratio'"
)


@dataclass(frozen=True)
class PlainParameter:
    """A parameter of the model itself, as in ``friction`` or ``disc.young_modulus``."""

    parameter: Parameter

    @property
    def name(self) -> str:
        """Name of the parameter as study files write it."""
        return self.parameter.name

    @property
    def default(self) -> float:
        """Value where a study gives none, in SI units."""
        return self.parameter.default

    @property
    def unit(self) -> str:
        """Unit of the parameter; empty for a pure number."""
        return self.parameter.unit

    @property
    def difference(self) -> bool:
        """Whether it is a difference of temperatures."""
        return self.parameter.difference

    @property
    def structural(self) -> bool:
        """Whether a change costs a new assembly and reduction."""
        return self.parameter.structural

    def check(self, value: float) -> float:
        """`value` as a float; ParameterError where the parameter cannot take it."""
        return self.parameter.check(value)

    def check_range(self, low: float, high: float) -> None:
        """ParameterError where the parameter cannot be swept from low to high."""
        self.parameter.check_range(low, high)


@dataclass(frozen=True)
class ModeParameter:
    """One quantity of some modes, which all have the same value.

    The modes are free-free modes of a component, or real modes of the assembly. For the latter the
    only quantity is the damping ratio, which replaces the model's uniform ``damping_ratio``.

    Attributes
    ----------
    name : str
        As the user wrote it.
    component : str
        Empty for the assembly.
    modes : tuple of int
        Ascending, from 1, rigid-body modes included; those of the assembly in ascending frequency
        at the design's working point without friction.
    quantity : str
        ``frequency_scale`` (factor on the frequency) or ``damping_ratio``.
    """

    name: str
    component: str
    modes: tuple[int, ...]
    quantity: str

    @property
    def default(self) -> float:
        """Value where a study gives none, in SI units."""
        return 1.0 if self.quantity == FREQUENCY_SCALE else 0.0

    @property
    def unit(self) -> str:
        """Unit of the parameter: empty, since both quantities are pure numbers."""
        return ""

    @property
    def difference(self) -> bool:
        """False: neither quantity is a difference of temperatures."""
        return False

    @property
    def structural(self) -> bool:
        """False: modes are entries of the reduced matrices, which stay."""
        return False

    def check(self, value: float) -> float:
        """`value` as a float; ParameterError where it is not a number within bounds."""
        if self.quantity == FREQUENCY_SCALE:
            limits = Parameter(self.name, self.default, "", "", maximum=10.0, positive=True)
        else:
            limits = Parameter(self.name, self.default, "", "", minimum=0.0, maximum=1.0)
        return limits.check(value)

    def check_range(self, low: float, high: float) -> None:
        """Do nothing: any range between allowed values can be swept."""


StudyParameter = PlainParameter | ModeParameter


def parse_parameter(name: str, model: ModelDefinition) -> StudyParameter:
    """The parameter that a name of a study file stands for.

    Raises
    ------
    ParameterError
        Neither a parameter of the model, nor ``<component>.modes[<numbers>].<quantity>``, nor
        ``modes[<numbers>].damping_ratio``.
    """
    plain = {p.name: p for p in model.parameters}
    if name in plain:
        return PlainParameter(plain[name])
    if not model.components and ("modes[" in name or ".modes" in name):
        raise ParameterError(name, f"model '{model.name}' has no components whose modes to change")
    if "modes[" in name or ".modes" in name:
        return _parse_mode_parameter(name, model)
    if name.split(".")[0] in ADDED:
        mass = "its [parameters], a [[sweep]] or " * (name.split(".")[0] == ADDED[0])
        text = f"'{name}' is added by a study, in {mass}a [[variable]] of a design"
        raise ParameterError(name, f"{text}: expected no value of it")
    hint = f": {model.absent[name]}" if name in model.absent else ""
    hint = hint or did_you_mean(name, plain) or "; 'squealstudy models' lists its parameters"
    raise ParameterError(name, f"model '{model.name}' has no parameter '{name}'{hint}")


def check_disjoint(parameters: Iterable[StudyParameter]) -> None:
    """Raise ParameterError where two differently named parameters set the same mode's quantity."""
    owner: dict[tuple[str, int, str], str] = {}
    for p in parameters:
        if isinstance(p, PlainParameter):
            continue
        for mode in p.modes:
            first = owner.setdefault((p.component, mode, p.quantity), p.name)
            if first != p.name:
                owned = f"{p.quantity} of {p.component or 'assembly'} mode {mode}"
                raise ParameterError(p.name, f"'{p.name}' and '{first}' both set {owned}")


def _parse_mode_parameter(name: str, model: ModelDefinition) -> ModeParameter:
    """The parameter of component or assembly modes of a name; ParameterError for others."""
    match = MODE_NAME.fullmatch(name)
    if match is None:
        raise ParameterError(name, f"expected a name like {EXAMPLE}, got '{name}'")
    component, quantity = match["component"] or "", match["quantity"]
    if component and component not in model.components:
        raise ParameterError(
            name,
            f"model '{model.name}' has no component '{component}'; "
            f"its components are {', '.join(model.components)}",
        )
    if quantity not in QUANTITIES:
        raise ParameterError(
            name, f"expected {' or '.join(QUANTITIES)} of component modes, got '{quantity}'"
        )
    if not component and quantity != DAMPING_RATIO:
        raise ParameterError(
            name,
            f"modes of the assembly have {DAMPING_RATIO} only, their frequencies follow from the "
            f"components: expected '<component>.modes[{match['modes']}].{quantity}'",
        )
    return ModeParameter(name, component, _parse_modes(name, match["modes"]), quantity)


def _parse_modes(name: str, text: str) -> tuple[int, ...]:
    """Mode numbers of ``3,7-9``, ascending."""
    modes: set[int] = set()
    for part in text.split(","):
        match = MODE_RANGE.fullmatch(part.strip())
        if match is None:
            raise ParameterError(
                name,
                f"expected mode numbers from 1 like [13], [12-14] or [3,7-9], got '[{text}]'",
            )
        first, last = int(match[1]), int(match[2] or match[1])
        if first < 1 or last > LARGEST_MODE:
            raise ParameterError(
                name, f"expected mode numbers from 1 to {LARGEST_MODE}, got '{part.strip()}'"
            )
        if last < first:
            raise ParameterError(
                name, f"expected an ascending range of modes, got '{first}-{last}'"
            )
        numbers = range(first, last + 1)
        if not modes.isdisjoint(numbers):
            raise ParameterError(name, f"a mode number appears twice in '[{text}]'")
        modes.update(numbers)
    return tuple(sorted(modes))
