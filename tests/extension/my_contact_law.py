"""A contact law outside the package: p = c max(-g, 0)^3, named by a study's `extensions`."""

from __future__ import annotations

from squealstudy.laws import ContactLawDefinition, register
from squealstudy.parameter import Parameter

CUBE = Parameter("contact.cube", 1e18, "Pa/m^3", "cube law: stiffness", positive=True)


def pressure(g: float, cube: float) -> tuple[float, float]:
    """Pressure and tangent."""
    if g >= 0.0:
        return 0.0, 0.0
    return -cube * g * g * g, 3.0 * cube * g * g


def potential(g: float, cube: float) -> float:
    """Stored energy per area."""
    return 0.0 if g >= 0.0 else 0.25 * cube * g * g * g * g


CUBIC = register(
    ContactLawDefinition(
        name="cube",
        description="c max(-g, 0)^3",
        parameters=(CUBE,),
        pressure=pressure,
        potential=potential,
    )
)
