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
    """A choice in a model that is no number to sweep, such as the mesh density or contact law.

    Attributes
    ----------
    name : str
    allowed : tuple, or callable
        Allowed values, the default first; a callable returns those of a registry.
    description : str
    """

    name: str
    allowed: tuple[str | int, ...] | Callable[[], tuple[str, ...]]
    description: str

    @property
    def choices(self) -> tuple[str | int, ...]:
        """The allowed values, the default first."""
        return self.allowed() if callable(self.allowed) else self.allowed


@dataclass(frozen=True)
class Assumption:
    """An assumption of a model, as a bound on a dimensionless group of its parameters.

    Attributes
    ----------
    rule : str
        What is assumed, in words: the reason given at a design point beyond the bound.
    group : callable
        Returns the dimensionless group from the values of all parameters, each a number or an array
        over design points. If it takes only numbers, it is called for each design point.
    most : float
        The largest value of the group for which the model holds.
    """

    rule: str
    group: Callable[[Mapping[str, Any]], Any]
    most: float

    def values(self, columns: Mapping[str, float | np.ndarray], count: int) -> np.ndarray:
        """The group (count,) at design points; `columns` are numbers or arrays (count,)."""
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
        The parameter whose values the table gives.
    over : tuple of str
        The parameters that it depends on.
    at : tuple of tuple of float
        Ascending knots of each of these, two or more.
    values : tuple of float
        Values at all knots; the knots of the last of `over` vary fastest.
    """

    name: str
    over: tuple[str, ...]
    at: tuple[tuple[float, ...], ...]
    values: tuple[float, ...]

    def value(self, values: Mapping[str, Any]) -> Any:
        """The parameter at values of `over`, each a number or an array (count,).

        Beyond the end knots the outermost linear pieces are continued.
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
    """Entries (..., count) of a table (..., knots, count) at one knot (count,) of each column."""
    knots = np.broadcast_to(position, (*table.shape[:-2], 1, len(position)))
    entries: np.ndarray = np.take_along_axis(table, knots, axis=-2)[..., 0, :]
    return entries


@dataclass(frozen=True)
class ModelChange:
    """A change of a model's numbers in a version of squealstudy.

    Attributes
    ----------
    version : str
        The first version with the change.
    what : str
        What has changed, in words.
    defaults : mapping of str -> float
        Former default of each parameter whose default has changed.
    """

    version: str
    what: str
    defaults: Mapping[str, float] = field(default_factory=dict)


def nothing_vanishes(values: Mapping[str, float]) -> None:  # noqa: ARG001
    """Result None, for a model of which no part can vanish."""
    return


def _not_known(parameter: Parameter) -> bool:  # noqa: ARG001
    return False


@dataclass(frozen=True)
class ModelDefinition:
    """A model: how it is named, varied and built.

    Attributes
    ----------
    name, description : str
        Name as in study files; description in one line.
    options : tuple of ModelOption
        Choices that are no numbers.
    declared : tuple of Parameter, or of callable
        The model's parameters; a callable returns those of a registry. The model may declare one of
        these itself, with another default.
    build : callable
        (options, values of all parameters) -> Assembly.
    components : tuple of str
        Names of the components, available before the model is built.
    assumptions : tuple of Assumption
        Assumptions about the parameters, without which results of a design point are not valid.
    vanishing : callable
        Values of all parameters -> names (smaller, larger) of two parameters whose values are not
        in this order, so that a part of the model vanishes; None where no part vanishes.
    torque_unit : str
        Unit of the columns ``torque_*``: N m for a braking torque, N where friction is summed along
        a straight belt (its interfaces have an arm of 1).
    effective_radius : callable
        (options, values of all parameters) -> the radius [m] at which a turning model slides with
        ``sliding_speed``; None where all contact points slide at one speed.
    changes : tuple of ModelChange
        Changes of the model's numbers, the latest first.
    tables : tuple of ParameterTable
        Tables of a study, for parameters that follow others.
    sets : tuple of str
        COMPONENT.SET of all sets (`Component.sets`), available before the model is built.
    added : tuple of str
        Hashes of what a study adds on these sets.
    in_place : callable
        Whether a structural parameter leaves nodes and contact points where they are, so that
        structures that differ in it alone can have one basis.
    stack : callable or None
        Builds many structures at once: (options, values of all parameters, numbers or arrays (m,))
        -> StackedAssembly; None where structures are built one after the other.
    idle : mapping of str -> str
        Why a parameter has no effect here, in words, by its name.
    absent : mapping of str -> str
        Why there is no parameter of a name that users may look for, in words.
    start : mapping of str -> mapping, or list of mappings
        Contents of a study to start from, by section; ``sweep`` has a parameter and a range over
        which steady sliding becomes unstable.
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
        """Values of all parameters, numbers or arrays, with those of tables computed.

        A value stays as given where the parameters of its table have the same values `before`.
        """
        all_values = dict(values)
        for table in self.tables:
            if before is None or any(before[name] != values[name] for name in table.over):
                all_values[table.name] = table.value(values)
        return all_values

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters, those of the laws registered so far included.

        Raises
        ------
        ModelError
            A law has a parameter whose name means another parameter in this model.
        """
        own_parameters = {p.name: p for p in self.declared if isinstance(p, Parameter)}
        by_name: dict[str, Parameter] = {}
        for declared in self.declared:
            for parameter in (declared,) if isinstance(declared, Parameter) else declared():
                parameter_here = own_parameters.get(parameter.name, parameter)
                if (
                    parameter_here is not parameter
                    and replace(parameter_here, default=parameter.default) != parameter
                ):
                    raise ModelError(
                        f"'{parameter.name}' is a parameter of the model {self.name}: the one of "
                        f"that name that a law from outside has needs another, such as "
                        f"'law.{parameter.name}'"
                    )
                by_name.setdefault(parameter.name, parameter_here)
        return tuple(by_name.values())

    @property
    def meshed(self) -> bool:
        """Whether the model is a finite-element model, which is reduced."""
        return any(option.name == "mesh" for option in self.options)

    @property
    def energy_parts(self) -> tuple[str, ...]:
        """Parts over which elastic energy is divided: components and interfaces; may be empty."""
        return (*self.components, "interfaces") if self.components else ()

    def parameter(self, name: str) -> Parameter:
        """The parameter of that name; KeyError where there is none."""
        return {p.name: p for p in self.parameters}[name]

    def defaults(self, version: str | None = None) -> dict[str, float]:
        """Default of every parameter in a `version` of squealstudy; None for this version."""
        defaults = {p.name: p.default for p in self.parameters}
        for change in self.changed_since(version):
            defaults |= change.defaults
        return defaults

    def changed_since(self, version: str | None) -> tuple[ModelChange, ...]:
        """Changes later than a version, the latest first; no changes for None."""
        if version is None:
            return ()
        return tuple(c for c in self.changes if _ordered(version) < _ordered(c.version))


def _ordered(version: str) -> tuple[int, ...]:
    """The first three numbers of a version, for comparison."""
    return tuple(int(n) for n in re.findall(r"\d+", version)[:3])


def structural(rows: Iterable[tuple[str, float, str, str]]) -> tuple[Parameter, ...]:
    """Positive structural parameters from (name, default, unit, description) rows."""
    return tuple(Parameter(*row, positive=True, structural=True) for row in rows)
