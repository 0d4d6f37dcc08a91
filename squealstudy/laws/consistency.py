"""A function of a law from outside the package, tried at a point before the law is registered.

A slope that contradicts its law enters every eigenvalue, and a full-order check shares it.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from squealstudy.errors import ModelError

STEP = 1e-5  # of differences, relative
AGREED = 1e-3  # relative error of differences at which a slope fits
NOISE = 1e-9  # of a function over its argument: smaller slopes are round-off


class Tried:
    """A function of a law, whose results are looked at.

    Parameters
    ----------
    law : str
        Its name.
    function : callable
    names : sequence of str
        Of its arguments.
    results : sequence of str
        Of what it returns.

    Raises
    ------
    ModelError
        A function that does not take as many arguments; by a call, one that fails or returns
        something else than as many finite numbers.
    """

    def __init__(
        self, law: str, function: Callable[..., Any], names: Sequence[str], results: Sequence[str]
    ) -> None:
        self._law, self._function, self._names, self._results = law, function, names, results
        try:
            inspect.signature(function).bind(*names)
        except TypeError:
            raise self.error(f"expected to take ({', '.join(names)})") from None

    def error(self, text: str) -> ModelError:
        """What is wrong, with file, function and law."""
        path = Path(inspect.getfile(self._function)).name
        return ModelError(f"{path}: {self._function.__name__} of law '{self._law}': {text}")

    def __call__(self, *arguments: float) -> tuple[float, ...]:
        """Its results as finite floats."""
        given = ", ".join(f"{n} = {a:g}" for n, a in zip(self._names, arguments, strict=True))
        try:
            found = self._function(*arguments)
            values = tuple(map(float, found if isinstance(found, tuple | list) else (found,)))
        except Exception as error:
            raise self.error(f"{type(error).__name__}: {error}, with {given}") from error
        if len(values) != len(self._results) or not all(map(math.isfinite, values)):
            raise self.error(
                f"expected {', '.join(self._results)} as finite numbers, got {found!r} with {given}"
            )
        return values

    def expect_slope(self, what: str, slope: float, arguments: Sequence[float], k: int) -> None:
        """Compare a slope by argument k with differences of the first result to both sides."""
        x = arguments[k]
        h = STEP * abs(x)
        low, middle, high = (
            self(*arguments[:k], at, *arguments[k + 1 :])[0] for at in (x - h, x, x + h)
        )
        differences = (high - low) / (2 * h), (high - middle) / h, (middle - low) / h  # a kink
        noise = NOISE * abs(middle / x)
        if any(abs(slope - d) <= AGREED * max(abs(slope), abs(d)) + noise for d in differences):
            return
        raise self.error(f"{what} is {slope:g}, differences give {differences[0]:g}")
