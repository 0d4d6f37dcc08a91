"""Bilateral contact law p = -k g (THEORY.md eq. (5)), for contact that stays: open, it pulls."""

from __future__ import annotations

import numpy as np

from squealstudy.laws.contact.unilateral import STIFFNESS, gap_at, gap_scale
from squealstudy.laws.contact_law import ContactLawDefinition
from squealstudy.laws.registry import register


def pressure(g: float, stiffness: float) -> tuple[float, float]:
    """Pressure and tangent."""
    return -stiffness * g, stiffness


def potential(g: float, stiffness: float) -> float:
    """Stored energy per area, from the closed gap 0."""
    return 0.5 * stiffness * g * g


def mean_pressure(g: float, d: float, stiffness: float) -> float:  # noqa: ARG001 - linear
    """The pressure in the middle."""
    return -stiffness * g


def evaluate(g: np.ndarray, stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    """`pressure` for an array."""
    return -stiffness * g, np.full_like(g, stiffness)


def slopes(g: np.ndarray, stiffness: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Derivatives by the gap and the stiffness."""
    kappa = np.full_like(g, stiffness)
    return [(-kappa, np.zeros_like(g)), (-g, np.ones_like(g))]


BILATERAL = register(
    ContactLawDefinition(
        name="bilateral",
        description="-k g",
        parameters=(STIFFNESS,),
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
