"""Types of the facts in a manifest of method stability; a manifest that is read must fit."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from squealstudy.engine.fact_types import Count, FactGroup, Finite, Name, Text


class MethodStabilityFacts(FactGroup):
    """Facts beside those of every kind; those from `agreement` on are of a finished run."""

    title: Text
    boundary: Text
    knobs: Annotated[list[Name], Field(min_length=2, max_length=2)]
    words: dict[str, Text]
    values: dict[str, Finite] = Field(default_factory=dict)
    agreement: Finite | None = None
    judged: Count = 0
    unflagged_wrong: Count = 0
    unpredicted_failures: Count = 0
    counts: dict[str, Count] = Field(default_factory=dict)


FACTS = MethodStabilityFacts
