"""What a measurement of a method is asked for, and what it returns."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from squealstudy.motion.integrator import Integrator


@dataclass(frozen=True)
class Measurement:
    """Measurement of one method at the measured points, in one round; empty by default.

    Attributes
    ----------
    seconds : float
        CPU time of a design point, s, without the shared set-up.
    setup_seconds : float
        CPU time of the shared set-up (basis, training), s.
    reduction_seconds : float
        Time in which the structures were reduced, s.
    memory_mb : float
        Largest resident memory while it ran, above that before, MB.
    iterations : float
        Evaluations of the contact forces in a step; NaN without steps.
    n_coordinates : int
        Number of coordinates of the model that was solved.
    findings : mapping of str -> mapping
        Results by number of the measured point, each with a ``status``.
    onset_seconds : float
        Time of an onset, s: design points of its line, following modes, root finding; NaN where no
        onsets were sought.
    line_points : float
        Number of design points of a line.
    """

    seconds: float = math.nan
    setup_seconds: float = math.nan
    reduction_seconds: float = math.nan
    memory_mb: float = math.nan
    iterations: float = math.nan
    n_coordinates: int = 0
    findings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    onset_seconds: float = math.nan
    line_points: float = math.nan

    @property
    def n_failed(self) -> int:
        """Number of measured points without a result."""
        return sum(finding["status"] != "ok" for finding in self.findings.values())


@dataclass(frozen=True)
class MeasurementRequest:
    """How design points are measured, and onsets that are measured beside them.

    Attributes
    ----------
    lines : mapping of int -> sequence of int
        By number of a measured point, the rows of the points on the line of its onset.
    integrator : Integrator or None
        Integrator in place of the study's; None: the study's.
    starts : int
        Number of runs in time of each point, from perturbations of different sizes.
    """

    lines: Mapping[int, Sequence[int]] = field(default_factory=dict)
    integrator: Integrator | None = None
    starts: int = 1


@dataclass(frozen=True)
class Measuring:
    """How the methods of a kind of study are timed, and how their errors are found.

    Attributes
    ----------
    quantities : tuple of str
        Names of the quantities that have errors.
    judged : tuple of str
        Names of those by which errors are judged by default.
    measure : callable
        Takes a plan, rows of the measured points and a MeasurementRequest, returns a Measurement.
    comparisons : tuple of callable
        Each takes a finding and the true one, returns errors, and modes missed and spurious.
    finding : callable
        Makes a finding like those of `measure` from a row of a finished study.
    """

    quantities: tuple[str, ...]
    judged: tuple[str, ...]
    measure: Callable[..., Measurement]
    comparisons: tuple[Callable[..., Any], ...]
    finding: Callable[[dict[str, Any]], dict[str, Any]]
