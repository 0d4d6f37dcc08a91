"""Facts of a manifest of a design study: what they must be, whoever wrote them."""

from __future__ import annotations

from squealstudy.engine.fact_types import Count, FactGroup, Finite, Name, Text


class Change(FactGroup):
    """Change of one variable in the chosen design."""

    parameter: Name


class Verdict(FactGroup):
    """Outcome of the search."""

    verdict: Text
    outcome: Name
    failure: Text
    choice: Text = ""
    change: Text
    changes: list[Change]
    margin: Finite
    probability: Finite | None
    today: Count
    chosen: Count | None
    cost: float | None
    n_unstable: Count | None
    today_damping_ratio: float | None
    min_damping_ratio: float | None
    frequency_hz: float | None
    ranges: dict[str, Finite]
    operating: list[Name]
    n_operating_points: Count
    n_designs: Count
    n_reductions: Count = 0
    n_structures: Count = 0
    rounds: Count
    beside: list[Count]
    today_beside: list[Count]


class DesignStudyFacts(FactGroup):
    """Beside those of every kind; the verdict is that of a finished run."""

    design_study: Verdict | None = None


FACTS = DesignStudyFacts
