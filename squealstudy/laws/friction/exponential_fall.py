"""Friction that falls from static to dynamic (THEORY.md eq. (9)): constant where their ratio is 1.

mu = mu_d (1 + (r - 1) exp(-s / v)) with mu_d the study's ``friction``.
"""

from __future__ import annotations

from math import exp

from squealstudy.laws.friction_law import FrictionCurveDefinition
from squealstudy.laws.registry import register
from squealstudy.parameter import Parameter

STATIC_RATIO = Parameter(
    "friction_law.static_ratio",
    1.0,
    "",
    "static over dynamic friction; 1: friction does not fall with speed",
    minimum=1.0,
    maximum=10.0,
)
DECAY_SPEED = Parameter(
    "friction_law.decay_speed",
    0.5,
    "m/s",
    "sliding speed over which the excess of static friction falls by e",
    positive=True,
)


def mu(
    s: float,
    p: float,  # noqa: ARG001 - the arguments of every curve
    friction: float,
    static_ratio: float,
    decay_speed: float,
) -> tuple[float, float, float]:
    """Coefficient and its slopes by speed and pressure."""
    fall = friction * (static_ratio - 1.0) * exp(-s / decay_speed)
    return friction + fall, -fall / decay_speed, 0.0


def constant(static_ratio: float, decay_speed: float) -> bool:  # noqa: ARG001
    """Without excess of static friction."""
    return static_ratio == 1.0


def slopes(
    s: float,
    p: float,  # noqa: ARG001
    friction: float,
    static_ratio: float,
    decay_speed: float,
) -> list[tuple[float, float, float]]:
    """Derivatives by speed, pressure, friction, static ratio and decay speed."""
    v, excess, e = decay_speed, friction * (static_ratio - 1.0), exp(-s / decay_speed)
    by_friction = 1.0 + (static_ratio - 1.0) * e
    return [
        (-excess * e / v, excess * e / v**2, 0.0),
        (0.0, 0.0, 0.0),
        (by_friction, -(static_ratio - 1.0) * e / v, 0.0),
        (friction * e, -friction * e / v, 0.0),
        (excess * e * s / v**2, excess * e / v**2 * (1.0 - s / v), 0.0),
    ]


def plain(static_ratio: float, decay_speed: float) -> str:
    """Where static friction is the dynamic one."""
    same = constant(static_ratio, decay_speed)
    return f"friction is the same at all speeds, as {STATIC_RATIO.name} is 1" if same else ""


EXPONENTIAL_FALL = register(
    FrictionCurveDefinition(
        name="exponential_fall",
        description="falls from static to dynamic friction with the sliding speed",
        parameters=(STATIC_RATIO, DECAY_SPEED),
        plain=plain,
        mu=mu,
        pressure_dependent=False,
        constant=constant,
        slopes=slopes,
    )
)
