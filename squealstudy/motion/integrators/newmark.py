"""Newmark's method with beta = 1/4 and gamma = 1/2: fixed Jacobian, and Newton's iteration."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from squealstudy.motion.integrator import SLOW_TOLERANCE, FixedJacobian, KernelIntegrator

WARP_LIMIT = 2.0  # modes are pre-warped up to this omega h


class AverageAcceleration(KernelIntegrator):
    """Newmark's method with beta = 1/4 and gamma = 1/2, for any iteration of the forces."""

    order = 2

    prewarp: bool = Field(
        default=False, description="frequencies and dampings that cancel the period error"
    )

    def step(self, w2: np.ndarray, c: np.ndarray, h: float) -> np.ndarray:
        """Coefficients (8, n) of average acceleration."""
        return average_acceleration(w2, c, h)

    def modes(self, w2: np.ndarray, c: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness and damping (n,); with `prewarp` those that keep period and decay."""
        return prewarped(w2, c, h) if self.prewarp else (w2, c)


class Newmark(AverageAcceleration, FixedJacobian):
    """Average acceleration, fixed Jacobian (THEORY.md eq. (67))."""

    name = "newmark"
    label = "Newmark"
    description = "average acceleration, fixed Jacobian"


def average_acceleration(w2: np.ndarray, c: np.ndarray, h: float) -> np.ndarray:
    """Coefficients (8, n) of `KernelIntegrator.step`; half of the force acts at either end."""
    hk, hc = 0.25 * h * h * w2, 0.5 * h * c
    D = 1.0 + hc + hk
    to_q, to_v = 0.25 * h * h / D, 0.5 * h / D
    rows = [(1.0 + hc - hk) / D, h / D, -h * w2 / D, (1.0 - hc - hk) / D, to_q, to_v, to_q, to_v]
    return np.array(rows)


def prewarped(w2: np.ndarray, c: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and damping with which Newmark's free modes keep their period and decay.

    s = (2/h) tanh(lambda h / 2) for both roots of lambda^2 + c lambda + w2; modes beyond
    omega h = 2 are left as they are.
    """
    root = np.sqrt((c * c / 4 - w2).astype(complex))
    s1 = 2 / h * np.tanh((-c / 2 + root) * h / 2)
    s2 = 2 / h * np.tanh((-c / 2 - root) * h / 2)
    slow = np.maximum(np.abs(-c / 2 + root), np.abs(-c / 2 - root)) * h <= WARP_LIMIT
    return np.where(slow, (s1 * s2).real, w2), np.where(slow, -(s1 + s2).real, c)


class NewmarkNewton(AverageAcceleration):
    """Average acceleration with a new Jacobian in each iteration.

    It converges quadratically, and uses the squares of a run's tolerances.
    """

    name = "newmark_newton"
    label = "Newmark, Newton"
    description = "average acceleration, a fresh Jacobian an iteration"
    tolerance = SLOW_TOLERANCE
