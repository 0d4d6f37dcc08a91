"""Types of the facts that work-precision studies write to a manifest; a read manifest must fit."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from squealstudy.engine.fact_types import Count, FactGroup, Name, Positive


class WorkPrecisionFacts(FactGroup):
    """Facts of work-precision studies, beside those of every kind."""

    quantities: Annotated[list[Name], Field(min_length=1)]
    tolerance: Positive
    over: Count
    reference: Name | list[Name]  # a name; of a run that is not finished nothing


FACTS = WorkPrecisionFacts
