"""Cubic bilateral contact law p = -(k g + c g^3) (THEORY.md eq. (5)): open, it pulls.

A spring that hardens (c > 0) or softens (c < 0) with its deflection. The cubic part has no
stiffness at g = 0; at a working point its tangent 3 c g^2 counts. A softening spring gives way
beyond g^2 = k / (3 |c|): the tangent is negative there. Beyond g^2 = k / |c| an open gap presses
and a closed one pulls: balance there is no steady sliding.
"""

from __future__ import annotations

from math import asin, asinh, sin, sinh, sqrt

import numpy as np

from squealstudy.laws.contact.unilateral import STIFFNESS
from squealstudy.laws.contact_law import ContactLawDefinition
from squealstudy.laws.registry import register
from squealstudy.parameter import Parameter

CUBIC = Parameter(
    "contact.cubic_stiffness",
    0.0,
    "Pa/m3",
    "cubic law: factor of the third power; negative: it softens",
)
# of the linear stiffness: tangent of a spring that gives way, where one is divided by
MIN_TANGENT_RATIO = 1e-3


def pressure(g: float, stiffness: float, cubic: float) -> tuple[float, float]:
    """Pressure and tangent."""
    return -(stiffness + cubic * g * g) * g, stiffness + 3.0 * cubic * g * g


def plain(_stiffness: float, cubic: float) -> str:
    """Without its cubic part."""
    return "" if cubic else f"linear, as {CUBIC.name} is 0"


def potential(g: float, stiffness: float, cubic: float) -> float:
    """Stored energy per area, from the closed gap 0."""
    return 0.5 * (stiffness + 0.5 * cubic * g * g) * g * g


def mean_pressure(g: float, d: float, stiffness: float, cubic: float) -> float:
    """Exact: a cubic over an interval about its middle."""
    return -(stiffness + cubic * (g * g + 0.25 * d * d)) * g


def gap_at(p: float, stiffness: float, cubic: float) -> float:
    """Least deflection with pressure p, of a softening spring at most where it gives way."""
    if cubic == 0.0:
        return -p / stiffness
    width = sqrt(stiffness / (3.0 * abs(cubic)))
    x = 1.5 * p / (stiffness * width)
    third = sinh(asinh(x) / 3.0) if cubic > 0.0 else sin(asin(min(x, 1.0)) / 3.0)
    return -2.0 * width * third


def gap_scale(p: float, stiffness: float, cubic: float) -> float:
    """Pressure over tangent, of which a spring that gives way has none."""
    d = gap_at(p, stiffness, cubic)
    return p / max(stiffness + 3.0 * cubic * d * d, MIN_TANGENT_RATIO * stiffness)


def evaluate(g: np.ndarray, stiffness: float, cubic: float) -> tuple[np.ndarray, np.ndarray]:
    """`pressure` for an array."""
    return -(stiffness + cubic * g * g) * g, stiffness + 3.0 * cubic * g * g


def slopes(g: np.ndarray, stiffness: float, cubic: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Derivatives by the gap, the stiffness and the cubic stiffness."""
    return [
        (-(stiffness + 3.0 * cubic * g * g), 6.0 * cubic * g),
        (-g, np.ones_like(g)),
        (-(g**3), 3.0 * g * g),
    ]


CUBIC_LAW = register(
    ContactLawDefinition(
        name="cubic",
        description="-(k g + c g^3)",
        parameters=(STIFFNESS, CUBIC),
        plain=plain,
        pressure=pressure,
        potential=potential,
        mean_pressure=mean_pressure,
        gap_at=gap_at,
        gap_scale=gap_scale,
        evaluate=evaluate,
        slopes=slopes,
        pulls=True,
    )
)
