"""Types of the facts in a manifest of runs in time, by which a manifest that is read is checked."""

from __future__ import annotations

from pydantic import Field

from squealstudy.engine.fact_types import Count, FactGroup, Finite, Name, Text


class ChangeAtDouble(FactGroup):
    """Relative change of a quantity at twice the slope of friction; part of it may be chance."""

    error: float
    chance: float


class Pilot(FactGroup):
    """The run of one design point with twice the slope of friction at zero sliding."""

    status: Name
    message: Text
    errors: dict[str, ChangeAtDouble] = Field(default_factory=dict)


class Regularisation(FactGroup):
    """The regularisation speed, from which slopes of friction at zero sliding follow.

    `automatic` counts the design points whose speed is chosen as `share` of the slowest sliding
    speed.
    """

    speed: Finite
    speed_highest: Finite
    automatic: Count
    share: Finite
    slowest_sliding_speed: Finite
    pilot: Pilot | None = None


class SimulatedTime(FactGroup):
    """Simulated time, how much of it early stops saved, and how many runs settled or decayed."""

    saved_s: Finite
    asked_s: Finite
    settled: Count
    decayed: Count


class TransientFacts(FactGroup):
    """Facts of runs in time, beside those of every kind."""

    regularisation: Regularisation | None = None
    simulated_time: SimulatedTime | None = None


FACTS = TransientFacts
