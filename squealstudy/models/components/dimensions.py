"""Systems of units of model files, and dimensions of the numbers in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.models.units import Unit

# length, mass and time of each system in m, kg, s
SYSTEMS = {"SI": (1.0, 1.0, 1.0), "t-mm-s": (1e-3, 1e3, 1.0), "mm-kg-ms": (1e-3, 1.0, 1e-3)}
# units of lengths, masses and moments of inertia
UNITS = {
    "SI": ("m", "kg", "kg m2"),
    "t-mm-s": ("mm", "t", "t mm2"),
    "mm-kg-ms": ("mm", "kg", "kg mm2"),
}


@dataclass(frozen=True)
class Dimension:
    """A dimension of numbers in model files.

    Attributes
    ----------
    powers : tuple of int
        Of length, mass and time.
    unit : str
        In SI.
    """

    powers: tuple[int, int, int]
    unit: str

    def factor(self, system: str) -> float:
        """SI value of one unit of this dimension in one of `SYSTEMS`."""
        return float(
            SYSTEMS[system][0] ** self.powers[0]
            * SYSTEMS[system][1] ** self.powers[1]
            * SYSTEMS[system][2] ** self.powers[2]
        )


NUMBER = Dimension((0, 0, 0), "")
ANGLE = Dimension((0, 0, 0), "deg")
LENGTH = Dimension((1, 0, 0), "m")
AREA = Dimension((2, 0, 0), "m2")
MASS = Dimension((0, 1, 0), "kg")
COMPLIANCE = Dimension((1, -1, 2), "1/Pa")
STRESS = Dimension((-1, 1, -2), "Pa")
DENSITY = Dimension((-3, 1, 0), "kg/m3")
STIFFNESS = Dimension((0, 1, -2), "N/m")
TORSION = Dimension((2, 1, -2), "N m")
INERTIA = Dimension((2, 1, 0), "kg m2")
BEDDING = Dimension((-2, 1, -2), "N/m3")
DAMPER = Dimension((0, 1, -1), "N s/m")
TIME = Dimension((0, 0, 1), "s")
EXPANSION = Dimension((0, 0, 0), "1/K")
RATE = Dimension((0, 0, -1), "1/s")


def dimension_of_unit(unit: str) -> Dimension:
    """Dimension of a SI unit such as "m/s"; an unknown unit is the same in all systems."""
    try:
        mass, length, time = Unit.named(unit).powers[:3] if unit else (0, 0, 0)
    except KeyError:
        return Dimension((0, 0, 0), unit)
    return Dimension((length, mass, time), unit)


def extent_text(nodes: np.ndarray, unit: str) -> str:
    """Bounding box of nodes (n, 3) in words, such as "from [0, 0, 0] to [80, 40, 12] mm"."""
    corners = np.array([nodes.min(axis=0), nodes.max(axis=0)])
    corners[np.abs(corners) < 1e-6 * np.ptp(nodes, axis=0).max()] = 0.0
    low, high = ("[" + ", ".join(f"{c:.6g}" for c in corner) + "]" for corner in corners)
    return f"from {low} to {high} {unit}"
