"""The parameters that a model file declares, for studies of it: operating point and own numbers."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import replace

from squealstudy.errors import ModelError, ParameterError
from squealstudy.models.components.file_tables import ParameterTable
from squealstudy.models.components.model_file import (
    NOT_NEGATIVE,
    POSITIVE,
    ModelFile,
    Numbers,
    dimension_of,
    kind_of,
)
from squealstudy.models.file_table import KeyPath
from squealstudy.models.operating import (
    DAMPING,
    FRICTION,
    GYROSCOPIC,
    PRESSURE,
    SLIDING_SPEED,
    STIFFNESS_DAMPING,
    contact_parameters,
    friction_parameters,
)
from squealstudy.models.own_law import OF_CONTACT, law_parameter_named
from squealstudy.models.parameter import Declared
from squealstudy.models.units import Unit, in_unit_of
from squealstudy.parameter import Parameter
from squealstudy.study.family import RESERVED_NAMES
from squealstudy.study.source import SourceText
from squealstudy.wording import did_you_mean

OPERATING_PARAMETERS = (FRICTION, PRESSURE, SLIDING_SPEED, DAMPING, STIFFNESS_DAMPING)


def file_places(file: ModelFile, source: SourceText) -> dict[str, tuple[KeyPath, ...]]:
    """Key paths of the numbers in the file that each parameter sets, by its name.

    StudyFileError for a path that leads to no number, or that two parameters have.
    """
    places_of: dict[str, tuple[KeyPath, ...]] = {}
    owner: dict[KeyPath, str] = {}
    for name, table in file.parameters.items():
        number_keys = []
        for path in table.paths:
            try:
                keys = file.located(path)
            except ModelError as error:
                raise source.error(("parameters", name, "path"), str(error)) from None
            if owner.setdefault(keys, name) != name:
                text = f"'{path}' is the parameter '{owner[keys]}' already"
                raise source.error(("parameters", name, "path"), text)
            number_keys.append(keys)
        if number_keys:
            places_of[name] = tuple(number_keys)
    return places_of


def file_parameters(
    file: ModelFile, source: SourceText, keys_of: Mapping[str, tuple[KeyPath, ...]]
) -> Declared:
    """All parameters of the model: of the operating point, of laws, and of numbers in the file.

    The file may change defaults of the operating point. StudyFileError for a wrong parameter.
    """
    gyroscopic = () if file.rotation is None else (GYROSCOPIC,)
    standard = (*OPERATING_PARAMETERS, *gyroscopic)
    operating = {p.name: p for p in (*standard, *friction_parameters(), *contact_parameters())}
    of_file = []
    for name, table in file.parameters.items():
        keys = ("parameters", name)
        if name in operating:
            operating[name] = _changed(operating[name], table, source, keys)
        elif name in RESERVED_NAMES or "[" in name:
            raise source.error(keys, f"'{name}' has another meaning in tables: choose another name")
        elif name not in keys_of:
            hint = did_you_mean(name, operating) or "; or one of the operating point"
            raise source.error(keys, f'expected path = "..." of its number{hint}')
        else:
            of_file.append(_parameter(name, table, file, source, keys_of[name]))
    first = [operating[p.name] for p in standard]
    changed = [operating[name] for name in file.parameters if name in operating]
    return (*first, *changed, friction_parameters, contact_parameters, *of_file)


def _changed(
    parameter: Parameter, table: ParameterTable, source: SourceText, keys: KeyPath
) -> Parameter:
    """A parameter of the operating point with the default of the file, in SI units."""
    if table.paths:
        raise source.error(keys, "it belongs to the operating point: expected no path")
    if table.default is None:
        raise source.error(keys, "expected default = NUMBER")
    factor = 1.0 if table.unit is None else _unit_factor(table.unit, parameter.unit, source, keys)
    default = _default(table, factor, parameter.unit, source, keys)
    try:
        return replace(parameter, default=parameter.check(default))
    except ParameterError as error:
        raise source.error((*keys, "default"), error.message) from None


def _unit_factor(unit: str, parameter_unit: str, source: SourceText, keys: KeyPath) -> float:
    """Factor from a unit to `parameter_unit`; StudyFileError where the dimensions differ."""
    if unit == parameter_unit:  # `Unit` cannot parse all units, such as Pa/m^n
        return 1.0
    with contextlib.suppress(KeyError):
        stated, target = Unit.named(unit), Unit.named(parameter_unit or "1")
        if stated.powers == target.powers:
            return float(stated.size / target.size)
    expected = f"a unit like '{parameter_unit}'" if parameter_unit else "no unit"
    raise source.error((*keys, "unit"), f"expected {expected}, got '{unit}'")


def _default(
    table: ParameterTable, factor: float, parameter_unit: str, source: SourceText, keys: KeyPath
) -> float:
    """The default in the parameter's unit: a text with a unit, or a number times `factor`."""
    if not isinstance(table.default, str):
        assert table.default is not None
        return factor * table.default
    if table.unit is not None:
        raise source.error((*keys, "unit"), f"the default has its own unit: '{table.default}'")
    try:
        return in_unit_of(table.default, parameter_unit)
    except ValueError as error:
        raise source.error((*keys, "default"), f"{keys[-1]} {error}") from None


def _parameter(
    name: str,
    table: ParameterTable,
    file: ModelFile,
    source: SourceText,
    number_keys: tuple[KeyPath, ...],
) -> Parameter:
    """A parameter of numbers in the file, in SI units."""
    keys = ("parameters", name)
    dimension = dimension_of(number_keys[0])
    for path, other in zip(table.paths[1:], number_keys[1:], strict=True):
        if dimension_of(other) != dimension:
            message = f"'{path}' has another unit than '{table.paths[0]}'"
            raise source.error((*keys, "path"), message)
    factor = dimension.factor(file.units)
    if table.unit is not None:
        factor = _unit_factor(table.unit, dimension.unit, source, keys)
    if table.default is not None:
        default = _default(table, factor, dimension.unit, source, keys)
    elif file.at(number_keys[0]) is None or isinstance(file.at(number_keys[0]), str):
        raise source.error(
            keys, "expected default = NUMBER: its value is in a mesh, not in this file"
        )
    else:
        default = Numbers(file, {}).at(*number_keys[0])
    kind = kind_of(number_keys[0])
    description = table.description or " and ".join(table.paths)
    is_poisson_ratio = kind == "nu" and not isinstance(number_keys[0][-1], int)
    if OF_CONTACT in number_keys[0]:
        of_law = law_parameter_named(kind)
        parameter = replace(
            of_law, name=name, default=default, description=description, structural=True
        )
        return _checked(parameter, source, keys)
    parameter = Parameter(
        name,
        default,
        dimension.unit,
        description,
        positive=kind in POSITIVE,
        minimum=0.0 if kind in NOT_NEGATIVE else -float("inf"),
        above=-1.0 if is_poisson_ratio else -float("inf"),
        below=0.5 if is_poisson_ratio else float("inf"),
        maximum=1.0 if kind == "state" else float("inf"),
        structural=True,
    )
    return _checked(parameter, source, keys)


def _checked(parameter: Parameter, source: SourceText, keys: KeyPath) -> Parameter:
    """The parameter; StudyFileError where its default is beyond its bounds."""
    try:
        parameter.check(parameter.default)
    except Exception as error:
        raise source.error((*keys, "default"), getattr(error, "message", str(error))) from None
    return parameter
