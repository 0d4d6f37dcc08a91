"""A friction curve outside the package: mu = mu_d / (1 + p / p_f) falls with the pressure."""

from __future__ import annotations

from squealstudy.laws import FrictionCurveDefinition, register
from squealstudy.parameter import Parameter

FADE = Parameter("friction_law.fade_pressure", 1e6, "Pa", "halves friction", positive=True)


def mu(s: float, p: float, friction: float, fade: float) -> tuple[float, float, float]:
    """Coefficient and its slopes by speed and pressure."""
    share = 1.0 / (1.0 + max(p, 0.0) / fade)
    return friction * share, 0.0 * s, -friction * share * share / fade


FADING = register(
    FrictionCurveDefinition(
        name="fading",
        description="falls with the contact pressure",
        parameters=(FADE,),
        mu=mu,
    )
)
