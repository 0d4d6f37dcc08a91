"""The tables of a model file of matrices: terms, and parts that act on coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, Strict, WithJsonSchema

from squealstudy.models.file_table import Name, Table
from squealstudy.models.lumped.number_types import Number, checked_number
from squealstudy.models.lumped.tables import (
    CALLED,
    ContactNumbers,
    DamperNumbers,
    LoadNumbers,
    LumpedFile,
    NameTuple,
    PartsFile,
    SpringNumbers,
)

EXPECTED = (
    'expected a coordinate by number or name, two in a list, or {NAME = factor}, such as "-x"'
)
MOTION_TEXT = (
    "coordinate by number from 1 or by name, with a minus the opposite; two in a list: the first "
    "relative to the second; {NAME = factor}: their sum"
)


def _motion(written: Any) -> Any:
    """Names of coordinates and their factors, from any of the forms in a file."""
    if isinstance(written, Mapping):
        pairs = [(name, checked_number(part)) for name, part in written.items()]
    elif isinstance(written, list):
        if len(written) not in (1, 2):
            raise ValueError(f"expected one coordinate or two, got {len(written)}")
        pairs = [
            _signed(coordinate, sign)
            for coordinate, sign in zip(written, (1.0, -1.0), strict=False)
        ]
    else:
        pairs = [_signed(written, 1.0)]
    names = [name for name, _ in pairs]
    if not names:
        raise ValueError(EXPECTED + ", got none")
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"expected two coordinates that differ, got '{name}' twice")
    return tuple(pairs)


def _signed(written: Any, sign: float) -> tuple[str, float]:
    named = isinstance(written, int | str) and not isinstance(written, bool)
    if not named:
        raise ValueError(f"{EXPECTED}, got {written}")
    text = str(written).strip()
    negative = text.startswith("-")
    return text.removeprefix("-"), -sign if negative else sign


Motion = Annotated[
    tuple[tuple[str, Number], ...],
    BeforeValidator(_motion),
    WithJsonSchema({"type": ["integer", "string", "array", "object"]}),  # as files say it
]


class TermTable(Table):
    """A summand of the mass, damping or stiffness: a matrix times its coefficient."""

    name: Name | None = Field(default=None, description=CALLED)
    matrix: Literal["M", "C", "K", "G"] = Field(
        description="mass, damping, stiffness, or gyroscopic"
    )
    file: str = Field(
        min_length=1, description="file of the matrix, relative to the model file or absolute"
    )
    variable: str | None = Field(
        default=None, description="which matrix, where the file holds several"
    )
    coefficient: Number = Field(default=1.0, description="number, or expression of parameters")


class SpringOn(SpringNumbers):
    """A spring on coordinates."""

    along: Motion = Field(description=MOTION_TEXT)


class DamperOn(DamperNumbers):
    """A damper on coordinates."""

    along: Motion = Field(description=MOTION_TEXT)


class ContactOn(ContactNumbers):
    """A contact point on coordinates."""

    normal: Motion = Field(description="motion that opens it: " + MOTION_TEXT)
    sliding: Motion | None = Field(
        default=None, description="motion that friction pulls along: " + MOTION_TEXT
    )
    across: Motion | None = Field(
        default=None, description="motion across the sliding: " + MOTION_TEXT
    )


class LoadOn(LoadNumbers):
    """A force on coordinates."""

    along: Motion = Field(description=MOTION_TEXT)


class MatrixFile(PartsFile):
    """A whole model file of matrices."""

    coordinates: NameTuple = Field(
        default=(), description="names of all coordinates in the order of the rows"
    )
    term: Annotated[tuple[TermTable, ...], Strict(False)] = Field(
        min_length=1, description="matrices of M, C and K"
    )
    spring: Annotated[tuple[SpringOn, ...], Strict(False)] = Field(
        default=(), description="on coordinates"
    )
    damper: Annotated[tuple[DamperOn, ...], Strict(False)] = Field(
        default=(), description="on coordinates"
    )
    contact: Annotated[tuple[ContactOn, ...], Strict(False)] = Field(
        default=(), description="on coordinates"
    )
    load: Annotated[tuple[LoadOn, ...], Strict(False)] = Field(
        default=(), description="forces on coordinates"
    )


AnyFile = LumpedFile | MatrixFile
