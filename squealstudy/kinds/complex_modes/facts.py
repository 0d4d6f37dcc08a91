"""Types of the facts that complex-mode studies write to a manifest; a read manifest must fit."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from squealstudy.engine.fact_types import Count, FactGroup, Finite, Name, Range, Text

MOST_LEVELS = 16  # how often a cell of a boundary design may be halved
Root = Annotated[list[Finite], Field(min_length=2, max_length=2)]


class LeftOver(FactGroup):
    """Design points that a rung left to the exact method."""

    points: Count
    first: Text


class Method(FactGroup):
    """Which rungs served the points."""

    chosen: Name
    reason: Text
    tolerance: Finite
    points: dict[str, Count]
    left_over: LeftOver | None = None


class Audit(FactGroup):
    """Points drawn at random, solved at full order."""

    modes: Count
    points: Count = 0
    largest_true_error: float = 0.0
    largest_estimate: float = 0.0
    missed_modes: Count = 0


class Errors(FactGroup):
    """Largest estimated errors."""

    largest_rung: float | None
    reduced: bool
    largest_reduction: float | None = None
    reduction_sample_points: Count = 0
    reduction_widened: float = 1.0
    unknown_rung: Count = 0


class Gyroscopic(FactGroup):
    """Effect of gyroscopic terms on lightly damped modes, in results of earlier versions."""

    growth: Finite
    frequency: Finite
    decided: Count
    factor: Finite


class Turning(FactGroup):
    """Decisions that the left-out gyroscopic terms would change."""

    looked: Count
    decided_points: Count
    decided_growth: Finite


class Check(FactGroup):
    """A design point at full order."""

    point_id: Name
    status: Name
    message: Text | None = None
    frequency_error: float | None = None
    damping_error: float | None = None
    missed_modes: Count | None = None
    full_order_modes: Count | None = None
    gyroscopic: Gyroscopic | None = None
    roots: list[Root] = Field(default_factory=list)
    root_errors: list[float] = Field(default_factory=list)

    @model_validator(mode="after")
    def _belong_together(self) -> Check:
        """Raise ValueError for fields of a check that contradict each other."""
        if self.status != "ok" and self.message is None:
            raise ValueError("a check that failed without a message")
        if self.status == "ok" and None in (self.missed_modes, self.full_order_modes):
            raise ValueError("a check without its numbers of modes")
        if (self.frequency_error is None) != (self.damping_error is None):
            raise ValueError("one error without the other")
        if "frequency_error" in self.model_fields_set and self.frequency_error is None:
            raise ValueError("an error that is null")
        return self


class Side(FactGroup):
    """The fastest growing mode below or above the band, and how many grow at its point."""

    count: Count
    frequency_hz: float
    growth_rate: float
    at: dict[str, Finite]


class Diverging(FactGroup):
    """Points at which a real root grows, in the band or outside, and where they lie."""

    points: Count
    ranges: dict[str, Annotated[list[Finite], Field(min_length=2, max_length=2)]]


class OutsideBand(FactGroup):
    """Modes that grow outside the band, and the range that was searched."""

    looked: Count
    reach_hz: Finite | None
    below: Side | None
    above: Side | None
    diverging: Diverging | None = None


class Refined(FactGroup):
    """How many onsets or steps of tracks the refinement left unrefined."""

    left: Count = 0


class Boundary(FactGroup):
    """The full grid of a boundary design."""

    axes: dict[str, Annotated[list[Finite], Field(min_length=2)]]
    levels: Annotated[int, Field(ge=0, le=MOST_LEVELS)]
    points_solved: Count
    full_grid_points: Annotated[int, Field(ge=1, le=10**8)]


class ComplexModesFacts(FactGroup):
    """Facts of complex-mode studies, beside those of every kind."""

    method: Method | None = None
    audit: Audit | None = None
    errors: Errors | None = None
    reference: list[Check] = Field(default_factory=list)
    outside_band: OutsideBand | None = None
    turning: Turning | None = None
    tracking: Refined = Refined()
    onsets: Refined = Refined()
    boundary: Boundary | None = None
    band_hz: Range | None = None
    parameters: list[Name] = Field(default_factory=list)

    @model_validator(mode="after")
    def _belong_together(self) -> ComplexModesFacts:
        """Raise ValueError for fields of a manifest that contradict each other."""
        if self.outside_band is not None and self.band_hz is None:
            raise ValueError("'outside_band' without 'band_hz'")
        if self.errors is not None and self.method is None:
            raise ValueError("'errors' without 'method'")
        if self.boundary is not None:
            sizes = [len(values) for values in self.boundary.axes.values()]
            if math.prod(sizes) != self.boundary.full_grid_points:
                raise ValueError("'boundary' has a grid of another size than it says")
            if not set(self.boundary.axes) <= set(self.parameters):
                raise ValueError("'boundary' has axes that are no parameters")
        return self


FACTS = ComplexModesFacts
