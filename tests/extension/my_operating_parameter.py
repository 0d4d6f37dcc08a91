"""An operating parameter outside the package: a temperature that both laws of the contact take.

Equal parameters of two laws are one: a study sweeps it at the operating point, without a new
structure, and both laws follow.
"""

from __future__ import annotations

from squealstudy.laws import (
    ContactLawDefinition,
    FrictionCurveDefinition,
    contact_law,
    register,
)
from squealstudy.parameter import Parameter

TEMPERATURE = Parameter("temperature", 20.0, "degC", "of the contact", minimum=-40.0, maximum=400.0)
COLD, FADE, SOFTENING = 20.0, 1e-3, 2e-3  # degC, 1/K, 1/K
STIFFNESS = contact_law("bilateral").parameters[0]  # Pa/m, that minimal models are given for


def mu(s: float, p: float, friction: float, temperature: float) -> tuple[float, float, float]:
    """Coefficient, which fades with the temperature, and its slopes by speed and pressure."""
    return friction * (1.0 - FADE * (temperature - COLD)) + 0.0 * s * p, 0.0, 0.0


def pressure(g: float, temperature: float) -> tuple[float, float]:
    """Pressure and tangent of a lining that softens."""
    stiffness = STIFFNESS * (1.0 - SOFTENING * (temperature - COLD))
    return -stiffness * g, stiffness


def potential(g: float, temperature: float) -> float:
    """Stored energy per area."""
    return 0.5 * STIFFNESS * (1.0 - SOFTENING * (temperature - COLD)) * g * g


FADING = register(
    FrictionCurveDefinition(
        name="warm",
        description="fades with the temperature",
        parameters=(TEMPERATURE,),
        mu=mu,
        pressure_dependent=False,
    )
)
SOFT = register(
    ContactLawDefinition(
        name="warm",
        description="softens with the temperature, bilateral",
        parameters=(TEMPERATURE,),
        pressure=pressure,
        potential=potential,
    )
)
