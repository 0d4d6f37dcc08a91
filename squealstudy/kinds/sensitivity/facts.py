"""Facts of a manifest of sensitivities: what they must be, whoever wrote them."""

from __future__ import annotations

from squealstudy.engine.fact_types import Count, FactGroup, Finite, Text


class ParameterFacts(FactGroup):
    """Modes that the derivatives belong to."""

    modes: Text | Count | list[Finite]


class SensitivityFacts(FactGroup):
    """Beside those of every kind."""

    sensitivity: ParameterFacts | None = None


FACTS = SensitivityFacts
