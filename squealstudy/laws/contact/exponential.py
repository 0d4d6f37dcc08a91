"""Exponential contact law p = p0 exp(-lambda g) (THEORY.md eq. (4)): it never quite opens."""

from __future__ import annotations

from math import exp, log

import numpy as np

from squealstudy.laws.contact_law import MAX_EXPONENT, ContactLawDefinition
from squealstudy.laws.registry import register
from squealstudy.parameter import Parameter

P0 = Parameter("contact.p0", 1e5, "Pa", "exponential law: pressure at zero gap", positive=True)
LAMBDA = Parameter("contact.lambda", 5e5, "1/m", "exponential law: exponent", positive=True)


def pressure(g: float, p0: float, lam: float) -> tuple[float, float]:
    """Pressure and tangent; beyond exp(200) both stay there."""
    x = -lam * g
    p = p0 * exp(MAX_EXPONENT if x > MAX_EXPONENT else x)
    return p, lam * p


def potential(g: float, p0: float, lam: float) -> float:
    """Stored energy per area."""
    p, _ = pressure(g, p0, lam)
    return p / lam


def mean_pressure(g: float, d: float, p0: float, lam: float) -> float:
    """The pressure in the middle times sinh(z)/z, z half of lambda d: no cancellation."""
    p, _ = pressure(g, p0, lam)
    return p * sinh_over(0.5 * lam * d)


def sinh_over(z: float) -> float:
    """sinh(z) / z; 1 at 0. By its series up to z = 1."""
    s = z * z
    tail = 1.0 + s / 156.0 * (1.0 + s / 210.0 * (1.0 + s / 272.0))
    near = 1.0 + s / 42.0 * (1.0 + s / 72.0 * (1.0 + s / 110.0 * tail))
    near = 1.0 + s / 6.0 * (1.0 + s / 20.0 * near)
    size = abs(z)
    e = exp(MAX_EXPONENT if size > MAX_EXPONENT else size)
    return near if s < 1.0 else 0.5 * (e - 1.0 / e) / size


def gap_at(p: float, p0: float, lam: float) -> float:
    """Gap of a pressure."""
    return -log(p / p0) / lam


def gap_scale(p: float, p0: float, lam: float) -> float:  # noqa: ARG001 - the same at any pressure
    """Gap over which the pressure changes by e."""
    return 1.0 / lam


def closing_rate(p0: float, lam: float) -> float:  # noqa: ARG001
    """The exponent itself."""
    return lam


def evaluate(g: np.ndarray, p0: float, lam: float) -> tuple[np.ndarray, np.ndarray]:
    """`pressure` for an array."""
    p = p0 * np.exp(np.minimum(-lam * g, MAX_EXPONENT))
    return p, lam * p


def slopes(g: np.ndarray, p0: float, lam: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Derivatives by the gap, p0 and lambda."""
    p, kappa = evaluate(g, p0, lam)
    return [(-kappa, -lam * kappa), (p / p0, kappa / p0), (-g * p, p - lam * g * p)]


EXPONENTIAL = register(
    ContactLawDefinition(
        name="exponential",
        description="p0 exp(-lambda g)",
        parameters=(P0, LAMBDA),
        pressure=pressure,
        potential=potential,
        mean_pressure=mean_pressure,
        gap_at=gap_at,
        gap_scale=gap_scale,
        closing_rate=closing_rate,
        evaluate=evaluate,
        slopes=slopes,
    )
)
