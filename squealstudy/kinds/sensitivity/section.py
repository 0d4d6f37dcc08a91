"""The [sensitivity] section of a study file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, Strict

from squealstudy.mechanics.defaults import FINITE_CHANGE, MAX_FINITE_CHANGE
from squealstudy.study.section import Section
from squealstudy.study.sections import StudyDefinition
from squealstudy.wording import shown

UNSTABLE = "unstable"
MOST_MODES = 1000
EXPECTED_MODES = (
    'expected "unstable", a number of modes (the fastest growing), or a list of frequencies in Hz'
)


def _modes(value: object) -> object:
    """The key `modes`: "unstable", a number or frequencies; ValueError for others."""
    if value == UNSTABLE:
        return value
    if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= MOST_MODES:
        return value
    if isinstance(value, list | tuple) and value and all(_is_positive(v) for v in value):
        return tuple(float(v) for v in value)
    raise ValueError(f"{EXPECTED_MODES}, got {shown(value)}")


def _is_positive(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value > 0


def _names(names: tuple[str, ...]) -> tuple[str, ...]:
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"'{name}' is listed twice")
    return names


class SensitivitySection(Section):
    """Modes and parameters of the derivatives, and the finite change beside each."""

    modes: Annotated[
        Literal["unstable"] | int | Annotated[tuple[float, ...], Strict(False)],
        BeforeValidator(_modes),
    ] = Field(
        default="unstable",
        description="'unstable' (all unstable modes of the band), a number of modes by growth "
        "rate, or a list of frequencies in Hz, each standing for the nearest mode",
    )
    parameters: Annotated[tuple[str, ...], Strict(False), AfterValidator(_names)] = Field(
        default=(),
        description="parameters of the model, or <component>.modes[7].frequency_scale, "
        "<component>.modes[*].damping_ratio for every elastic mode; by default friction, pressure, "
        "contact.lambda, sliding_speed, and frequencies and damping of all component modes",
    )
    change: float = Field(
        default=FINITE_CHANGE,
        gt=0,
        le=MAX_FINITE_CHANGE,
        description="finite change that each derivative is held against, relative to the value; of "
        "damping ratios absolute",
    )


class SensitivityDefinition(StudyDefinition):
    """A whole file of a study of sensitivities."""

    sensitivity: SensitivitySection = Field(
        default=SensitivitySection(),
        description="which derivatives are computed (kind = 'sensitivity' only)",
    )


DEFINITION = SensitivityDefinition
