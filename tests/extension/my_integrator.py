"""Newmark's method with any beta and gamma: an integrator of the kernel from outside the package.

A file like this one, named by `register_integrator` or by a study's extensions, is all that an
integrator takes: its name, its options and the coefficients of a step.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field

from squealstudy.motion.integrator import FixedJacobian, register_integrator


@register_integrator
class NewmarkFamily(FixedJacobian):
    """Linear acceleration by default; with beta = 1/4 it is the package's average acceleration."""

    name = "newmark_family"
    label = "Newmark's family"
    description = "q and v by beta and gamma, fixed Jacobian (Newmark 1959)"
    order = 2  # with gamma = 1/2

    beta: float = Field(default=1 / 6, gt=0, le=0.5, description="of the displacement")
    gamma: float = Field(default=0.5, gt=0, le=1, description="of the velocity")

    def step(self, w2: np.ndarray, c: np.ndarray, h: float) -> np.ndarray:
        """Coefficients (8, n): with a = pull - c v - w2 q at either end of the step."""
        b_q, b_v = self.beta * h * h, self.gamma * h
        a_q, a_v = (0.5 - self.beta) * h * h, (1 - self.gamma) * h
        # q and v at the end, but for the part of the acceleration there, from q, v and the pull
        q = np.array([1 - a_q * w2, h - a_q * c, a_q + 0 * w2])
        v = np.array([-a_v * w2, 1 - a_v * c, a_v + 0 * w2])
        D = 1 + b_v * c + b_q * w2
        free = c * v + w2 * q
        q1, v1 = q - b_q * free / D, v - b_v * free / D
        return np.array([q1[0], q1[1], v1[0], v1[1], q1[2], v1[2], b_q / D, b_v / D])
