"""The [fidelity] section of a study file."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import BeforeValidator, Field

from squealstudy.study.section import Section

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}
DURATION = re.compile(r"\s*([0-9.]+)\s*(s|min|h)\s*")


def _seconds(value: object) -> object:
    """``"5 min"`` in seconds."""
    if not isinstance(value, str):
        return value
    found = DURATION.fullmatch(value)
    if found is None or found[1].count(".") > 1 or found[1] == ".":
        raise ValueError(f"expected a time like '90 s', '5 min' or '2 h', got '{value}'")
    return float(found[1]) * SECONDS[found[2]]


class FidelitySection(Section):
    """How accurate results must be: the engine chooses the settings that the file leaves out."""

    tolerance: float = Field(
        gt=0,
        le=0.5,
        description="largest error: of complex modes relative in frequency and absolute in damping "
        "ratio of light modes; in time relative in growth rate, level, mean torque and line",
    )
    budget: Annotated[float, BeforeValidator(_seconds)] | None = Field(
        default=None,
        gt=0,
        description="longest run, '90 s', '5 min' or '2 h': where the tolerance would take longer, "
        "the settings of least error within it",
    )
    pilots: int = Field(
        default=2, ge=1, le=16, description="design points on which settings are tried"
    )
    audit: int = Field(
        default=2,
        ge=0,
        le=1000,
        description="design points, chosen at random, solved once more by better settings at the "
        "end; where they miss the tolerance the study is run again with better ones",
    )
