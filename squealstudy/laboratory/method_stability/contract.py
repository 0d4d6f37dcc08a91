"""Method-stability cases: which there are, and what they share: knobs, cells, outcome classes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pkgutil import iter_modules

import numpy as np

from squealstudy.errors import ParameterError

CONVERGED, SLOW, RECOVERED, WRONG, FAILED = "converged", "slow", "recovered", "wrong", "failed"
OUTCOMES = (CONVERGED, SLOW, RECOVERED, WRONG, FAILED)


@dataclass(frozen=True)
class Knob:
    """A number that a study sweeps.

    Attributes
    ----------
    name, description : str
    default, low, high : float
        Its value where it is not swept, and the bounds of what it may be.
    unit : str
        Empty where it has none.
    """

    name: str
    description: str
    default: float
    low: float
    high: float
    unit: str = ""


@dataclass(frozen=True, kw_only=True)
class CaseResult:
    """Result of a method at one setting of the knobs.

    Attributes
    ----------
    outcome : str
        ``converged``, ``slow``, ``recovered``, ``wrong`` (converged to a wrong answer) or
        ``failed`` (said so).
    predicted : float
        Below 1 the method is predicted to work.
    measured : float
        The measured number beside it, NaN where there is none.
    error : float
        Relative error of the answer against a reference, NaN where there is none.
    cost : float
        Iterations or evaluations.
    by : str
        What recovered it, or how it said so; empty otherwise.
    flagged : bool
        A status or an error estimate of the product told of what went wrong.
    """

    outcome: str
    predicted: float
    measured: float = np.nan
    error: float = np.nan
    cost: float
    by: str = ""
    flagged: bool = False


def judged(wrong: bool, alarm: str, **numbers: float) -> CaseResult:
    """A cell of a method that converged, to a wrong answer or not.

    `alarm` is what its own estimates said of the answer, empty where they said nothing;
    `numbers` are the other attributes of the cell by name.
    """
    outcome = WRONG if wrong else CONVERGED
    return CaseResult(outcome=outcome, by=alarm, flagged=bool(alarm), **numbers)


def failed(by: str, **numbers: float) -> CaseResult:
    """A cell of a method that said that it failed, and `by` what word."""
    return CaseResult(outcome=FAILED, by=by, flagged=True, **numbers)


def alarm(name: str, value: float, limit: float) -> str:
    """Name and value of an estimate beyond its limit, else nothing."""
    return "" if value <= limit else f"{name} {value:.1e}"


@dataclass(frozen=True)
class StabilityCase:
    """One method on its minimal model.

    Attributes
    ----------
    name : str
        Key in `known_cases`.
    title : str
        One line for tables and pictures.
    boundary : str
        The predicted boundary in words.
    settings : tuple of Knob
        What can be swept.
    measure : callable
        Makes the cell of values of all knobs, by name.
    """

    name: str
    title: str
    boundary: str
    settings: tuple[Knob, ...]
    measure: Callable[[Mapping[str, float]], CaseResult]

    @property
    def knobs(self) -> Mapping[str, Knob]:
        """Parameters of the case, by name."""
        return {knob.name: knob for knob in self.settings}

    def evaluate(self, values: Mapping[str, float]) -> CaseResult:
        """One cell; knobs that are not named keep their defaults.

        Raises
        ------
        ParameterError
            A knob that the case does not have, or a value outside its bounds. Never for a
            numerical failure.
        """
        return self.measure(checked(self.knobs, values))


def checked(knobs: Mapping[str, Knob], values: Mapping[str, float]) -> dict[str, float]:
    """Values of all knobs; ParameterError for unknown names and values outside the bounds."""
    for name, setting in values.items():
        if name not in knobs:
            raise ParameterError(name, f"is none of {', '.join(knobs)}")
        knob = knobs[name]
        if not (np.isfinite(setting) and knob.low <= setting <= knob.high):
            raise ParameterError(
                name, f"must be from {knob.low:g} to {knob.high:g} {knob.unit}, got {setting:g}"
            )
    return {name: float(values.get(name, knob.default)) for name, knob in knobs.items()}


@cache
def known_cases() -> Mapping[str, StabilityCase]:
    """All cases by name: those of the files of this folder."""
    folder = import_module(__package__)
    names = [
        module_info.name for module_info in iter_modules(folder.__path__, f"{folder.__name__}.")
    ]
    values = [member for name in names for member in vars(import_module(name)).values()]
    return {case.name: case for case in values if isinstance(case, StabilityCase)}
