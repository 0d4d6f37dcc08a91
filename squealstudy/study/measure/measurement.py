"""The outcome of a measurement."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Measurement:
    """What one method did at the measured points, in one round.

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

    seconds: float
    setup_seconds: float
    reduction_seconds: float
    memory_mb: float
    iterations: float
    n_coordinates: int
    findings: Mapping[str, Mapping[str, Any]]
    onset_seconds: float = math.nan
    line_points: float = math.nan

    @property
    def n_failed(self) -> int:
        """Measured points without a result."""
        return sum(found["status"] != "ok" for found in self.findings.values())
