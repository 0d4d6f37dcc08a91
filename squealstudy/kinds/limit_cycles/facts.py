"""Facts of a manifest of limit cycles: what they must be, whoever wrote them."""

from __future__ import annotations

from squealstudy.engine.fact_types import Told


class LimitCyclesFacts(Told):
    """Beside those of every kind."""

    limit_cycles: Told | None = None


FACTS = LimitCyclesFacts
