"""Power contact law p = c max(-g, 0)^n, n at least 1 (THEORY.md eq. (5)): Hertz has n = 3/2."""

from __future__ import annotations

import numpy as np

from squealstudy.laws.contact.unilateral import STIFFNESS
from squealstudy.laws.contact_law import ContactLawDefinition
from squealstudy.laws.registry import register
from squealstudy.parameter import Parameter

EXPONENT = Parameter("contact.exponent", 1.5, "", "power law: exponent", minimum=1.0, maximum=10.0)
# change of gap over gap below which the mean pressure is expanded: no cancellation
SERIES_REL_GAP = 1e-3


def pressure(g: float, stiffness: float, exponent: float) -> tuple[float, float]:
    """Pressure and tangent; both 0 at a gap of 0."""
    if g >= 0.0:
        return 0.0, 0.0
    p = stiffness * (-g) ** exponent
    return p, exponent * p / (-g)


def plain(_stiffness: float, exponent: float) -> str:
    """With an exponent of 1."""
    return "" if exponent != 1.0 else f"linear where closed, as {EXPONENT.name} is 1"


def potential(g: float, stiffness: float, exponent: float) -> float:
    """Stored energy per area."""
    return 0.0 if g >= 0.0 else stiffness * (-g) ** (exponent + 1.0) / (exponent + 1.0)


def mean_pressure(g: float, d: float, stiffness: float, exponent: float) -> float:
    """Mean over a change of gap d, in which the contact may open or close."""
    m0, m1 = min(g - 0.5 * d, 0.0), min(g + 0.5 * d, 0.0)
    if m0 == 0.0 and m1 == 0.0:
        return 0.0
    if abs(d) < SERIES_REL_GAP * abs(g):
        p, _ = pressure(g, stiffness, exponent)
        return p * (1.0 + exponent * (exponent - 1.0) * d * d / (24.0 * g * g))
    return (potential(m0, stiffness, exponent) - potential(m1, stiffness, exponent)) / d


def gap_at(p: float, stiffness: float, exponent: float) -> float:
    """Gap of a pressure."""
    return -((p / stiffness) ** (1.0 / exponent))


def gap_scale(p: float, stiffness: float, exponent: float) -> float:
    """The depth itself."""
    return (p / stiffness) ** (1.0 / exponent)


def evaluate(g: np.ndarray, stiffness: float, exponent: float) -> tuple[np.ndarray, np.ndarray]:
    """`pressure` for an array."""
    is_open = g >= 0.0
    depth = np.where(is_open, 0.0, -g)  # NaN stays NaN
    p = stiffness * depth**exponent
    return p, exponent * p / np.where(is_open, 1.0, depth)


def slopes(g: np.ndarray, stiffness: float, exponent: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Derivatives by the gap, the stiffness and the exponent; 0 where a point is open."""
    p, kappa = evaluate(g, stiffness, exponent)
    depth = np.where(g < 0, -g, 1.0)
    log = np.log(depth)
    return [
        (-kappa, np.where(g < 0, -(exponent - 1.0) * kappa / depth, 0.0)),
        (p / stiffness, kappa / stiffness),
        (p * log, kappa * (1.0 / exponent + log)),
    ]


POWER = register(
    ContactLawDefinition(
        name="power",
        description="c max(-g, 0)^n",
        parameters=(STIFFNESS, EXPONENT),
        plain=plain,
        pressure=pressure,
        potential=potential,
        mean_pressure=mean_pressure,
        gap_at=gap_at,
        gap_scale=gap_scale,
        evaluate=evaluate,
        slopes=slopes,
    )
)
