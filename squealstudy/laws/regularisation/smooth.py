"""Smooth friction: f = b tanh(k_t s / b) (THEORY.md eq. (8))."""

from __future__ import annotations

from math import exp, tanh

from squealstudy.laws.contact_law import MAX_EXPONENT
from squealstudy.laws.friction_law import Regularisation
from squealstudy.laws.registry import register


def resistance(k_t: float, bound: float, s: float) -> float:
    """The secant; tanh by its exponential, which vectorises."""
    x = 2.0 * k_t * s / bound
    share = 1.0 - 2.0 / (exp(MAX_EXPONENT if x > MAX_EXPONENT else x) + 1.0)
    f = k_t if s == 0.0 else bound / s * share
    return 0.0 if bound <= 0.0 else f


def slope(k_t: float, bound: float, s: float) -> float:
    """The secant, which is less steep than at zero sliding."""
    return resistance(k_t, bound, s)


def partials(k_t: float, bound: float, s: float) -> tuple[float, float, float]:
    """Derivatives of the tanh."""
    x = k_t * s / bound
    th = tanh(x)
    flat = 1.0 - th * th
    return bound * th, k_t * flat, th - x * flat


SMOOTH = register(
    Regularisation(
        name="smooth",
        description="tanh, without a kink",
        resistance=resistance,
        slope=slope,
        partials=partials,
        saturation=5.0,  # tanh is 1 to 1e-4 there
    )
)
