"""The cases of method stability, and what they share: knobs, results, classes of outcome."""

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
        Its name and meaning.
    default, low, high : float
        Value where it is not swept, and bounds of its values [unit].
    unit : str
        Unit; empty for a pure number.
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
        A number below 1 where the method is predicted to work; NaN without a prediction.
    measured : float
        Measured number that each case defines; NaN where there is none.
    error : float
        Error of the result against a reference, as each case defines it; NaN where there is none.
    cost : float
        Number of iterations, evaluations or solved points, as each case defines it.
    by : str
        The help that recovered the result, or the warning that it had; empty otherwise.
    flagged : bool
        Whether a status or an error estimate warned of the result.
    """

    outcome: str
    predicted: float
    measured: float = np.nan
    error: float = np.nan
    cost: float
    by: str = ""
    flagged: bool = False


def judged(wrong: bool, alarm: str, **numbers: float) -> CaseResult:
    """Result of a method that converged, perhaps to a wrong result.

    `alarm` is the warning of its own error estimates, empty without one; `numbers` are other
    attributes of the result by name.
    """
    outcome = WRONG if wrong else CONVERGED
    return CaseResult(outcome=outcome, by=alarm, flagged=bool(alarm), **numbers)


def failed(by: str, **numbers: float) -> CaseResult:
    """Result of a method that said that it failed; `by` is the word with which it said so."""
    return CaseResult(outcome=FAILED, by=by, flagged=True, **numbers)


def alarm(name: str, value: float, limit: float) -> str:
    """Name and value of an estimate that is above its limit; else empty."""
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
        Returns the result for a mapping of all knobs' values.
    """

    name: str
    title: str
    boundary: str
    settings: tuple[Knob, ...]
    measure: Callable[[Mapping[str, float]], CaseResult]

    @property
    def knobs(self) -> Mapping[str, Knob]:
        """Knobs of the case, by name."""
        return {knob.name: knob for knob in self.settings}

    def evaluate(self, values: Mapping[str, float]) -> CaseResult:
        """The result for some values; knobs that are not named keep their defaults.

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
