"""Friction of many published stick-slip models: mu = friction / (1 + delta s).

Leine, van Campen, de Kraker, van den Steen (1998), Nonlinear Dynamics 16, 41.
"""

from __future__ import annotations

from squealstudy.laws import FrictionCurveDefinition, register
from squealstudy.parameter import Parameter

DELTA = Parameter(
    "friction_law.delta", 3.0, "s/m", "fall over the sliding speed, from friction at rest"
)


def mu(
    s: float,
    p: float,  # noqa: ARG001 - the arguments of every curve
    friction: float,
    delta: float,
) -> tuple[float, float, float]:
    """Coefficient and its slopes by speed and pressure."""
    share = 1.0 / (1.0 + delta * s)
    return friction * share, -delta * friction * share * share, 0.0


HYPERBOLIC_FALL = register(
    FrictionCurveDefinition(
        name="hyperbolic_fall",
        description="falls from static friction as 1 / (1 + delta speed)",
        parameters=(DELTA,),
        mu=mu,
        pressure_dependent=False,
    )
)
