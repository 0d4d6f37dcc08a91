"""Facts of a manifest of limit cycles: what they must be, whoever wrote them."""

from __future__ import annotations

from squealstudy.engine.fact_types import FactGroup


class LimitCyclesFacts(FactGroup):
    """Beside those of every kind."""

    limit_cycles: FactGroup | None = None


FACTS = LimitCyclesFacts
