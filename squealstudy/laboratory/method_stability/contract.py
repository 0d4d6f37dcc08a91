"""What the cases of a method-stability study share: knobs, cells, outcome classes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from squealstudy.errors import ParameterError

CONVERGED, SLOW, RECOVERED, WRONG, FAILED = "converged", "slow", "recovered", "wrong", "failed"
OUTCOMES = (CONVERGED, SLOW, RECOVERED, WRONG, FAILED)


@dataclass(frozen=True)
class Knob:
    """A number that a study sweeps.

    Attributes
    ----------
    name, unit : str
    default, low, high : float
        Its value where it is not swept, and the bounds of what it may be.
    log : bool
        Meant for a logarithmic axis.
    description : str
    """

    name: str
    unit: str
    default: float
    low: float
    high: float
    log: bool
    description: str


@dataclass(frozen=True)
class Cell:
    """What a method did at one setting of the knobs.

    Attributes
    ----------
    outcome : str
        ``converged``, ``slow``, ``recovered``, ``wrong`` (converged to a wrong answer) or
        ``failed`` (said so).
    by : str
        What recovered it, or how it said so; empty otherwise.
    flagged : bool
        A status or an error estimate of the product told of what went wrong.
    predicted : float
        Below 1 the method is predicted to work.
    measured : float
        The measured number beside it.
    error : float
        Relative error of the answer against a reference, NaN where there is none.
    cost : float
        Iterations or evaluations.
    """

    outcome: str
    by: str
    flagged: bool
    predicted: float
    measured: float
    error: float
    cost: float


class Case(Protocol):
    """One method on its minimal model."""

    @property
    def name(self) -> str:
        """Key in `CASES`."""
        ...

    @property
    def title(self) -> str:
        """One line for tables and pictures."""
        ...

    @property
    def boundary(self) -> str:
        """The predicted boundary in words."""
        ...

    @property
    def knobs(self) -> Mapping[str, Knob]:
        """By name."""
        ...

    def evaluate(self, values: Mapping[str, float]) -> Cell:
        """One cell; knobs that are not named keep their defaults.

        Raises
        ------
        ParameterError
            A knob that the case does not have, or a value outside its bounds. Never for a
            numerical failure.
        """
        ...


def named(*knobs: Knob) -> dict[str, Knob]:
    """Knobs by name."""
    return {k.name: k for k in knobs}


def checked(knobs: Mapping[str, Knob], values: Mapping[str, float]) -> dict[str, float]:
    """Values of all knobs; ParameterError for unknown names and values outside the bounds."""
    for name, value in values.items():
        if name not in knobs:
            raise ParameterError(name, f"is none of {', '.join(knobs)}")
        knob = knobs[name]
        if not (np.isfinite(value) and knob.low <= value <= knob.high):
            raise ParameterError(
                name, f"must be from {knob.low:g} to {knob.high:g} {knob.unit}, got {value:g}"
            )
    return {name: float(values.get(name, knob.default)) for name, knob in knobs.items()}
