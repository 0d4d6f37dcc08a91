"""Parameters of a model: names, units, defaults and bounds."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.assembly import Assembly
from squealstudy.models.stacked_assembly import StackedAssembly
from squealstudy.parameter import Parameter

Stacking = Callable[[Mapping[str, str | int], Mapping[str, Any]], StackedAssembly]
Declared = tuple[Parameter | Callable[[], tuple[Parameter, ...]], ...]


@dataclass(frozen=True)
class ModelOption:
    """A choice that is no number to sweep: mesh density, contact law.

    Attributes
    ----------
    name : str
    allowed : tuple, or callable
        The allowed values, the first is the default; a callable gives those of a register.
    description : str
    """

    name: str
    allowed: tuple[str | int, ...] | Callable[[], tuple[str, ...]]
    description: str

    @property
    def choices(self) -> tuple[str | int, ...]:
        """The allowed values, the first is the default."""
        return self.allowed() if callable(self.allowed) else self.allowed


@dataclass(frozen=True)
class Assumption:
    """An assumption of a model, as a bound on a dimensionless group of its parameters.

    Attributes
    ----------
    rule : str
        What holds up to the bound, in words: the reason of a design point beyond it.
    group : callable
        Values of all parameters, each a number or an array over design points -> the dimensionless
        group. One that takes numbers alone is asked point by point.
    most : float
        The largest value of the group for which the model holds.
    """

    rule: str
    group: Callable[[Mapping[str, Any]], Any]
    most: float

    def values(self, columns: Mapping[str, float | np.ndarray], count: int) -> np.ndarray:
        """The group (count,) at design points whose values are numbers or arrays (count,)."""
        try:
            assumed = np.asarray(self.group(columns), dtype=float)
        except (TypeError, ValueError):
            varied = {k: x for k, x in columns.items() if isinstance(x, np.ndarray)}
            rows = ({k: float(x[i]) for k, x in varied.items()} for i in range(count))
            assumed = np.array([self.group({**columns, **values}) for values in rows], dtype=float)
        return np.broadcast_to(assumed, count)


@dataclass(frozen=True)
class ParameterTable:
    """Values of a parameter over others, linear in each between its knots (THEORY.md eq. (116)).

    Attributes
    ----------
    name : str
        The parameter that follows.
    over : tuple of str
        What it follows.
    at : tuple of tuple of float
        Ascending knots of each, two or more.
    values : tuple of float
        At all knots, those of the last of `over` side by side.
    """

    name: str
    over: tuple[str, ...]
    at: tuple[tuple[float, ...], ...]
    values: tuple[float, ...]

    def value(self, values: Mapping[str, Any]) -> Any:
        """The parameter at values of what it follows, each a number or an array (count,).

        The last pieces go on beyond the ends.
        """
        columns = np.broadcast_arrays(*(np.asarray(values[name], float) for name in self.over))
        count = columns[0].size
        entries = np.array(self.values).reshape([len(at) for at in self.at])
        entries = np.broadcast_to(entries[..., None], (*entries.shape, count))
        for at, column in zip(reversed(self.at), reversed(columns), strict=True):
            x, knots = column.reshape(count), np.array(at)
            lower_knot = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(knots) - 2)
            share = (x - knots[lower_knot]) / (knots[lower_knot + 1] - knots[lower_knot])
            entries = (1.0 - share) * _at(entries, lower_knot) + share * _at(
                entries, lower_knot + 1
            )
        return entries.reshape(columns[0].shape) if columns[0].ndim else float(entries[0])


def _at(table: np.ndarray, position: np.ndarray) -> np.ndarray:
    """The entries (..., count) of a table (..., knots, count) at a knot of each column."""
    knots = np.broadcast_to(position, (*table.shape[:-2], 1, len(position)))
    entries: np.ndarray = np.take_along_axis(table, knots, axis=-2)[..., 0, :]
    return entries


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


def nothing_vanishes(values: Mapping[str, float]) -> None:  # noqa: ARG001
    """Result for a model none of whose parts vanishes, whatever the values."""
    return


def _not_known(parameter: Parameter) -> bool:  # noqa: ARG001
    return False


@dataclass(frozen=True)
class ModelDefinition:
    """A model of the catalogue: how it is named, varied and built.

    Attributes
    ----------
    name, description : str
        As in study files; in a line.
    options : tuple of ModelOption
        Choices that are no numbers.
    declared : tuple of Parameter, or of callable
        The model's parameters; a callable gives those of a register. A model may have one of them
        as its own with another default.
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
    effective_radius : callable
        Options and values of all parameters -> the radius [m] that ``sliding_speed`` is of where
        the model turns; None where all contact points slide at one speed.
    changes : tuple of ModelChange
        Versions since which it gives other numbers, the latest first.
    tables : tuple of ParameterTable
        Of a study: what follows other parameters.
    sets : tuple of str
        COMPONENT.SET that the components have (`Component.sets`), known before it is built.
    added : tuple of str
        Hashes of what a study adds on its sets.
    in_place : callable
        Whether a structural parameter leaves nodes and contact points where they are, so that
        structures that differ in it alone can have one basis.
    stack : callable or None
        As `build` for many structures: (options, values of all parameters, numbers or arrays (m,))
        -> StackedAssembly; None: one is built after the other.
    idle : mapping of str -> str
        Why a parameter that it has does nothing here, in words.
    absent : mapping of str -> str
        Why it has no parameter of a name that one may look for, in words.
    start : mapping of str -> mapping, or list of mappings
        What a study to start from says, by section: under ``sweep`` a parameter and a range on
        which steady sliding turns unstable.
    """

    name: str
    description: str
    options: tuple[ModelOption, ...]
    declared: Declared
    components: tuple[str, ...]
    build: Callable[[Mapping[str, str | int], Mapping[str, float]], Assembly]
    assumptions: tuple[Assumption, ...] = ()
    vanishing: Callable[[Mapping[str, float]], tuple[str, str] | None] = field(
        default=nothing_vanishes, kw_only=True
    )
    torque_unit: str = field(default="N", kw_only=True)
    effective_radius: Callable[[Mapping[str, str | int], Mapping[str, float]], float | None] = (
        field(default=lambda options, values: None, kw_only=True)
    )
    changes: tuple[ModelChange, ...] = field(default=(), kw_only=True)
    tables: tuple[ParameterTable, ...] = field(default=(), kw_only=True)
    sets: tuple[str, ...] = field(default=(), kw_only=True)
    added: tuple[str, ...] = field(default=(), kw_only=True)
    in_place: Callable[[Parameter], bool] = field(default=_not_known, kw_only=True)
    stack: Stacking | None = field(default=None, kw_only=True)
    idle: Mapping[str, str] = field(default_factory=dict, kw_only=True, hash=False)
    absent: Mapping[str, str] = field(default_factory=dict, kw_only=True, hash=False)
    start: Mapping[str, Any] = field(default_factory=dict, kw_only=True, hash=False)

    def followed(
        self, values: Mapping[str, Any], before: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """Values of all parameters, numbers or arrays, in which what has a table follows it.

        Where what it is over is as `before`, a value stays as it is given.
        """
        all_values = dict(values)
        for table in self.tables:
            if before is None or any(before[name] != values[name] for name in table.over):
                all_values[table.name] = table.value(values)
        return all_values

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All that can be varied, those of the laws registered by now among them.

        Raises
        ------
        ModelError
            A law has a parameter of a name that means another one in this model.
        """
        own_parameters = {p.name: p for p in self.declared if isinstance(p, Parameter)}
        by_name: dict[str, Parameter] = {}
        for declared in self.declared:
            for parameter in (declared,) if isinstance(declared, Parameter) else declared():
                mine = own_parameters.get(parameter.name, parameter)
                if mine is not parameter and replace(mine, default=parameter.default) != parameter:
                    raise ModelError(
                        f"'{parameter.name}' is a parameter of the model {self.name}: the one of "
                        f"that name that a law from outside has needs another, such as "
                        f"'law.{parameter.name}'"
                    )
                by_name.setdefault(parameter.name, mine)
        return tuple(by_name.values())

    @property
    def meshed(self) -> bool:
        """Whether it is a finite-element model, to be reduced."""
        return any(option.name == "mesh" for option in self.options)

    @property
    def energy_parts(self) -> tuple[str, ...]:
        """Parts over which elastic energy is divided: components and interfaces; may be empty."""
        return (*self.components, "interfaces") if self.components else ()

    def parameter(self, name: str) -> Parameter:
        """The parameter of that name; KeyError where there is none."""
        return {p.name: p for p in self.parameters}[name]

    def defaults(self, version: str | None = None) -> dict[str, float]:
        """Default value of every parameter, in a `version` of squealstudy; None: in this one."""
        defaults = {p.name: p.default for p in self.parameters}
        for change in self.changed_since(version):
            defaults |= change.defaults
        return defaults

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
