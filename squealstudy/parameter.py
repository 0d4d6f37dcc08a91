"""A named number of a model with unit, default and bounds, which checks its values."""

from __future__ import annotations

import math
from dataclasses import dataclass

from squealstudy.errors import ParameterError


@dataclass(frozen=True)
class Parameter:
    """One named number of a model, in SI units (angles in degrees).

    Attributes
    ----------
    name : str
        Its name in study files.
    default : float
        Default value [unit].
    unit : str
        Unit; empty for a pure number.
    description : str
        Its meaning, for tables of parameters.
    minimum, maximum : float
        Least and largest allowed value [unit].
    positive : bool
        Whether the value must be greater than zero.
    above, below : float
        Bounds [unit] that the value must not reach.
    nonzero : bool
        Whether the value is a direction: either sign is allowed but not zero, and a sweep must not
        pass through zero.
    usual : (low, high)
        Usual values [unit]. Others are allowed, but are likely to be in another unit.
    structural : bool
        Whether a change alters masses or stiffnesses, so that it costs a new assembly and
        reduction.
    bare : str
        Unit of a number that a study file states without a unit; empty for `unit`. Temperatures are
        in degC here and in results, but a number without a unit is in kelvin, as in SI.
    difference : bool
        Whether it is a difference of temperatures: one degC of it is one kelvin.
    """

    name: str
    default: float
    unit: str
    description: str
    minimum: float = -math.inf
    maximum: float = math.inf
    positive: bool = False
    structural: bool = False
    above: float = -math.inf
    below: float = math.inf
    usual: tuple[float, float] = (-math.inf, math.inf)
    nonzero: bool = False
    bare: str = ""
    difference: bool = False

    def check(self, value: float) -> float:
        """`value` as a float; ParameterError if it is not a finite number within the bounds."""
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
        ):
            raise ParameterError(self.name, f"expected a finite number, got {value!r}")
        if self.positive and value <= 0:
            raise ParameterError(
                self.name, f"expected a value above 0{self._unit()}, got {value:g}"
            )
        if self.nonzero and value == 0:
            raise ParameterError(self.name, f"expected a value other than 0{self._unit()}")
        if value < self.minimum:
            raise ParameterError(
                self.name, f"expected at least {self.minimum:g}{self._unit()}, got {value:g}"
            )
        if value > self.maximum:
            raise ParameterError(
                self.name, f"expected at most {self.maximum:g}{self._unit()}, got {value:g}"
            )
        for bound, word, is_within in (
            (self.above, "above", value > self.above),
            (self.below, "below", value < self.below),
        ):
            if not is_within:
                raise ParameterError(
                    self.name, f"expected a value {word} {bound:g}{self._unit()}, got {value:g}"
                )
        return float(value)

    def check_range(self, low: float, high: float) -> None:
        """Raise ParameterError if a sweep from low to high passes through zero but must not."""
        if self.nonzero and low < 0 < high:
            raise ParameterError(
                self.name,
                f"goes through 0 from {low:g} to {high:g}{self._unit()}: a study has one direction",
            )

    def doubt(self, value: float) -> str:
        """A warning about a value that is far from usual ones; empty for others."""
        low, high = self.usual
        if low <= value <= high:
            return ""
        unit = self._unit()
        return f"{self.name} = {value:g}{unit} is far from the usual {low:g} to {high:g}{unit}"

    def _unit(self) -> str:
        return f" {self.unit}" if self.unit else ""
