"""Numbers of the file of a lumped model: expressions of its parameters, and directions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.lumped.number_types import LARGEST_NUMBER, Direction, Number
from squealstudy.models.lumped.tables import AXES, TRANSLATIONS, TURNS
from squealstudy.models.matrices.expression import Expression, ExpressionError

Values = Mapping[str, Any]  # values of the parameters: numbers, or arrays (m,)
LEAST_DIRECTION = 1e-12  # a shorter vector has no direction


@lru_cache(maxsize=1024)
def expression(text: str) -> Expression:
    """The expression of a text; ExpressionError where the text is not one."""
    return Expression(text)


def names_in(number: Number | None) -> tuple[str, ...]:
    """Names of the parameters in a number; ExpressionError where its text is no expression."""
    return expression(number).names if isinstance(number, str) else ()


def value_of(number: Number, values: Values, keys: KeyPath) -> np.ndarray:
    """The value (m,) or () of a number; PlacedError where it has none."""
    if not isinstance(number, str):
        return np.asarray(number, dtype=float)
    try:
        number_values = expression(number).of_arrays(values)
    except ExpressionError as error:
        raise PlacedError(keys, str(error)) from None
    wrong = np.flatnonzero(np.abs(number_values) > LARGEST_NUMBER)
    if len(wrong):
        got = _got(number, number_values, wrong[0], values)
        raise PlacedError(keys, f"expected a number of at most {LARGEST_NUMBER:g}, got {got}")
    return number_values


def _got(number: Number, number_values: np.ndarray, i: int, values: Values) -> str:
    """Value i of a number, with its expression and the parameters in it, as text."""
    text = f"{np.atleast_1d(number_values)[i]:g}"
    if names := names_in(number):
        parameter_values = (np.broadcast_to(values[n], number_values.shape).flat[i] for n in names)
        at_values = ", ".join(f"{n} = {v:g}" for n, v in zip(names, parameter_values, strict=True))
        text += f" of '{number}' at {at_values}"
    return text


def bounded(
    number: Number, values: Values, keys: KeyPath, unit: str, *, zero: bool = False
) -> np.ndarray:
    """`value_of` a number that must be above zero, or with `zero` not below; else PlacedError."""
    number_values = value_of(number, values, keys)
    wrong = np.flatnonzero(number_values < 0.0 if zero else number_values <= 0.0)
    if len(wrong):
        got = _got(number, number_values, wrong[0], values)
        expected = "at least 0" if zero else "a value above 0"
        raise PlacedError(keys, f"expected {' '.join(filter(None, (expected, unit)))}, got {got}")
    return number_values


@dataclass(frozen=True)
class Along:
    """A direction of motion, or a rotation about an axis.

    Attributes
    ----------
    vector : ndarray (m, 3) or (1, 3)
        Unit vector of the motion, or of the axis of rotation.
    turn : bool
        Whether it is a rotation.
    """

    vector: np.ndarray
    turn: bool


def along(direction: Direction, values: Values, keys: KeyPath, *, turns: bool = False) -> Along:
    """The direction at values of the parameters; PlacedError where there is no direction."""
    if isinstance(direction, str):
        name = direction.removeprefix("-")
        axes = AXES if turns else TRANSLATIONS
        if name not in axes:
            text = f"expected one of {', '.join(axes)}, with a minus or without, or components"
            raise PlacedError(keys, f"{text} [x, y], got '{direction}'")
        axis = np.zeros((1, 3))
        axis[0, AXES.index(name) % 3] = -1.0 if direction.startswith("-") else 1.0
        return Along(axis, name in TURNS)
    parts = [value_of(part, values, (*keys, i)) for i, part in enumerate(direction)]
    parts += [np.zeros(())] * (3 - len(parts))
    vector = np.stack([np.atleast_1d(part) for part in np.broadcast_arrays(*parts)], axis=-1)
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    if (length <= LEAST_DIRECTION).any():
        raise PlacedError(keys, "expected a direction, got components that are all zero")
    return Along(vector / length, turn=False)


def side_by_side(columns: Sequence[np.ndarray]) -> np.ndarray:
    """Stack k numbers or arrays (m,) as columns: (m or 1, k)."""
    if not columns:
        return np.zeros((1, 0))
    return np.stack([np.atleast_1d(c) for c in np.broadcast_arrays(*columns)], axis=-1)
