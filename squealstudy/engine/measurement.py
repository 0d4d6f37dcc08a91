"""The outcome of a measurement."""

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
        CPU time of a design point, without the shared set-up.
    setup_seconds : float
        CPU time of the shared set-up: basis, training.
    reduction_seconds : float
        Time in which the structures were reduced.
    memory_mb : float
        Largest resident size while it ran, above that before.
    iterations : float
        Evaluations of the contact forces a step; NaN without steps.
    n_coordinates : int
    findings : mapping of str -> mapping
        Results by measured point, with a ``status`` each.
    onset_seconds : float
        Time of an onset: design points of its line, following modes, root finding; NaN where no
        onsets were sought.
    line_points : float
        Design points of a line.
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
        """Measured points without a result."""
        return sum(finding["status"] != "ok" for finding in self.findings.values())


@dataclass(frozen=True)
class MeasurementRequest:
    """Quantities that are measured beside the design points themselves.

    Attributes
    ----------
    lines : mapping of int -> sequence of int
        By number of a measured point: positions of the points on the line of its onset.
    integrator : Integrator or None
        Replaces the study's integrator.
    starts : int
        Runs in time of each point, from perturbations of other sizes.
    """

    lines: Mapping[int, Sequence[int]] = field(default_factory=dict)
    integrator: Integrator | None = None
    starts: int = 1


@dataclass(frozen=True)
class Measuring:
    """How the methods of a kind of study are timed, and what their errors are.

    Attributes
    ----------
    quantities : tuple of str
        Quantities with errors.
    judged : tuple of str
        Quantities by which errors are judged by default.
    measure : callable
        (plan, positions of the measured points, MeasurementRequest) -> Measurement.
    comparisons : tuple of callable
        (finding, true finding) -> errors, and modes missed and spurious.
    finding : callable
        Makes a finding, as `measure` does, of a row of a finished study.
    """

    quantities: tuple[str, ...]
    judged: tuple[str, ...]
    measure: Callable[..., Measurement]
    comparisons: tuple[Callable[..., Any], ...]
    finding: Callable[[dict[str, Any]], dict[str, Any]]
