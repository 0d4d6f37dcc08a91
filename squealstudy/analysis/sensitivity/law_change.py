"""Derivatives of contact and friction laws by their parameters."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp

import numpy as np

from squealstudy.models.law import ContactLaw
from squealstudy.models.operating import OperatingPoint

# parameters that a contact law listens to, by their names in study files
LAW_PARAMETERS = {
    "exponential": {"contact.p0": "p0", "contact.lambda": "lam"},
    "unilateral": {"contact.stiffness": "stiffness"},
    "power": {"contact.stiffness": "stiffness", "contact.exponent": "exponent"},
    "bilateral": {"contact.stiffness": "stiffness"},
}
FRICTION_PARAMETERS = {
    "friction": "friction",
    "friction_law.static_ratio": "static_ratio",
    "friction_law.decay_speed": "decay_speed",
    "sliding_speed": "sliding_speed",
}


@dataclass(frozen=True)
class FrictionChange:
    """Derivatives of mu, of dmu/ds [s/m] and of the sliding speed [m/s] by one parameter."""

    mu: float = 0.0
    slope: float = 0.0
    speed: float = 0.0


def friction_change(operating: OperatingPoint, name: str) -> FrictionChange:
    """Of mu(s) = mu_d (1 + (r - 1) e), e = exp(-s / v), and of its slope -mu_d (r - 1) e / v.

    Parameters
    ----------
    name : str
        One of FRICTION_PARAMETERS.
    """
    mu, s = float(operating.friction), float(operating.sliding_speed)
    v, excess = float(operating.decay_speed), float(operating.static_ratio) - 1.0
    e = exp(-s / v)
    if name == "friction":
        return FrictionChange(1.0 + excess * e, -excess * e / v)
    if name == "friction_law.static_ratio":
        return FrictionChange(mu * e, -mu * e / v)
    if name == "friction_law.decay_speed":
        return FrictionChange(mu * excess * e * s / v**2, mu * excess * e / v**2 * (1.0 - s / v))
    return FrictionChange(-mu * excess * e / v, mu * excess * e / v**2, 1.0)


def law_change(law: ContactLaw, name: str, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of pressure and tangent by a parameter of the law, at fixed gaps g (nc,).

    Parameters
    ----------
    name : str
        One of LAW_PARAMETERS[law.kind].
    """
    p, kappa = law.evaluate(g)
    a, b = law.parameters
    if name in ("contact.p0", "contact.stiffness"):
        return p / a, kappa / a
    if name == "contact.lambda":
        return -g * p, p - b * g * p
    depth = np.maximum(-g, 0.0)
    log = np.log(np.where(depth > 0, depth, 1.0))
    return p * log, kappa * (1.0 / b + log)


def tangent_slope(law: ContactLaw, g: np.ndarray) -> np.ndarray:
    """Change d kappa / dg (nc,) of the tangent kappa = -dp/dg; 0 where a point is open."""
    _, kappa = law.evaluate(g)
    _, b = law.parameters
    if law.kind == "exponential":
        return -b * kappa
    if law.kind == "power":
        depth = np.where(g < 0, -g, 1.0)
        return np.where(g < 0, -(b - 1.0) * kappa / depth, 0.0)
    return np.zeros_like(g)
