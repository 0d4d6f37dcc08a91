"""Types of the facts that sensitivity studies write to a manifest; a read manifest must fit."""

from __future__ import annotations

from squealstudy.engine.fact_types import Count, FactGroup, Finite, Text


class ParameterFacts(FactGroup):
    """Modes that the derivatives belong to."""

    modes: Text | Count | list[Finite]


class SensitivityFacts(FactGroup):
    """Facts of sensitivity studies, beside those of every kind."""

    sensitivity: ParameterFacts | None = None


FACTS = SensitivityFacts
