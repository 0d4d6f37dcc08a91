"""Facts of a manifest of sensitivities: what they must be, whoever wrote them."""

from __future__ import annotations

from squealstudy.engine.fact_types import Count, Finite, Text, Told


class Asked(Told):
    """Of which modes derivatives are."""

    modes: Text | Count | list[Finite]


class SensitivityFacts(Told):
    """Beside those of every kind."""

    sensitivity: Asked | None = None


FACTS = SensitivityFacts
