"""What a file of a design study says beside a matrix of operation: variables, scatter, the goal."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, Field, Strict

from squealstudy.kinds.limit_cycles.section import LimitCyclesDefinition
from squealstudy.study.design_sections import QUANTITY, SweepSection
from squealstudy.study.section import Changes, Section


def _bounds(ends: tuple[float, ...]) -> tuple[float, ...]:
    if len(ends) != 2:
        raise ValueError(f"expected two changes from today's value [low, high], got {len(ends)}")
    if not ends[0] <= 0.0 <= ends[1] or ends[0] == ends[1]:
        raise ValueError(
            "expected changes from today's value, low <= 0 <= high and not both 0, got "
            f"[{ends[0]:g}, {ends[1]:g}]"
        )
    return ends


class VariableSection(Section):
    """One parameter that may be changed, how far, and what that costs."""

    parameter: str = Field(
        description="a parameter of the model, or <component>.modes[12-14].frequency_scale, "
        "<component>.modes[3,7].damping_ratio"
    )
    bounds: Annotated[tuple[float, ...], Strict(False), AfterValidator(_bounds)] = Field(
        description='changes from the value in [parameters] that are allowed, ["-3 mm", "+2 mm"]: '
        "both ends as differences, in the unit of the parameter",
        json_schema_extra={"minItems": 2, "maxItems": 2, "items": {"type": list(QUANTITY)}},
    )
    cost: float = Field(
        default=1.0,
        gt=0,
        description="of a change over the whole range between the bounds, either way; costs of all "
        "variables add",
    )


def _once(variants: tuple[VariantSection, ...]) -> tuple[VariantSection, ...]:
    names = [v.name for v in variants]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"expected a name for each variant, '{name}' is given twice")
    return variants


class VariantSection(Section):
    """A whole alternative: today's design is another one, with the same variables."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9_-]+$",
        max_length=100,
        description="of the folder of its results, too: letters, digits, _ and -",
    )
    cost: float = Field(
        default=0.0, ge=0, description="of choosing it; costs of its changes are added"
    )
    description: str = Field(default="", description="free text, copied to its results")
    model: dict[str, Any] = Field(
        default={},
        description="keys of [model] that differ; another name or file stands for the whole table",
    )
    parameters: Changes = Field(
        default={},
        description="keys of [parameters] that differ",
        json_schema_extra={"additionalProperties": {"type": ["number", "string", "object"]}},
    )


class MarginSection(Section):
    """What counts as silent."""

    damping_ratio: float = Field(
        default=0.0,
        ge=-1,
        lt=1,
        description="least damping ratio of every mode of the band at every operating point",
    )
    probability: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="with which the scatter of [[uncertain]] leaves that margin",
    )


class GoalSection(Section):
    """The [goal] of a design study, and how much is spent on it."""

    margin: MarginSection = Field(default=MarginSection(), description="what counts as silent")
    starts: int = Field(
        default=8,
        ge=1,
        le=64,
        description="designs from which the search starts, today's one first",
    )
    scan: int | None = Field(
        default=None,
        ge=0,
        le=4096,
        description="designs over the whole box beside its corners, of which the other starts "
        "are the best; by default 16 a variable, none where a variable costs a reduction; 0 leaves "
        "out the corners too",
    )
    designs: int = Field(
        default=400, ge=1, le=10_000, description="designs evaluated at most, the scan apart"
    )
    cycles: int | None = Field(
        default=None,
        ge=0,
        le=1000,
        description="operating points of least margin at which limit cycles of the chosen design "
        "are looked for; by default 4, none of a brake, where each takes minutes",
    )
    full_order: int = Field(
        default=2,
        ge=0,
        le=1000,
        description="operating points of least margin at which it is solved at full order",
    )
    samples: int | None = Field(
        default=None,
        ge=1,
        le=100_000,
        description="of the scatter; by default as many as show the probability at 95 % confidence "
        "where none misses the margin",
    )
    sampled: int = Field(
        default=4, ge=1, le=1000, description="operating points of least margin that are sampled"
    )
    seed: int = Field(default=0, ge=0, description="of the scan and of the samples")


class DesignStudyDefinition(LimitCyclesDefinition):
    """A whole file of a design study; [limit_cycles] is of the proof."""

    goal: GoalSection = Field(
        default=GoalSection(), description="what counts as silent (kind = 'design' only)"
    )
    variable: Annotated[tuple[VariableSection, ...], Strict(False)] = Field(
        default=(), description="what may change (kind = 'design' only)"
    )
    uncertain: Annotated[tuple[SweepSection, ...], Strict(False)] = Field(
        default=(),
        description="what scatters about the values in [parameters] (kind = 'design' only)",
    )
    variant: Annotated[tuple[VariantSection, ...], Strict(False), AfterValidator(_once)] = Field(
        default=(),
        description="whole alternatives, each searched and proven beside the file's own design "
        "(kind = 'design' only)",
    )


DEFINITION = DesignStudyDefinition
