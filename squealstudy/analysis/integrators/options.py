"""Options of an integrator: names, defaults, what is allowed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from squealstudy.errors import ParameterError

Value = float | bool | str


@dataclass(frozen=True)
class Option:
    """One knob of an integrator.

    Parameters
    ----------
    default : float, bool, str
        Its type is that of the values.
    description : str
    low, high : float
        Allowed range of a number, ends included.
    words : tuple of str
        Allowed words of a text.
    """

    default: Value
    description: str
    low: float = -np.inf
    high: float = np.inf
    words: tuple[str, ...] = ()

    @property
    def expected(self) -> str:
        """What a value must be, in words."""
        if isinstance(self.default, bool):
            return "true or false"
        if isinstance(self.default, str):
            return f"one of {', '.join(self.words)}"
        whole = "a whole number" if isinstance(self.default, int) else "a number"
        return f"{whole} in [{self.low:g}, {self.high:g}]"

    def takes(self, value: object) -> bool:
        """Whether `value` is allowed."""
        if isinstance(self.default, bool):
            return isinstance(value, (bool, np.bool_))
        if isinstance(self.default, str):
            return value in self.words
        if isinstance(value, (bool, np.bool_)) or not isinstance(
            value, (int, float, np.integer, np.floating)
        ):
            return False
        whole = not isinstance(self.default, int) or float(value).is_integer()
        return bool(whole and self.low <= value <= self.high)


@dataclass(frozen=True)
class IntegratorEntry:
    """What a chart and an error message say about an integrator.

    Parameters
    ----------
    label, description : str
    options : mapping of name -> Option
    """

    label: str
    description: str
    options: Mapping[str, Option]

    def values(self, given: Mapping[str, Value]) -> dict[str, Value]:
        """All options, given or by default.

        Raises
        ------
        ParameterError
            A name that is not among them, or a value that is not allowed.
        """
        for name, value in given.items():
            if name not in self.options:
                known = ", ".join(self.options) or "nothing"
                raise ParameterError(name, f"{self.label} has no such option; it takes {known}")
            if not self.options[name].takes(value):
                expected = self.options[name].expected
                raise ParameterError(name, f"must be {expected}, got {value!r}")
        return {name: given.get(name, x.default) for name, x in self.options.items()}
