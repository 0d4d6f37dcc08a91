"""Friction that falls from static to dynamic and rises again (THEORY.md eq. (9a)).

mu = mu_d (1 + (r - 1) exp(-(s / v)^n) + a s) with mu_d the study's ``friction``: with n = 1 and
a = 0 it is `exponential_fall`, with n = 2 its fall is Gaussian, flat at zero sliding.
"""

from __future__ import annotations

from math import exp

import numpy as np

from squealstudy.laws.friction.exponential_fall import DECAY_SPEED, STATIC_RATIO
from squealstudy.laws.friction_law import FrictionCurveDefinition
from squealstudy.laws.registry import register
from squealstudy.parameter import Parameter

EXPONENT = Parameter(
    "friction_law.exponent",
    2.0,
    "",
    "stribeck curve: exponent of the fall; 1: exponential, 2: Gaussian",
    minimum=1.0,
    maximum=10.0,
)
VISCOUS_RISE = Parameter(
    "friction_law.viscous_rise",
    0.0,
    "s/m",
    "stribeck curve: rise with the sliding speed, as a share of friction",
    minimum=0.0,
)


def mu(
    s: float,
    p: float,  # noqa: ARG001 - the arguments of every curve
    friction: float,
    static_ratio: float,
    decay_speed: float,
    exponent: float,
    viscous_rise: float,
) -> tuple[float, float, float]:
    """Coefficient and its slopes by speed and pressure."""
    x = s / decay_speed
    excess = friction * (static_ratio - 1.0) * exp(-(x**exponent))
    slope = -excess * exponent * x ** (exponent - 1.0) / decay_speed
    return friction * (1.0 + viscous_rise * s) + excess, slope + friction * viscous_rise, 0.0


def constant(
    static_ratio: float,
    decay_speed: float,  # noqa: ARG001
    exponent: float,  # noqa: ARG001
    viscous_rise: float,
) -> bool:
    """Without excess of static friction, and without a rise; of arrays, where it is so."""
    return np.equal(static_ratio, 1.0) & np.equal(viscous_rise, 0.0)


def slopes(
    s: float,
    p: float,  # noqa: ARG001
    friction: float,
    static_ratio: float,
    decay_speed: float,
    exponent: float,
    viscous_rise: float,
) -> list[tuple[float, float, float]]:
    """Derivatives by speed, pressure, friction, static ratio, decay speed, exponent, viscous rise.

    At zero sliding an exponent between 1 and 2 has no second derivative: it counts as none.
    """
    n, v, x = exponent, decay_speed, s / decay_speed
    e = exp(-(x**n))
    excess = friction * (static_ratio - 1.0) * e
    first = n * x ** (n - 1.0)  # of x^n by x
    second = n * (n - 1.0) * x ** (n - 2.0) if x > 0.0 and n > 1.0 else 0.0
    by_x = excess * (first * first - second)  # of -first excess
    log = np.log(x) if x > 0.0 else 0.0
    by_n = excess * (x**n * log * first - (1.0 + n * log) * x ** (n - 1.0)) / v
    return [
        (-excess * first / v + friction * viscous_rise, by_x / v**2, 0.0),
        (0.0, 0.0, 0.0),
        (
            1.0 + (static_ratio - 1.0) * e + viscous_rise * s,
            viscous_rise - (static_ratio - 1.0) * e * first / v,
            0.0,
        ),
        (friction * e, -friction * e * first / v, 0.0),
        (excess * first * x / v, excess * first / v**2 - by_x * x / v**2, 0.0),
        (-excess * x**n * log, by_n, 0.0),
        (friction * s, friction, 0.0),
    ]


STRIBECK = register(
    FrictionCurveDefinition(
        name="stribeck",
        description="falls from static to dynamic friction, with an exponent, and rises with speed",
        parameters=(STATIC_RATIO, DECAY_SPEED, EXPONENT, VISCOUS_RISE),
        mu=mu,
        pressure_dependent=False,
        constant=constant,
        slopes=slopes,
    )
)
