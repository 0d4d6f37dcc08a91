"""Average acceleration with Newton's iteration: the slow reference of contact forces."""

from __future__ import annotations

from squealstudy.motion.integrator import SLOW_TOLERANCE
from squealstudy.motion.integrators.newmark import AverageAcceleration


class NewmarkNewton(AverageAcceleration):
    """Average acceleration, a fresh Jacobian an iteration.

    It converges quadratically: squares of a run's tolerances are taken.
    """

    name = "newmark_newton"
    label = "Newmark, Newton"
    description = "average acceleration, a fresh Jacobian an iteration"
    tolerance = SLOW_TOLERANCE
