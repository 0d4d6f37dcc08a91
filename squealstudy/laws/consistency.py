"""Trial of the functions of a law from outside the package, before they are used.

A slope that contradicts its law makes every eigenvalue wrong, and a full-order check as well. Laws
are tried when they are registered, at the values of a study's parameters, and at each working
point.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.errors import ModelError, ParameterError
from squealstudy.parameter import Parameter

DIFFERENCE_REL_STEP = 1e-5  # relative step of difference quotients
SLOPE_REL_TOLERANCE = 1e-3  # relative difference of a slope and a difference quotient that agree
EQUAL_REL_TOLERANCE = 1e-6  # relative difference of two functions that compute the same
SLOPE_ROUND_OFF = 1e-9  # slope times argument over the function, below which it is round-off


class NotComputedError(ModelError):
    """A function that fails, or does not return finite numbers, with some arguments."""


class Tried:
    """A function of a law, whose calls and slopes are checked.

    Parameters
    ----------
    law : str
        Name of the law.
    function : callable
    names : sequence of str
        Names of the function's arguments.
    results : sequence of str
        Names of its results.

    Raises
    ------
    ModelError
        The function does not take this number of arguments.
    NotComputedError
        Raised by a call: the function fails, or returns anything but this number of finite numbers.
    """

    def __init__(
        self, law: str, function: Callable[..., Any], names: Sequence[str], results: Sequence[str]
    ) -> None:
        self._law, self._function, self._names, self._results = law, function, names, results
        try:
            inspect.signature(function).bind(*names)
        except TypeError:
            raise self.error(f"expected to take ({', '.join(names)})") from None

    def error(self, text: str, of: type[ModelError] = ModelError) -> ModelError:
        """The error of this class, whose message begins with file, function and law."""
        path = Path(inspect.getfile(inspect.unwrap(self._function))).name
        return of(f"{path}: {self._function.__name__} of law '{self._law}': {text}")

    def __call__(self, *arguments: float) -> tuple[float, ...]:
        """Results of the function as finite floats."""
        try:
            found = self._function(*arguments)
            values = tuple(map(float, found if isinstance(found, tuple | list) else (found,)))
        except Exception as error:
            text = f"{type(error).__name__}: {error}, with {self._given(arguments)}"
            raise self.error(text, NotComputedError) from error
        if len(values) != len(self._results) or not all(map(math.isfinite, values)):
            wanted, given = ", ".join(self._results), self._given(arguments)
            text = f"expected {wanted} as finite numbers, got {found!r} with {given}"
            raise self.error(text, NotComputedError)
        return values

    def _given(self, arguments: Sequence[float]) -> str:
        return ", ".join(f"{n} = {a:g}" for n, a in zip(self._names, arguments, strict=True))

    def expect_slope(
        self, slope_name: str, slope: float, arguments: Sequence[float], k: int, size: float = 1.0
    ) -> None:
        """ModelError where a slope of the first result by argument k contradicts differences.

        `size` takes the place of the argument's modulus where that is 0.
        """
        if (other := self._misfit(slope, arguments, k, size)) is not None:
            raise self.error(f"{slope_name} is {slope:g}, differences give {other:g}")

    def _misfit(
        self, slope: float, arguments: Sequence[float], k: int, size: float, result: int = 0
    ) -> float | None:
        """The slope by differences where `slope` contradicts it; None where they agree."""
        x = arguments[k]
        size = abs(x) or size
        h = DIFFERENCE_REL_STEP * size
        low, middle, high = (
            self(*arguments[:k], shifted, *arguments[k + 1 :])[result]
            for shifted in (x - h, x, x + h)
        )
        differences = (
            (high - low) / (2 * h),
            (high - middle) / h,
            (middle - low) / h,
        )  # one-sided at a kink
        noise = SLOPE_ROUND_OFF * abs(middle) / size
        if any(
            abs(slope - d) <= SLOPE_REL_TOLERANCE * max(abs(slope), abs(d)) + noise
            for d in differences
        ):
            return None
        return differences[0]

    def expect_slopes(
        self,
        function: Callable[..., Any],
        arguments: Sequence[float],
        parameters: Sequence[Parameter],
        size: float,
    ) -> None:
        """ModelError where a function's slopes by its arguments contradict differences.

        `parameters` are the last arguments: slopes by one at its bound are not compared. `size`
        takes the place of the modulus of other arguments that are 0.
        """
        names = [f"d {result} / d {name}" for name in self._names for result in self._results]
        slopes = Tried(self._law, flat(function), self._names, names)
        first = len(arguments) - len(parameters)
        for number, slope in enumerate(slopes(*arguments)):
            k, result = divmod(number, len(self._results))
            if k >= first and not _varies(parameters[k - first], arguments[k]):
                continue
            other = self._misfit(slope, arguments, k, size if k < first else 1.0, result)
            if other is not None:
                text = f"{names[number]} is {slope:g}, differences give {other:g}"
                raise slopes.error(f"{text}, with {self._given(arguments)}")

    def expect_same(self, computed: float, expected: float, within: float, text: str) -> None:
        """ModelError with `text` where two numbers differ by more than `within`, relative."""
        if abs(computed - expected) > within * max(abs(computed), abs(expected)):
            raise self.error(text)


def flat(function: Callable[..., Any]) -> Callable[..., tuple[float, ...]]:
    """Flatten the results of a function, rows of numbers or of arrays of one, to floats."""

    @wraps(function)
    def flattened(*arguments: Any) -> tuple[float, ...]:
        return tuple(float(np.ravel(x)[0]) for row in function(*arguments) for x in row)

    return flattened


def _varies(parameter: Parameter, value: float) -> bool:
    """Whether a parameter may be smaller and larger by a difference step."""
    h = DIFFERENCE_REL_STEP * (abs(value) or 1.0)
    try:
        return bool(parameter.check(value - h) < parameter.check(value + h))
    except ParameterError:
        return False
