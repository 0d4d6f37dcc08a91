"""Exact free motion, contact forces by the trapezoidal rule: what a study does by default."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from squealstudy.motion.integrator import FixedJacobian
from squealstudy.motion.integrators.newmark import average_acceleration
from squealstudy.motion.propagators import propagator_levels


class ExactFreeMotion(FixedJacobian):
    """Modes that a step resolves move exactly under forces that are linear in time.

    Those beyond `exact_limit` move by average acceleration: they would resonate with changes of
    the contact near omega h = pi.
    """

    name = "exponential"
    label = "exponential"
    description = (
        "resolved free modes exact, contact by the trapezoidal rule, iterated as Newmark's"
    )
    order = 2
    # work is summed by the trapezoidal rule, and levels are right to 0.1 % at 3.9e-3 (coarse brake,
    # 4 us), to 1.4 % at 2.2e-2
    drift_limit = 4e-3
    work_of_changes = 1.0

    exact_limit: float = Field(
        default=2.0, ge=0, description="omega h beyond which a mode moves by average acceleration"
    )

    def step(self, w2: np.ndarray, c: np.ndarray, h: float) -> np.ndarray:
        """Coefficients (8, n)."""
        return self._mixed(w2, c, h, propagator_levels(w2, c, h, 0)[0])

    def steps(self, w2: np.ndarray, c: np.ndarray, h: float) -> np.ndarray:
        """Coefficients by halving level, exponentials by squaring those of the shortest step."""
        exact = propagator_levels(w2, c, h, self.max_halvings)
        return np.array([self._mixed(w2, c, h / 2**k, rows) for k, rows in enumerate(exact)])

    def _mixed(self, w2: np.ndarray, c: np.ndarray, h: float, exact: np.ndarray) -> np.ndarray:
        """Rows (8, n), from the propagators (10, n) where modes are slow."""
        table = average_acceleration(w2, c, h)
        slow = np.sqrt(np.maximum(w2, 0.0)) * h <= self.exact_limit
        both = np.concatenate([exact[:4], exact[4:6] - exact[6:8], exact[6:8]])
        table[:, slow] = both[:, slow]
        return table
