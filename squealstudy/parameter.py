"""A named number: its unit, default and bounds, as study files give it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from squealstudy.errors import ParameterError


@dataclass(frozen=True)
class Parameter:
    """One named number of a model, SI units (angles in degrees).

    Attributes
    ----------
    name : str
        As in study files.
    default : float
        In the unit [unit], as all numbers here.
    unit : str
        Empty for a pure number.
    description : str
    minimum, maximum : float
        Closed bounds [unit]; with `positive` the minimum itself is excluded.
    positive : bool
        The value must be greater than zero.
    above, below : float
        Open bounds [unit].
    nonzero : bool
        Of either sign, a direction: never zero, and a sweep stays on one side of it.
    usual : (low, high)
        Values beyond are allowed, but likely to be in other units.
    structural : bool
        True where a change alters masses or stiffnesses: it costs a new assembly and reduction.
    bare : str
        Unit of a number that a study file gives without one, where that is another: of the
        temperature of tables, in degC here and in results, the kelvin of SI.
    difference : bool
        It is one of two temperatures: a degC of it is a kelvin.
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
        """`value` as a float; ParameterError where it is not a finite number within bounds."""
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
        """ParameterError where a sweep from low to high would pass through zero and must not."""
        if self.nonzero and low < 0 < high:
            raise ParameterError(
                self.name,
                f"goes through 0 from {low:g} to {high:g}{self._unit()}: a study has one direction",
            )

    def doubt(self, value: float) -> str:
        """Warning about a value far from usual ones; empty for others."""
        low, high = self.usual
        if low <= value <= high:
            return ""
        unit = self._unit()
        return f"{self.name} = {value:g}{unit} is far from the usual {low:g} to {high:g}{unit}"

    def _unit(self) -> str:
        return f" {self.unit}" if self.unit else ""
