"""Methods without iteration: central differences, and exponential predictor-corrector steps."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.explicit_methods import central_difference, predictor_corrector_steps
from squealstudy.kernels.newmark_layout import N_COEFFICIENT
from squealstudy.laboratory.integrators.fixed_step import OwnKernel
from squealstudy.motion.arrays import aligned_zeros
from squealstudy.motion.integrators.exact_free_motion import propagators
from squealstudy.motion.simulate import KernelRun


class CentralDifference(OwnKernel):
    """Leap-frog: stable up to omega h = 2, contact included."""

    name = "central_difference"
    label = "central difference"
    description = "explicit, velocities at half steps"
    order = 2

    velocity: Literal["extrapolated", "lagged"] = Field(
        default="extrapolated",
        description="velocity that friction sees: that of half a step before (order 1), or "
        "extrapolated (order 2)",
    )

    def advance(self, case: KernelRun) -> None:
        """Integrate design 0 of the case to its end or failure."""
        lagged = self.velocity == "lagged"
        central_difference(case.B, case.modal, case.options, lagged, case.work, case.saved)


class ExponentialSecond(OwnKernel):
    """Exact free motion, contact forces linear in time through a predicted end."""

    name = "exponential_2"
    label = "exponential, order 2"
    description = "free modes exact, contact by PEC of order 2"
    order = 2

    def advance(self, case: KernelRun) -> None:
        """Integrate design 0 of the case to its end or failure."""
        _exponential(case, parts=0)


class ExponentialThird(OwnKernel):
    """Exponential method with forces quadratic in time, through the step before as well."""

    name = "exponential_3"
    label = "exponential, order 3"
    description = "free modes exact, contact by PEC of order 3"
    order = 3

    start_parts: int = Field(
        default=16, ge=1, le=1000, description="parts of the first step, of order 2"
    )

    def advance(self, case: KernelRun) -> None:
        """Integrate design 0 of the case to its end or failure."""
        _exponential(case, self.start_parts)


def _exponential(case: KernelRun, parts: int) -> None:
    """Integrate with order 2 if `parts` is 0, else with order 3; its first step has these parts."""
    w2, c = case.modal.modes[0, layout.W2], case.modal.modes[0, layout.C]
    h = case.settings.step
    E = aligned_zeros(2, N_COEFFICIENT, len(w2))
    E[0] = propagators(w2, c, h)
    if parts > 0:
        E[1] = propagators(w2, c, h / parts)
    predictor_corrector_steps(case.B, case.modal, case.options, E, parts, case.work, case.saved)
