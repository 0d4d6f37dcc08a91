"""Sections of the file of a method-stability study, which maps where a method fails."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, Strict, model_validator

from squealstudy.kinds.methods import MethodsStudySection
from squealstudy.study.section import FloatList, NumberTable, Section


class KnobSection(Section):
    """Section [[knob]], one axis of a stability map: a list of values, or a range."""

    name: str = Field(description="a knob of the case")
    values: FloatList = Field(default=(), description="its values, SI units")
    start: float | None = Field(default=None, description="first value of a range")
    stop: float | None = Field(default=None, description="last value of a range")
    num: int = Field(default=21, ge=2, le=1000, description="number of values of a range")
    scale: Literal["linear", "log"] = Field(default="linear", description="spacing of a range")

    @model_validator(mode="after")
    def _values_or_range(self) -> Self:
        """Raise ValueError unless there are values or a range that can be spaced."""
        if bool(self.values) == (self.start is not None and self.stop is not None):
            raise ValueError("expected either values, or start and stop")
        if self.start is not None and self.stop is not None:
            if self.start >= self.stop:
                raise ValueError(f"expected start < stop, got {self.start:g} and {self.stop:g}")
            if self.scale == "log" and self.start <= 0:
                raise ValueError(f"a log scale needs a start above 0, got {self.start:g}")
        return self

    def axis(self) -> np.ndarray:
        """Values of the knob along the axis (n,)."""
        if self.start is None or self.stop is None:
            return np.array(self.values, dtype=float)
        spaced = np.geomspace if self.scale == "log" else np.linspace
        return np.asarray(spaced(self.start, self.stop, self.num), dtype=float)


class MethodStabilitySection(Section):
    """Section [method_stability]: the method, and the settings of its case that are not swept."""

    case: str = Field(description="method whose limits are mapped")
    set: NumberTable = Field(
        default_factory=dict, description="values of knobs that are not swept, in place of defaults"
    )


class MethodStabilityDefinition(Section):
    """A whole file of kind method_stability."""

    study: MethodsStudySection = Field(description="name and kind of the study")
    method_stability: MethodStabilitySection = Field(description="the method and its settings")
    knob: Annotated[tuple[KnobSection, ...], Strict(False)] = Field(
        default=(), description="the two axes of the map"
    )


DEFINITION = MethodStabilityDefinition
