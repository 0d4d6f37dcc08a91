"""Values of parameters that follow a table over others, as friction over temperature.

[parameters]
temperature = "100 degC"

[parameters.friction.table]
temperature = ["20 degC", "200 degC", "300 degC"]
friction = [0.42, 0.5, 0.38]
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from squealstudy.errors import ParameterError
from squealstudy.models.parameter_names import PlainParameter, parse_parameter
from squealstudy.models.units import ZERO_CELSIUS, in_unit_of, with_bare_unit
from squealstudy.parameter import Parameter
from squealstudy.study.source import SourceText
from squealstudy.study.toml_text import MAX_NESTING, KeyPath
from squealstudy.study.units import TEMPERATURE
from squealstudy.wording import shown

if TYPE_CHECKING:  # numpy stays out of `squealstudy schema`
    from squealstudy.models.parameter import ModelDefinition, ParameterTable
    from squealstudy.study.sweeps import Sweep

SECTION, TABLE, VALUE = "parameters", "table", "value"
ABOUT = (
    "temperature, which acts through tables of other parameters only; in results in degC, in files "
    "with its unit, a bare number is in K"
)
KNOT_SLACK = 1e-9  # distance over a sweep's range within which a value is on a knot
MIN_KNOTS = 2  # least values along an axis of a table
GivenTable = tuple[KeyPath, str, Any]  # key path of a table, the parameter it is of, its content


def take_tables(tables: Mapping[str, Any]) -> tuple[Mapping[str, Any], list[GivenTable]]:
    """Split a study file's tables: without tables of values in [parameters], and these tables."""
    parameters = tables.get(SECTION)
    if not isinstance(parameters, Mapping):
        return tables, []
    given_tables: list[GivenTable] = []
    remaining = _without(parameters, (SECTION,), given_tables)
    return ({**tables, SECTION: remaining} if given_tables else tables), given_tables


def _without(
    table: Mapping[str, Any], keys: KeyPath, given_tables: list[GivenTable]
) -> dict[str, Any]:
    """Tables of the study without those over a parameter, which are added to `given_tables`."""
    remaining: dict[str, Any] = {}
    for key, entry in table.items():
        entry_keys = (*keys, key)
        if not isinstance(entry, Mapping) or len(keys) > MAX_NESTING:
            remaining[key] = entry
        elif set(entry) == {TABLE}:
            given_tables.append(
                ((*entry_keys, TABLE), ".".join(map(str, entry_keys[1:])), entry[TABLE])
            )
        else:
            remaining[key] = _without(entry, entry_keys, given_tables)
    return remaining


def with_temperature(model: ModelDefinition, given_tables: Sequence[GivenTable]) -> ModelDefinition:
    """The model with a parameter ``temperature``, added if it has none and there are tables.

    The parameter is structural if one that follows it is. Its unit is degC; bare numbers in files
    are in K.
    """
    followers = [
        name
        for _, name, table in given_tables
        if isinstance(table, Mapping) and TEMPERATURE in table
    ]
    by_name = {p.name: p for p in model.parameters}
    if TEMPERATURE in by_name or not given_tables:
        return model
    structural = any(name in by_name and by_name[name].structural for name in followers)
    lowest = -float(ZERO_CELSIUS)
    temperature = Parameter(
        TEMPERATURE, math.nan, "degC", ABOUT, above=lowest, structural=structural, bare="K"
    )
    return replace(model, declared=(*model.declared, temperature))


def read_parameter_tables(
    model: ModelDefinition, given_tables: Iterable[GivenTable], source: SourceText
) -> tuple[ParameterTable, ...]:
    """The tables of a study file; StudyFileError where one is wrong."""
    read = tuple(_read(model, keys, name, table, source) for keys, name, table in given_tables)
    names = [table.name for table in read]
    for (keys, *_), table in zip(given_tables, read, strict=True):
        for over in table.over:
            if over in names:
                text = f"'{over}' follows a table itself: expected a parameter that has a value"
                raise source.error((*keys, over), text)
    return read


def _read(
    model: ModelDefinition, keys: KeyPath, name: str, table: Any, source: SourceText
) -> ParameterTable:
    """A table of a parameter over others; StudyFileError for a fault in it."""
    from squealstudy.models.parameter import ParameterTable

    if not isinstance(table, Mapping):
        text = f"expected a table of values over a parameter, got {shown(table)}"
        raise source.error(keys, text)
    parameter = _plain(model, name, keys, source)
    over = [key for key in table if key not in (VALUE, parameter.name)]
    if VALUE not in table and parameter.name not in table:
        raise source.error(keys, f"expected a list '{VALUE}' of values of {parameter.name}")
    if VALUE in table and parameter.name in table:
        raise source.error(
            (*keys, VALUE), f"'{VALUE}' and '{parameter.name}' are the same: give one"
        )
    if not over:
        raise source.error(keys, f"expected a list of values of what {parameter.name} follows")
    knots = [
        _knots(_plain(model, key, (*keys, key), source), table[key], keys, source) for key in over
    ]
    values_key = VALUE if VALUE in table else parameter.name
    values = list(
        _numbers(parameter, table[values_key], (*keys, values_key), [len(x) for x in knots], source)
    )
    return ParameterTable(parameter.name, tuple(over), tuple(map(tuple, knots)), tuple(values))


def _plain(model: ModelDefinition, name: str, keys: KeyPath, source: SourceText) -> Parameter:
    """The parameter of the model with a name; StudyFileError for parameters of modes."""
    try:
        parameter = parse_parameter(name, model)
    except ParameterError as error:
        raise source.error(keys, error.message) from None
    if not isinstance(parameter, PlainParameter):
        raise source.error(keys, f"'{name}' is one of modes: expected a parameter of the model")
    return parameter.parameter


def _knots(parameter: Parameter, entries: Any, keys: KeyPath, source: SourceText) -> list[float]:
    """Values, ascending, of a parameter that a table is over; StudyFileError where wrong."""
    parameter_keys = (*keys, parameter.name)
    if not isinstance(entries, list) or len(entries) < MIN_KNOTS:
        text = f"expected a list of {MIN_KNOTS} or more values, got {shown(entries)}"
        raise source.error(parameter_keys, text)
    knots = [
        _number(parameter, number, (*parameter_keys, k), source) for k, number in enumerate(entries)
    ]
    if any(b <= a for a, b in pairwise(knots)):
        raise source.error(parameter_keys, f"expected values of {parameter.name} that ascend")
    return knots


def _numbers(
    parameter: Parameter, entries: Any, keys: KeyPath, shape: Sequence[int], source: SourceText
) -> Iterator[float]:
    """Values of a table, nested lists of this shape, one after the other (last axis fastest)."""
    if not shape:
        yield _number(parameter, entries, keys, source)
        return
    if not isinstance(entries, list) or len(entries) != shape[0]:
        size = " lists of ".join(map(str, shape))
        got = f"{len(entries)}" if isinstance(entries, list) else shown(entries)
        raise source.error(keys, f"expected {size} values of {parameter.name}, got {got}")
    for k, entry in enumerate(entries):
        yield from _numbers(parameter, entry, (*keys, k), shape[1:], source)


def _number(parameter: Parameter, value: Any, keys: KeyPath, source: SourceText) -> float:
    """A value in the unit of the parameter; StudyFileError for one out of bounds."""
    try:
        text = with_bare_unit(value, parameter)
        if isinstance(text, str):
            text = in_unit_of(text, parameter.unit, parameter.difference)
        return parameter.check(text)
    except ValueError as error:
        raise source.error(keys, f"{parameter.name} {error}") from None
    except ParameterError as error:
        raise source.error(keys, error.message) from None


def expect_values(
    tables: Iterable[ParameterTable], values: Mapping[str, float], source: SourceText
) -> None:
    """Raise StudyFileError where a parameter of a table has no value, or one outside the table."""
    for table in tables:
        for name, knots in zip(table.over, table.at, strict=True):
            keys = (SECTION, name)
            if math.isnan(values[name]):
                text = f"expected a value of {name} in [parameters]: {table.name} follows it"
                raise source.error((SECTION,), text)
            _expect_within(table, knots, (values[name],), keys, source)


def expect_sweeps(
    tables: Iterable[ParameterTable], sweeps: Iterable[Sweep], source: SourceText
) -> None:
    """Raise StudyFileError for a sweep of a parameter that follows a table, or outside a table."""
    for number, sweep in enumerate(sweeps):
        for table in tables:
            keys = ("sweep", number)
            if sweep.name == table.name:
                text = f"'{table.name}' follows a table over {' and '.join(table.over)}: sweep that"
                raise source.error((*keys, "parameter"), text)
            for name, knots in zip(table.over, table.at, strict=True):
                if name == sweep.name:
                    _expect_within(table, knots, (sweep.low, sweep.high), keys, source)


def knots_between(
    tables: Iterable[ParameterTable], sweeps: Iterable[Sweep]
) -> dict[str, list[float]]:
    """Knots of tables that lie between the values of a sweep, by its name.

    Nothing is solved there. Parameters that follow the table have a kink at a knot, which the
    swept values do not show.
    """
    between: dict[str, list[float]] = {}
    for sweep in sweeps:
        knots = {
            knot
            for table in tables
            for name, axis_values in zip(table.over, table.at, strict=True)
            if name == sweep.name
            for knot in axis_values
        }
        slack = KNOT_SLACK * (sweep.high - sweep.low)
        inside = [
            knot
            for knot in sorted(knots)
            if sweep.low < knot < sweep.high
            and all(abs(knot - level) > slack for level in sweep.values)
        ]
        if sweep.values and inside:
            between[sweep.name] = inside
    return between


def _expect_within(
    table: ParameterTable,
    knots: Sequence[float],
    values: Iterable[float],
    keys: KeyPath,
    source: SourceText,
) -> None:
    """Raise StudyFileError for a value beyond the range of a table."""
    for knot in values:
        if not knots[0] <= knot <= knots[-1]:
            text = f"the table of {table.name} is from {knots[0]:g} to {knots[-1]:g}, got {knot:g}"
            raise source.error(keys, text)
