"""Kinked friction: f = min(k_t s, b) (THEORY.md eq. (7))."""

from __future__ import annotations

from squealstudy.laws.friction_law import Regularisation
from squealstudy.laws.registry import register


def resistance(k_t: float, bound: float, s: float) -> float:
    """The slope while friction is below its bound."""
    f = k_t if k_t * s < bound else bound / s
    return 0.0 if bound <= 0.0 else f


def slope(k_t: float, bound: float, s: float) -> float:  # noqa: ARG001
    """A point that sticks is on the straight line."""
    return k_t


def partials(k_t: float, bound: float, s: float) -> tuple[float, float, float]:
    """Stick, else slip."""
    if k_t * s < bound:
        return k_t * s, k_t, 0.0
    return bound, 0.0, 1.0


REGULARISED = register(
    Regularisation(
        name="regularised",
        description="linear up to the bound",
        resistance=resistance,
        slope=slope,
        partials=partials,
        saturation=1.0,
    )
)
