"""Facts of a manifest of work and precision: what they must be, whoever wrote them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from squealstudy.engine.fact_types import Count, FactGroup, Name, Positive


class WorkPrecisionFacts(FactGroup):
    """Beside those of every kind."""

    quantities: Annotated[list[Name], Field(min_length=1)]
    tolerance: Positive
    over: Count
    reference: Name | list[Name]  # a name; of a run that is not finished nothing


FACTS = WorkPrecisionFacts
