"""The friction coefficient of steady sliding and its slopes, for statics and vibration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from squealstudy.models.operating import OperatingPoint


class SlidingFriction(NamedTuple):
    """Friction mu(s, p) at contact points that slide steadily.

    Attributes
    ----------
    mu : ndarray (nc,)
        Friction coefficient.
    by_speed : ndarray (nc,)
        dmu/ds, s/m.
    by_pressure : ndarray (nc,)
        dmu/dp, 1/Pa.
    """

    mu: np.ndarray
    by_speed: np.ndarray
    by_pressure: np.ndarray

    def following(self, pressure: np.ndarray) -> np.ndarray:
        """d(mu p)/dp = mu + p dmu/dp: how the traction follows the pressure (nc,) [Pa]."""
        return self.mu + pressure * self.by_pressure


def sliding_friction(operating: OperatingPoint, pressure: np.ndarray) -> SlidingFriction:
    """Friction at the imposed sliding speed under contact pressures (nc,) [Pa]."""
    mu = np.full(len(pressure), operating.mu_steady)
    by_speed = np.full(len(pressure), operating.friction_slope)
    return SlidingFriction(mu, by_speed, np.zeros(len(pressure)))
