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
        Of the processor for a design point, without what several share: work of others on the
        machine is not counted.
    setup_seconds : float
        What they share: basis, training.
    reduction_seconds : float
        Of the structures, when they were made.
    memory_mb : float
        Largest resident size while it ran, above that before.
    iterations : float
        Evaluations of the contact forces a step; NaN without steps.
    n_coordinates : int
    findings : mapping of str -> mapping
        By measured point: ``status`` and what was found.
    onset_seconds : float
        An onset: design points of its line, modes followed along it, root finding; NaN where no
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
        By number of a measured point, positions of the points of the line on which its onset is
        sought.
    integrator : Integrator or None
        In place of the study's own.
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
        What errors can be judged by.
    judged : tuple of str
        By which they are where nobody says.
    measure : callable
        (plan, positions of the measured points, Asked) -> Measurement.
    comparisons : tuple of callable
        (finding, true finding) -> errors, and modes missed and spurious.
    finding : callable
        What `measure` would have found, of a row of a finished study.
    """

    quantities: tuple[str, ...]
    judged: tuple[str, ...]
    measure: Callable[..., Measurement]
    comparisons: tuple[Callable[..., Any], ...]
    finding: Callable[[dict[str, Any]], dict[str, Any]]
