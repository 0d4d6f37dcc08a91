"""Values of parameters: numbers or arrays, checked, one design point or a batch of them."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.exceptions import ComplexWarning

from squealstudy.errors import ParameterError
from squealstudy.models.model_point import ModelPoint
from squealstudy.models.parameter import ModelDefinition
from squealstudy.models.parameter_names import StudyParameter
from squealstudy.models.units import quantity

Column = float | np.ndarray


def column_of(parameter: StudyParameter, value: Any) -> Column:
    """A value as a number or an array (m,) of numbers that the parameter can take.

    Raises
    ------
    ParameterError
        Where the value is not a number or an array (m,) of numbers, or one is out of bounds.
    """
    texts = isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "UO"
    if texts or isinstance(value, list | tuple):
        value = [quantity(entry, parameter) for entry in value]
    value = quantity(value, parameter)
    if isinstance(value, int | float):  # bool is an int too, and refused by the check
        return parameter.check(value)
    try:
        with warnings.catch_warnings():  # of complex numbers, which are refused below
            warnings.simplefilter("ignore", ComplexWarning)
            array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        text = f"expected a number or an array of numbers, got {value!r}"
        raise ParameterError(parameter.name, text) from None
    if np.asarray(value).dtype.kind in "bc" or np.ma.is_masked(value):
        raise ParameterError(parameter.name, f"expected numbers, got {value!r}")
    if array.ndim == 0:
        return parameter.check(float(array))
    if array.ndim > 1 or not array.size:
        text = f"expected a number or an array of one axis, got the shape {array.shape}"
        raise ParameterError(parameter.name, text)
    _check_all(parameter, array)
    return array


def _check_all(parameter: StudyParameter, array: np.ndarray) -> None:
    """Check an array (m,): bounds are intervals, maybe without 0, so extreme values suffice."""
    finite = np.isfinite(array)
    if not finite.all():
        parameter.check(float(array[np.argmin(finite)]))
    for position in (np.argmin(array), np.argmax(array), np.argmin(np.abs(array))):
        parameter.check(float(array[position]))


def checked_number(
    name: str, value: Any, lower: float = 0.0, upper: float = math.inf, positive: bool = False
) -> float:
    """An argument as a number within bounds, and above 0 where it must be `positive`.

    Raises
    ------
    ParameterError
        Where it is no such number.
    """
    number = float(value) if _is_real(value) else math.nan
    if math.isfinite(number) and lower <= number <= upper and (number > 0.0 or not positive):
        return number
    low = "above 0" if positive else f"of at least {lower:g}"
    high = f" and at most {upper:g}" if math.isfinite(upper) else ""
    raise ParameterError(name, f"expected a number {low}{high}, got {value!r}")


def checked_count(name: str, value: Any, lower: int, upper: float = math.inf) -> int:
    """An argument as a whole number within bounds; ParameterError where it is no such number."""
    if isinstance(value, Integral) and _is_real(value) and lower <= int(value) <= upper:
        return int(value)
    ends = f"from {lower} to {upper:g}" if math.isfinite(upper) else f"of at least {lower}"
    raise ParameterError(name, f"expected a whole number {ends}, got {value!r}")


def _is_real(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool | np.bool_)


def common_length(columns: Mapping[str, Column]) -> int | None:
    """Length of a batch, arrays of one value broadcast; None where all are numbers.

    Raises
    ------
    ParameterError
        Where arrays have different lengths.
    """
    lengths = {name: len(x) for name, x in columns.items() if isinstance(x, np.ndarray)}
    if not lengths:
        return None
    longest = max(lengths, key=lambda name: lengths[name])
    for name, length in lengths.items():
        if length not in (1, lengths[longest]):
            raise ParameterError(
                name, f"has {length} values, '{longest}' has {lengths[longest]}: expected as many"
            )
    return lengths[longest]


@dataclass(frozen=True, eq=False)
class Values:
    """Values of all parameters of a model, at one design point or a batch of m.

    Attributes
    ----------
    definition : ModelDefinition
    options : mapping of str -> str or int
        A value of every option.
    columns : mapping of str -> float or ndarray (m,)
        A value of every parameter, and of the mode parameters in use.
    length : int or None
        Number m of design points; None for a single one.
    """

    definition: ModelDefinition
    options: Mapping[str, str | int]
    columns: Mapping[str, Column]
    length: int | None

    @classmethod
    def of(
        cls,
        definition: ModelDefinition,
        options: Mapping[str, str | int],
        common: Mapping[str, float],
        columns: Mapping[str, Column],
    ) -> Values:
        """Values of `columns`, the others from `common`; parameters with a table follow it."""
        length = common_length(columns)
        spread = {
            name: np.broadcast_to(x, length or 1) if isinstance(x, np.ndarray) else x
            for name, x in columns.items()
        }
        return cls(definition, options, definition.followed({**common, **spread}), length)

    @property
    def count(self) -> int:
        """Number of design points."""
        return 1 if self.length is None else self.length

    @cached_property
    def varied(self) -> dict[str, np.ndarray]:
        """Those of `columns` that are arrays (m,)."""
        return {k: x for k, x in self.columns.items() if isinstance(x, np.ndarray)}

    @cached_property
    def _common(self) -> dict[str, float]:
        return {k: float(x) for k, x in self.columns.items() if not isinstance(x, np.ndarray)}

    def point(self, number: int) -> ModelPoint:
        """One of the design points, from 0."""
        varied = {name: float(x[number]) for name, x in self.varied.items()}
        return ModelPoint(self.definition, self.options, {**self._common, **varied})

    def at(self, number: int) -> Values:
        """The values of one design point by itself, numbered from 0."""
        point = self.point(number)
        return Values(self.definition, self.options, dict(point.values), None)

    def ends(self, name: str) -> tuple[float, float]:
        """Least and largest value of a parameter."""
        x = self.columns[name]
        return (float(np.min(x)), float(np.max(x)))

    def of_structures(self) -> Iterator[tuple[ModelPoint, np.ndarray]]:
        """Yield each structure's first design point and the numbers of all its design points."""
        names = [
            p.name for p in self.definition.parameters if p.structural and p.name in self.varied
        ]
        if not names:
            yield self.point(0), np.arange(self.count)
            return
        rows = np.column_stack([self.varied[name] for name in names])
        _, first, structure = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(structure.ravel(), kind="stable")
        cuts = np.cumsum(np.bincount(structure.ravel()))[:-1]
        for position, numbers in zip(first, np.split(order, cuts), strict=True):
            yield self.point(int(position)), numbers
