"""The model of the file of a lumped model: its parameters, laws and structure."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from squealstudy.errors import ParameterError
from squealstudy.laws.friction_law import FrictionCurveDefinition
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.lumped.build import LargestFriction, LumpedBuild
from squealstudy.models.lumped.checks import check_tables, check_used, texts_of
from squealstudy.models.lumped.contact_friction import has_own_numbers
from squealstudy.models.lumped.definition import (
    DESCRIPTION,
    NAME,
    TABLES_OF_FILE,
    LumpedDefinition,
)
from squealstudy.models.lumped.held import check_held, check_pressed
from squealstudy.models.lumped.masses import MassSpace
from squealstudy.models.lumped.matrices import MatrixSpace
from squealstudy.models.lumped.matrix_tables import AnyFile, MatrixFile
from squealstudy.models.lumped.number_types import Number
from squealstudy.models.lumped.numbers import expression
from squealstudy.models.lumped.parts import parts_of
from squealstudy.models.lumped.tables import ContactNumbers, LumpedFile, ParameterTable
from squealstudy.models.lumped.term_matrices import read_terms
from squealstudy.models.matrices.expression import RESERVED
from squealstudy.models.operating import (
    ASSUMPTIONS,
    CONTACT_OPTION,
    DAMPING,
    FRICTION,
    FRICTION_OPTION,
    FRICTION_RANGE,
    PRESSURE,
    SLIDING_SPEED,
    STIFFNESS_DAMPING,
    contact_laws,
    contact_parameters,
    friction_parameters,
)
from squealstudy.models.own_law import LAW_PREFIX, law_first, law_of_contacts
from squealstudy.models.parameter import Declared, ModelOption
from squealstudy.models.units import Unit, in_unit_of
from squealstudy.parameter import Parameter
from squealstudy.study.family import RESERVED_NAMES
from squealstudy.study.source import SourceText, validate
from squealstudy.wording import did_you_mean

LINEAR = "bilateral"  # default contact law: linear, and never open
ANGLES = ("deg", "°")  # units of parameters that are not of SI
POSITIVE = ("mass", "inertia", "area", "speed_factor", "radius")  # keys above zero
# keys of zero or above; the stiffness of a contact is above zero
NOT_NEGATIVE = ("stiffness", "damping", "friction", "friction_factor", "state", "tangential")


def read_lumped(path: Path) -> LumpedDefinition:
    """Read a lumped model, a file with [[mass]] or [[term]]; StudyFileError where it is wrong."""
    return lumped_of(SourceText.read(path))


def lumped_of(source: SourceText) -> LumpedDefinition:
    """The lumped model of a text, as `read_lumped`."""
    if all(name in source.tables for name in TABLES_OF_FILE):
        text = "expected either [[mass]] or [[term]], whose matrices hold all masses: not both"
        raise source.error(("term",), text)
    file: AnyFile
    if "term" in source.tables:
        file = validate(MatrixFile, source, source.tables)
    else:
        file = validate(LumpedFile, source, source.tables)
    with _with_file_and_key(source):
        check_tables(file)
    operating = _operating(file)
    file_names = tuple(name for name in file.parameters if name not in operating)
    with _with_file_and_key(source):
        check_used(file, file_names)
    declared = _declared(file, source, operating, file_names)
    defaults = {p.name: p.default for p in declared if isinstance(p, Parameter)}
    folder = source.path.parent
    with _with_file_and_key(source):
        space = (
            MassSpace(file)
            if isinstance(file, LumpedFile)
            else MatrixSpace(file, read_terms(file, folder))
        )
        contacts = tuple(enumerate(file.contact))
        numbers = [(i, key) for i, table in contacts for key in table.friction_law]
        law = law_of_contacts([file.name_of("contact", i) for i, _ in contacts], numbers)
        parts = parts_of(space, defaults, law)
        check_held(space, parts)
        if isinstance(space, MatrixSpace):
            check_pressed(space, parts)
    build = LumpedBuild(str(source.path), space, file_names)
    rubbing = [t for t in file.contact if t.rubs and t.sliding is not None]
    with_own = [t for t in rubbing if has_own_numbers([t])]
    factors = tuple(t.friction_factor for t in rubbing if t not in with_own)
    own_static = tuple(map(_own_static, with_own))
    terms = () if isinstance(file, LumpedFile) else file.term
    paths = dict.fromkeys(folder / term.file for term in terms)
    return LumpedDefinition(
        name=NAME,
        description=file.description or DESCRIPTION,
        options=(
            ModelOption(CONTACT_OPTION.name, _linear_first, CONTACT_OPTION.description),
            ModelOption(
                FRICTION_OPTION.name, partial(law_first, law.name), FRICTION_OPTION.description
            ),
        ),
        declared=declared,
        components=parts.structure.components,
        build=build,
        stack=build.stack,
        assumptions=tuple(
            replace(a, group=LargestFriction(factors, own_static)) if a is FRICTION_RANGE else a
            for a in ASSUMPTIONS
        ),
        idle=_idle(rubbing, law),
        own_of_law=frozenset(f"{LAW_PREFIX}{key}" for t in rubbing for key in t.friction_law),
        torque_unit="N" if all(t.radius is None for t in file.contact) else "N m",
        path=str(source.path.resolve()),
        files=(
            hashlib.sha256(source.text.encode()).hexdigest(),
            *(hashlib.sha256(path.read_bytes()).hexdigest() for path in paths),
        ),
    )


def _idle(rubbing: Sequence[ContactNumbers], law: FrictionCurveDefinition) -> dict[str, str]:
    """Parameters of the operating point that no contact follows, and why."""
    if not has_own_numbers(rubbing):
        return {}
    sliding = [table for table in rubbing if table.state is None]
    why = "every contact with friction has its own"
    idle = {FRICTION.name: why} if all(t.own_coefficient is not None for t in rubbing) else {}
    if not sliding:
        idle[SLIDING_SPEED.name] = "no contact slides at it"
    for parameter in law.parameters:
        key = parameter.name.removeprefix(LAW_PREFIX)
        if all(key in table.friction_law for table in sliding):
            idle[parameter.name] = why if sliding else "no contact slides"
    return idle


def _own_static(table: ContactNumbers) -> tuple[Number, dict[str, Number]]:
    """Coefficient and friction-law parameters of a contact that has its own.

    With these, `LargestFriction` computes its static friction.
    """
    coefficient = table.own_coefficient
    law: dict[str, Number] = {f"{LAW_PREFIX}{key}": x for key, x in table.friction_law.items()}
    if table.state is not None:  # it has its coefficient at all speeds
        law = {p.name: p.default for p in friction_parameters() if p.name.startswith(LAW_PREFIX)}
    factor = table.friction_factor
    return (f"friction * ({factor})" if coefficient is None else coefficient), law


def _linear_first() -> tuple[str, ...]:
    return LINEAR, *(name for name in contact_laws() if name != LINEAR)


@contextmanager
def _with_file_and_key(source: SourceText) -> Iterator[None]:
    """Raise a PlacedError as StudyFileError, with file, line and key."""
    try:
        yield
    except PlacedError as error:
        hint = did_you_mean(error.word, error.known)
        raise source.error(error.keys, error.message + hint) from error


def _operating(file: AnyFile) -> dict[str, Parameter]:
    """Parameters of the operating point that the model has."""
    pressed = (PRESSURE,) if any(table.area is not None for table in file.load) else ()
    plain = (FRICTION, *pressed, SLIDING_SPEED, DAMPING, STIFFNESS_DAMPING)
    return {p.name: p for p in (*plain, *friction_parameters(), *contact_parameters())}


def _declared(
    file: AnyFile,
    source: SourceText,
    operating: dict[str, Parameter],
    file_names: tuple[str, ...],
) -> Declared:
    """Parameters of the operating point with the file's defaults, and those of the file."""
    of_laws = {p.name for p in (*friction_parameters(), *contact_parameters())}
    changed = {
        name: _changed(operating[name], file, source)
        for name in file.parameters
        if name in operating
    }
    first = [changed.get(name, p) for name, p in operating.items() if name not in of_laws]
    others = [p for name, p in changed.items() if name in of_laws]
    of_file = [_parameter(name, file, source) for name in file_names]
    return (*first, *others, friction_parameters, contact_parameters, *of_file)


def _changed(parameter: Parameter, file: AnyFile, source: SourceText) -> Parameter:
    """A parameter of the operating point with the default of the file."""
    table, keys = file.parameters[parameter.name], ("parameters", parameter.name)
    for key in ("unit", "minimum", "maximum"):
        if getattr(table, key) is not None:
            raise source.error((*keys, key), "it belongs to the operating point: default alone")
    default = _default(table, parameter.unit, source, keys)
    return _checked(replace(parameter, default=default), source, keys)


def _parameter(name: str, file: AnyFile, source: SourceText) -> Parameter:
    """A parameter of the file, which its expressions use."""
    table, keys = file.parameters[name], ("parameters", name)
    if not name.isidentifier() or name in RESERVED_NAMES or name in RESERVED:
        text = f"'{name}' has another meaning: expected a name of letters, digits and _"
        raise source.error(keys, text if name.isidentifier() else text.partition(": ")[2])
    unit = _unit(table, source, keys)
    number_keys = [k for k, text in texts_of(file) if expression(text).text == name]
    positive = any(_above_zero(path) for path in number_keys)
    minimum = 0.0 if any(path[-1] in NOT_NEGATIVE for path in number_keys) else -float("inf")
    users = (
        f"{k[0]} {file.name_of(str(k[0]), int(k[1]))}"
        for k, text in texts_of(file)
        if name in expression(text).names
    )
    parameter = Parameter(
        name,
        _default(table, unit, source, keys),
        unit,
        table.description or "of " + ", ".join(dict.fromkeys(users)),
        minimum=minimum if table.minimum is None else table.minimum,
        maximum=float("inf") if table.maximum is None else table.maximum,
        positive=positive,
        structural=True,
    )
    return _checked(parameter, source, keys)


def _above_zero(keys: KeyPath) -> bool:
    return keys[-1] in POSITIVE or (keys[0] == "contact" and keys[-1] == "stiffness")


def _unit(table: ParameterTable, source: SourceText, keys: KeyPath) -> str:
    """The unit of a parameter in expressions: one of SI, or deg; StudyFileError for others."""
    unit = table.unit or ""
    try:
        parsed = Unit.named(unit or "1")
    except KeyError as error:
        text = f"'{unit}': the unit '{error.args[0]}' is not known"
        raise source.error((*keys, "unit"), text) from None
    if parsed.size != 1 and unit not in ANGLES:
        text = f"expected a unit of SI, in which expressions are, or deg; got '{unit}'"
        raise source.error((*keys, "unit"), f'{text}: default = "7 kN/mm" is converted to it')
    return unit


def _default(table: ParameterTable, unit: str, source: SourceText, keys: KeyPath) -> float:
    """Default of a parameter of the file in its unit, from a number or a text with a unit."""
    if not isinstance(table.default, str):
        return table.default
    try:
        return in_unit_of(table.default, unit)
    except ValueError as error:
        more = "" if unit else ': expected unit = "..." of SI beside it'
        raise source.error((*keys, "default"), f"{keys[-1]} {error}{more}") from None


def _checked(parameter: Parameter, source: SourceText, keys: KeyPath) -> Parameter:
    try:
        parameter.check(parameter.default)
    except ParameterError as error:
        raise source.error((*keys, "default"), error.message) from None
    return parameter
