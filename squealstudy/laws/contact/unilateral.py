"""Unilateral contact law p = k max(-g, 0) (THEORY.md eq. (5)): a linear layer that opens."""

from __future__ import annotations

import numpy as np

from squealstudy.laws.contact_law import ContactLawDefinition
from squealstudy.laws.registry import register
from squealstudy.parameter import Parameter

STIFFNESS = Parameter(
    "contact.stiffness",
    5e11,
    "Pa/m^n",
    "unilateral, power (n its exponent) and bilateral laws: stiffness",
    positive=True,
)


def pressure(g: float, stiffness: float) -> tuple[float, float]:
    """Pressure and tangent; both 0 at a gap of 0."""
    if g >= 0.0:
        return 0.0, 0.0
    return -stiffness * g, stiffness


def potential(g: float, stiffness: float) -> float:
    """Stored energy per area."""
    return 0.0 if g >= 0.0 else 0.5 * stiffness * g * g


def mean_pressure(g: float, d: float, stiffness: float) -> float:
    """Mean over a change of gap d, in which the contact may open or close."""
    m0, m1 = g - 0.5 * d, g + 0.5 * d
    if m0 < 0.0 and m1 < 0.0:
        return -stiffness * g
    m0, m1 = min(m0, 0.0), min(m1, 0.0)
    return 0.0 if m0 == m1 else -0.5 * stiffness * (m0 + m1) * (m1 - m0) / d


def gap_at(p: float, stiffness: float) -> float:
    """Gap of a pressure."""
    return -p / stiffness


def gap_scale(p: float, stiffness: float) -> float:
    """Gap over which the pressure changes by its own size."""
    return p / stiffness


def evaluate(g: np.ndarray, stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    """`pressure` for an array."""
    is_open = g >= 0.0
    depth = np.where(is_open, 0.0, -g)  # NaN stays NaN
    return stiffness * depth, np.where(is_open, 0.0, stiffness)


def slopes(g: np.ndarray, stiffness: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Derivatives by the gap and the stiffness."""
    p, kappa = evaluate(g, stiffness)
    return [(-kappa, np.zeros_like(g)), (p / stiffness, kappa / stiffness)]


UNILATERAL = register(
    ContactLawDefinition(
        name="unilateral",
        description="k max(-g, 0)",
        parameters=(STIFFNESS,),
        pressure=pressure,
        potential=potential,
        mean_pressure=mean_pressure,
        gap_at=gap_at,
        gap_scale=gap_scale,
        evaluate=evaluate,
        slopes=slopes,
    )
)
