"""The file of a work-precision study."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, Strict, model_validator

from squealstudy.kinds.methods import MethodsStudySection
from squealstudy.study.section import Changes, Section

Scalar = bool | int | float | str
OPTION = "option."  # knobs that are options of an integrator
ONSET = "onset"
FREQUENCY_QUANTITIES = (
    "frequency",
    "damping_ratio",
    "unstable_frequency",
    "unstable_damping_ratio",
    "growth_rate",
    ONSET,
)
TIME_QUANTITIES = (
    "growth_rate",
    "torque_mean",
    "torque_rms",
    "dominant_frequency",
    "energy_share",
)


class WorkPrecisionSection(Section):
    """What is solved, how often, and by which errors methods are judged."""

    base: str = Field(
        min_length=1, description="study file, relative to this one, that all methods solve"
    )
    points: int = Field(
        default=3,
        ge=0,
        le=1000,
        description="design points at random in the swept box of the base study, where errors are "
        "measured; 0 for the base study's own points",
    )
    seed: int = Field(default=0, ge=0, le=2**32 - 1, description="seed of these random points")
    repeats: int = Field(
        default=3, ge=1, le=100, description="rounds over all methods, one after the other"
    )
    starts: int = Field(
        default=1,
        ge=1,
        le=20,
        description="runs of each point in time from perturbations of other sizes: bounds of the "
        "levels of irregular cycles",
    )
    quantities: Annotated[tuple[str, ...], Strict(False)] = Field(
        default=(),
        description="what the chart judges; of complex modes "
        + ", ".join(FREQUENCY_QUANTITIES)
        + "; in time "
        + ", ".join(TIME_QUANTITIES)
        + "; onset is that of instability along friction, or the first sweep where friction is "
        "not swept, on lines through the measured points",
    )
    tolerance: float = Field(
        default=1e-2, gt=0, le=1, description="largest error allowed, a line of the chart"
    )
    over: int = Field(
        default=0,
        ge=0,
        le=10**9,
        description="design points that share the set-up in the cost of one; 0 for as many as the "
        "base study has",
    )
    set: Changes = Field(
        default_factory=dict,
        description="keys of the base study with other values, for all methods and the reference",
    )


class ReferenceSection(Section):
    """The [reference] section: settings against which errors are measured."""

    name: str = Field(default="reference", description="its name in tables and pictures")
    set: Changes = Field(
        default_factory=dict, description="keys of the base study with other values"
    )
    integrator: str | None = Field(default=None, description="as in [[method]]")
    options: dict[str, Scalar] = Field(default_factory=dict, description="as in [[method]]")


class MethodSection(Section):
    """One line of the chart: a method over the values of its knob."""

    name: str = Field(min_length=1, max_length=80, description="its name in tables and pictures")
    knob: str = Field(
        default="", description="dotted key of the base study, or option.<name> of an integrator"
    )
    values: Annotated[tuple[Scalar, ...], Strict(False)] = Field(
        default=(), description="values of the knob"
    )
    set: Changes = Field(
        default_factory=dict, description="keys of the base study with other values"
    )
    integrator: str | None = Field(
        default=None,
        description="integrator of a transient base study, those for comparison included",
    )
    options: dict[str, Scalar] = Field(
        default_factory=dict, description="options of that integrator"
    )
    default: bool = Field(
        default=False,
        description="whether a study uses this method by itself; it is compared with the cheapest",
    )

    @model_validator(mode="after")
    def _knob_and_values(self) -> Self:
        """Raise ValueError for a knob without values, values without a knob, or the like."""
        if bool(self.knob) != bool(self.values):
            raise ValueError("knob and values go together: both, or neither for a single point")
        if len(set(map(repr, self.values))) < len(self.values):
            raise ValueError("a value of the knob appears twice")
        if (self.options or self.knob.startswith(OPTION)) and self.integrator is None:
            raise ValueError("options are those of an integrator: name one")
        return self


class WorkPrecisionDefinition(Section):
    """A whole file of kind work_precision."""

    study: MethodsStudySection = Field(description="name and kind of the study")
    work_precision: WorkPrecisionSection = Field(description="what is solved and judged")
    reference: ReferenceSection = Field(
        default=ReferenceSection(), description="what is taken as exact"
    )
    method: Annotated[tuple[MethodSection, ...], Strict(False)] = Field(
        description="lines of the chart"
    )


DEFINITION = WorkPrecisionDefinition
