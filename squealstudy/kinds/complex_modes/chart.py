"""Design points as coordinates in which modes vary smoothly: theta in [-1, 1]^d."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.study.design import DesignPoint
from squealstudy.study.parameters import FREQUENCY_SCALE

Scaling = tuple[Callable[[np.ndarray], np.ndarray], Callable[[np.ndarray], np.ndarray]]
# what the matrices are linear in, or nearly: friction damping goes as 1/speed, modal stiffness as
# the square of a frequency, contact stiffness as a power of pressure
SCALINGS: dict[str, Scaling] = {
    "linear": (lambda x: x, lambda t: t),
    "log": (np.log, np.exp),
    "reciprocal": (np.reciprocal, np.reciprocal),
    "square": (np.square, np.sqrt),
}
LOGARITHMIC = ("pressure", "contact.lambda", "contact.p0", "contact.stiffness")


def scaling_of(name: str, smallest: float) -> str:
    """How a parameter becomes a coordinate."""
    if name == "sliding_speed":
        return "reciprocal"
    if name.endswith(f".{FREQUENCY_SCALE}"):
        return "square"
    return "log" if name in LOGARITHMIC and smallest > 0 else "linear"


@dataclass(frozen=True)
class Chart:
    """The box of a study's design points of one structure.

    Attributes
    ----------
    design : DesignPoint
        Gives all values that do not vary.
    names, scalings : tuple of str
        Parameters that vary, and how each becomes a coordinate.
    low, high : tuple of float
        Ends of the scaled coordinates.
    """

    design: DesignPoint
    names: tuple[str, ...]
    scalings: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]

    @property
    def dimension(self) -> int:
        """Number of parameters that vary."""
        return len(self.names)

    def theta(self, rows: Sequence[Mapping[str, float]]) -> np.ndarray:
        """Coordinates (n, d) of design points given by their values."""
        if not self.names:
            return np.zeros((len(rows), 0))
        low, high = np.array(self.low), np.array(self.high)
        scaled = self._scaled(rows)
        inside: np.ndarray = np.clip(2.0 * (scaled - low) / (high - low) - 1.0, -1.0, 1.0)
        return inside

    def _scaled(self, rows: Sequence[Mapping[str, float]]) -> np.ndarray:
        columns = [
            SCALINGS[scaling][0](np.array([row[name] for row in rows], dtype=float))
            for name, scaling in zip(self.names, self.scalings, strict=True)
        ]
        return np.column_stack(columns)

    def design_at(self, theta: np.ndarray) -> DesignPoint:
        """The design at a point (d,) of the box."""
        values = dict(self.design.values)
        for j, (name, scaling) in enumerate(zip(self.names, self.scalings, strict=True)):
            at = self.low[j] + (theta[j] + 1.0) / 2.0 * (self.high[j] - self.low[j])
            values[name] = float(SCALINGS[scaling][1](np.array(at)))
        return self.design.with_values(values)

    def identity(self) -> list[object]:
        """What a basis made over this box depends on."""
        fixed = {k: v for k, v in self.design.values.items() if k not in self.names}
        return [sorted(fixed.items()), self.names, self.scalings, self.low, self.high]


def chart_of(designs: Sequence[DesignPoint], names: Sequence[str]) -> Chart:
    """The chart of some designs of one structure over the swept parameters that vary in them."""
    varied = [n for n in names if len({d.values[n] for d in designs}) > 1]
    scalings = [scaling_of(n, min(d.values[n] for d in designs)) for n in varied]
    low, high = [], []
    for name, scaling in zip(varied, scalings, strict=True):
        x = SCALINGS[scaling][0](np.array([d.values[name] for d in designs], dtype=float))
        low.append(float(x.min()))
        high.append(float(x.max()))
    return Chart(
        design=designs[0],
        names=tuple(varied),
        scalings=tuple(scalings),
        low=tuple(low),
        high=tuple(high),
    )
