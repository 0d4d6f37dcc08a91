"""Converts values with units in a study file to numbers.

A text such as "3 bar" becomes a number in the parameter's unit before the file is checked further,
so that everything that is computed, named and hashed has numbers only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from squealstudy.errors import ParameterError
from squealstudy.models.parameter_names import PlainParameter, StudyParameter, parse_parameter
from squealstudy.models.units import QUANTITY, in_unit_of, with_bare_unit
from squealstudy.parameter import Parameter
from squealstudy.study.design_sections import ADDED_MASS
from squealstudy.study.source import SourceText
from squealstudy.study.toml_text import MAX_NESTING, KeyPath

if TYPE_CHECKING:
    from squealstudy.models.parameter import ModelDefinition

TEMPERATURE = "temperature"  # parameter whose bare numbers may be in another unit than its own
TABLES = ("sweep", "variable", "uncertain")  # lists of tables, each of one parameter
KEYS_IN_UNIT = ("start", "stop", "mean", "median", "std")  # numbers in the parameter's unit
LISTS_IN_UNIT = ("values", "bounds")
DIFFERENCES = ("std", "bounds")  # keys with differences: temperatures in them have no offset


def with_numbers(
    tables: Mapping[str, Any], model: Callable[[], ModelDefinition | None], source: SourceText
) -> Mapping[str, Any]:
    """A study file's tables with numbers in place of values with units.

    Parameters
    ----------
    tables : mapping
        Tables of the file. Other texts stay unchanged, and the check of the file refuses them. A
        bare number for ``temperature`` may be in another unit than the parameter's.
    model : callable
        Returns the model with the parameters, or None where it is not known or its parameters have
        no units. It is called only if a value has a unit.
    source : SourceText
        For messages.

    Raises
    ------
    StudyFileError
        A unit is unknown or does not fit the parameter; a parameter is unknown.
    """
    texts = list(_texts(tables))
    definition = model() if texts else None
    if definition is None:
        return tables
    by_name: dict[str, StudyParameter] = {}
    copied: dict[KeyPath, Any] = {(): dict(tables)}
    for keys, name, text in texts:
        try:
            parameter = by_name.get(name) or by_name.setdefault(name, _parameter(name, definition))
        except ParameterError as error:
            raise source.error(_parameter_key(keys), error.message) from None
        with_unit = (
            with_bare_unit(text, parameter.parameter)
            if isinstance(parameter, PlainParameter)
            else text
        )
        if not isinstance(with_unit, str):
            continue
        try:
            difference = parameter.difference or any(key in DIFFERENCES for key in keys)
            number = in_unit_of(with_unit, parameter.unit, difference)
        except ValueError as error:
            raise source.error(keys, f"{name} {error}") from None
        for depth in range(1, len(keys)):
            inner_keys = keys[:depth]
            if inner_keys not in copied:
                outer, last = copied[inner_keys[:-1]], inner_keys[-1]
                copied[inner_keys] = outer[last].copy()
                outer[last] = copied[inner_keys]
        copied[keys[:-1]][keys[-1]] = number
    with_numbers_only: Mapping[str, Any] = copied[()]
    return with_numbers_only


def quantities(tables: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Pairs of a parameter's name and a value with a unit, for all such values in tables."""
    for _, name, written in _texts(tables):
        if isinstance(written, str):
            yield name, written


def _parameter(name: str, model: ModelDefinition) -> StudyParameter:
    """The parameter of a name, also of a mass that the study adds; ParameterError for others."""
    try:
        return parse_parameter(name, model)
    except ParameterError:
        if not name.startswith(ADDED_MASS):
            raise
        return PlainParameter(Parameter(name, 0.0, "kg", "", minimum=0.0))


def _parameter_key(keys: KeyPath) -> KeyPath:
    """Key path at which a file names the parameter whose value is at `keys`."""
    return (*keys[:2], "parameter") if keys[0] in TABLES else keys


def _is_quantity(value: object, name: str) -> bool:
    if name == TEMPERATURE and isinstance(value, int | float):
        return True
    return isinstance(value, str) and QUANTITY.fullmatch(value) is not None


def _texts(tables: Mapping[str, Any]) -> Iterator[tuple[KeyPath, str, object]]:
    """Key path, parameter's name and value of all values with units and bare temperatures."""
    parameters = tables.get("parameters")
    if isinstance(parameters, Mapping):
        yield from _nested(parameters, ("parameters",))
    for table in TABLES:
        listed = tables.get(table)
        for number, sweep in enumerate(listed if isinstance(listed, list) else ()):
            name = sweep.get("parameter") if isinstance(sweep, Mapping) else None
            if not isinstance(name, str):
                continue
            for key in KEYS_IN_UNIT:
                if _is_quantity(sweep.get(key), name):
                    yield (table, number, key), name, sweep[key]
            for key in LISTS_IN_UNIT:
                values = sweep.get(key)
                for index, entry in enumerate(values if isinstance(values, list) else ()):
                    if _is_quantity(entry, name):
                        yield (table, number, key, index), name, entry


def _nested(table: Mapping[str, Any], keys: KeyPath) -> Iterator[tuple[KeyPath, str, object]]:
    """As `_texts` for [parameters], where names may have dots, quotes or be nested tables."""
    for key, entry in table.items() if len(keys) <= MAX_NESTING else ():
        path = (*keys, key)
        if isinstance(entry, Mapping):
            yield from _nested(entry, path)
        elif _is_quantity(entry, name := ".".join(map(str, path[1:]))):
            yield path, name, entry
