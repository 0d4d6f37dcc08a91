"""Types of numbers, directions and places in files of lumped models, with plain messages."""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, Strict, WithJsonSchema

from squealstudy.laws.own_friction import STATES
from squealstudy.wording import shown

# so that a stiffness of this size times the square of such an arm is at most MAX_SQUARABLE_ENTRY
LARGEST_NUMBER = 1e50


def checked_number(written: Any, *, text: str = "an expression in quotes") -> float | str:
    """A finite number as float, or a text unchanged; ValueError for others and too large ones."""
    if isinstance(written, str):
        return written
    number = isinstance(written, int | float) and not isinstance(written, bool)
    if not number or not math.isfinite(written):
        raise ValueError(f"expected a finite number, or {text}, got {shown(written)}")
    if abs(written) > LARGEST_NUMBER:
        raise ValueError(f"expected a number of at most {LARGEST_NUMBER:g}, got {written:g}")
    return float(written)


def _coefficient(written: Any) -> bool | float | str:
    if isinstance(written, bool):
        return written
    return checked_number(written, text="an expression in quotes, or false for none")


def _state(written: Any) -> float | str:
    if isinstance(written, str) and written in STATES:
        return STATES[written]
    return checked_number(written, text="'stuck', 'sliding' or a parameter that is 1 or 0 of them")


def _with_unit(written: Any) -> float | str:
    return checked_number(written, text='text with its unit, such as "7 kN/mm"')


def _direction(written: Any) -> str | tuple[float | str, ...]:
    """The key of a direction as a word or as components; ValueError for others."""
    if isinstance(written, str):
        return written
    if not isinstance(written, list):
        text = f"expected a direction such as 'x', or components [x, y], got {shown(written)}"
        raise ValueError(text)  # noqa: TRY004 - pydantic tells no TypeError
    if len(written) not in (2, 3):
        raise ValueError(f"expected two or three components, got {len(written)}")
    return tuple(checked_number(part) for part in written)


Number = Annotated[float | str, BeforeValidator(checked_number)]  # or an expression of parameters
Coefficient = Annotated[
    bool | float | str,
    BeforeValidator(_coefficient),
    WithJsonSchema({"type": ["boolean", "number", "string"]}),
]
State = Annotated[
    float | str, BeforeValidator(_state), WithJsonSchema({"type": ["number", "string"]})
]
NumberWithUnit = Annotated[float | str, BeforeValidator(_with_unit)]
# a word, or components along x, y and z; z is 0 if there are two
Direction = Annotated[str | tuple[float | str, ...], BeforeValidator(_direction)]
_OnAxis = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
Position = Annotated[tuple[_OnAxis, _OnAxis, _OnAxis], Strict(False)]
