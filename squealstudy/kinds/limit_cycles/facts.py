"""Types of the facts that studies of limit cycles write to a manifest; a read manifest must fit."""

from __future__ import annotations

from squealstudy.engine.fact_types import FactGroup


class LimitCyclesFacts(FactGroup):
    """Facts of studies of limit cycles, beside those of every kind."""

    limit_cycles: FactGroup | None = None


FACTS = LimitCyclesFacts
