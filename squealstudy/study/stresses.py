"""Stresses of a model file that stiffen it: at which operating point, and how far they are told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.laws import contact_law
from squealstudy.models.components.dimensions import STRESS
from squealstudy.models.components.model_file import ModelFile
from squealstudy.models.operating import (
    FRICTION,
    PRESSURE,
    SLIDING_SPEED,
    OperatingPoint,
    contact_parameters,
)
from squealstudy.models.parameter import Assumption, Declared
from squealstudy.parameter import Parameter

NEAR = 0.2  # pressures (relative) and frictions up to which stresses are told of


def stressed_point(file: ModelFile) -> OperatingPoint | None:
    """The operating point of ``[stress_stiffening]``, SI units, sliding forward."""
    table = file.stress_stiffening
    if table is None:
        return None
    pressure = table.pressure * STRESS.factor(file.units)
    return OperatingPoint(table.friction, pressure, 1.0, contact_law())


def law_defaults(declared: Declared) -> dict[str, float]:
    """Defaults of the parameters of contact laws, those of the file first."""
    of_file = {p.name: p.default for p in declared if isinstance(p, Parameter)}
    return {p.name: of_file.get(p.name, p.default) for p in contact_parameters()}


@dataclass(frozen=True)
class _Off:
    """How far design points are from where stresses were taken; goes to worker processes."""

    at: OperatingPoint
    of_pressure: bool

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """Relative distance in pressure, or distance in friction, negative in reverse."""
        if self.of_pressure:
            return abs(values[PRESSURE.name] / self.at.brake_pressure - 1)
        way = np.copysign(1.0, values[SLIDING_SPEED.name])
        return abs(way * values[FRICTION.name] - self.at.friction)


def stress_assumptions(at: OperatingPoint | None) -> tuple[Assumption, ...]:
    """Up to where stresses that were taken at one operating point are told of others."""
    if at is None:
        return ()
    pressure = f"stresses are those of {at.brake_pressure:g} Pa: pressures differ by at most 20 %"
    friction = f"stresses are those of friction {at.friction:g}: it differs by at most {NEAR:g}"
    return (
        Assumption(pressure, _Off(at, of_pressure=True), NEAR),
        Assumption(f"{friction} (reverse: -friction)", _Off(at, of_pressure=False), NEAR),
    )
