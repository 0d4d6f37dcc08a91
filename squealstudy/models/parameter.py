"""What a model can be asked to vary: names, units, defaults and bounds."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from squealstudy.errors import ParameterError
from squealstudy.models.assembly import Assembly


@dataclass(frozen=True)
class Parameter:
    """One named number of a model, SI units (angles in degrees).

    Attributes
    ----------
    name : str
        As in study files.
    default : float
    unit : str
        Empty for a pure number.
    description : str
    minimum, maximum : float
        Closed bounds; with `positive` the minimum itself is excluded.
    positive : bool
        The value must be greater than zero.
    above, below : float
        Open bounds.
    structural : bool
        True where a change alters masses or stiffnesses: it costs a new assembly and reduction.
    """

    name: str
    default: float
    unit: str
    description: str
    minimum: float = -math.inf
    maximum: float = math.inf
    positive: bool = False
    structural: bool = False
    above: float = -math.inf
    below: float = math.inf

    def check(self, value: float) -> float:
        """`value` as a float; ParameterError where it is not a finite number within bounds."""
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
        ):
            raise ParameterError(self.name, f"expected a finite number, got {value!r}")
        if self.positive and value <= 0:
            raise ParameterError(
                self.name, f"expected a positive value{self._unit()}, got {value:g}"
            )
        if value < self.minimum:
            raise ParameterError(
                self.name, f"expected at least {self.minimum:g}{self._unit()}, got {value:g}"
            )
        if value > self.maximum:
            raise ParameterError(
                self.name, f"expected at most {self.maximum:g}{self._unit()}, got {value:g}"
            )
        for bound, word, kept in (
            (self.above, "above", value > self.above),
            (self.below, "below", value < self.below),
        ):
            if not kept:
                raise ParameterError(
                    self.name, f"expected a value {word} {bound:g}{self._unit()}, got {value:g}"
                )
        return float(value)

    def _unit(self) -> str:
        return f" {self.unit}" if self.unit else ""


@dataclass(frozen=True)
class Option:
    """A choice that is no number to sweep: mesh density, contact law.

    ``choices`` lists the allowed values; the first is the default.
    """

    name: str
    choices: tuple[str | int, ...]
    description: str


@dataclass(frozen=True)
class Assumption:
    """What a model takes for granted, as a bound on a dimensionless group of its parameters.

    Attributes
    ----------
    rule : str
        What holds up to the bound, in words: the reason of a design point beyond it.
    group : callable
        Values of all parameters -> the dimensionless group.
    most : float
        The largest value of the group for which the model holds.
    """

    rule: str
    group: Callable[[Mapping[str, float]], float]
    most: float

    def broken(self, values: Mapping[str, float]) -> str:
        """The rule and the group's value where it is beyond the bound, else an empty text."""
        value = self.group(values)
        return "" if value <= self.most else f"{self.rule}: {value:.4g}"


@dataclass(frozen=True)
class ModelChange:
    """A version of squealstudy since which a model gives other numbers.

    Attributes
    ----------
    version : str
        The first version with the change.
    what : str
        What has changed, in words.
    defaults : mapping of str -> float
        Defaults of before, of the parameters whose default has changed.
    """

    version: str
    what: str
    defaults: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class ModelDefinition:
    """A model of the catalogue: how it is named, varied and built.

    Attributes
    ----------
    build : callable
        (options, parameter values, all of them) -> Assembly.
    components : tuple of str
        Names, known before the model is built.
    assumptions : tuple of Assumption
        What must hold of the parameters for a design point's results to be valid.
    vanishing : callable
        Values of all parameters -> (smaller, larger): two names in order, of values that are not,
        so that a part of the model vanishes; None where all is there.
    torque_unit : str
        Of the columns ``torque_*``: N m of a braking torque, N where friction is summed along a
        straight belt (its interfaces have an arm of 1).
    changes : tuple of ModelChange
        Versions since which it gives other numbers, the latest first.
    """

    name: str
    description: str
    options: tuple[Option, ...]
    parameters: tuple[Parameter, ...]
    components: tuple[str, ...]
    build: Callable[[Mapping[str, str | int], Mapping[str, float]], Assembly]
    assumptions: tuple[Assumption, ...] = ()
    vanishing: Callable[[Mapping[str, float]], tuple[str, str] | None] = field(
        default=lambda values: None, kw_only=True
    )
    torque_unit: str = field(default="N", kw_only=True)
    changes: tuple[ModelChange, ...] = field(default=(), kw_only=True)

    @property
    def energy_parts(self) -> tuple[str, ...]:
        """What elastic energy is divided over: components and interfaces; nothing without them."""
        return (*self.components, "interfaces") if self.components else ()

    def parameter(self, name: str) -> Parameter:
        """The parameter of that name; KeyError where there is none."""
        return {p.name: p for p in self.parameters}[name]

    def defaults(self, version: str | None = None) -> dict[str, float]:
        """Default value of every parameter, in a `version` of squealstudy; None: in this one."""
        found = {p.name: p.default for p in self.parameters}
        for change in self.changed_since(version):
            found |= change.defaults
        return found

    def changed_since(self, version: str | None) -> tuple[ModelChange, ...]:
        """Changes that are later than a version, the latest first; none for None."""
        if version is None:
            return ()
        return tuple(c for c in self.changes if _ordered(version) < _ordered(c.version))


def _ordered(version: str) -> tuple[int, ...]:
    """The numbers of a version, to be compared."""
    return tuple(int(n) for n in re.findall(r"\d+", version)[:3])


def structural(rows: Iterable[tuple[str, float, str, str]]) -> tuple[Parameter, ...]:
    """Positive structural parameters from (name, default, unit, description) rows."""
    return tuple(Parameter(*row, positive=True, structural=True) for row in rows)
