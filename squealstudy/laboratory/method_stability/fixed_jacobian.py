"""Plain fixed-Jacobian Newmark: does one step converge from its predictor, without any help."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from squealstudy.laboratory.method_stability.contact_models import (
    CONTACT_KNOBS,
    ContactState,
    rough_state,
    sliding_state,
)
from squealstudy.laboratory.method_stability.contract import (
    CONVERGED,
    FAILED,
    SLOW,
    WRONG,
    Cell,
    Knob,
    checked,
    named,
)
from squealstudy.laboratory.method_stability.plain_step import (
    iterate,
    local_contraction,
    plain_settings,
    radius,
    scale,
    solved,
)

SLOW_FROM = 40  # iterations: what a run allows before it halves its step
SAME = 1e-5  # relative distance of accelerations within which two ends of a step are one
NOT_CONVERGED = "not_converged"
NO_REFERENCE = "newton found no end of the step"


@dataclass(frozen=True)
class FixedJacobian:
    """The iteration of one step on a contact model; see `Case`."""

    name: str
    title: str
    state: Callable[[Mapping[str, float]], ContactState]
    boundary: str = "spectral radius of I - J^-1 J_true at the end of the step = 1"

    @property
    def knobs(self) -> Mapping[str, Knob]:
        """Of the step, the Jacobian, the laws and the working point."""
        return named(*CONTACT_KNOBS)

    def evaluate(self, values: Mapping[str, float]) -> Cell:
        """`measured` is the factor by which the kernel's iteration changes a small error."""
        knobs = checked(self.knobs, values)
        state, h, factor = self.state(knobs), knobs["step"], knobs["contact_factor"]
        settings = plain_settings(h, factor)
        with np.errstate(over="ignore", invalid="ignore"):
            end = solved(state, h)
            trace = iterate(state, settings, np.zeros(0))
            cost = float(len(trace.residuals) + 1)
            if end is None:
                return Cell(FAILED, NO_REFERENCE, True, np.nan, np.nan, np.nan, cost)
            predicted = radius(state, end, h, factor)
            measured = local_contraction(state, settings, end)
        if not trace.converged:
            return Cell(FAILED, NOT_CONVERGED, True, predicted, measured, np.nan, cost)
        error = float(np.linalg.norm(trace.pull - end.pull)) / scale(state, end.pull)
        outcome = WRONG if error > SAME else SLOW if cost > SLOW_FROM else CONVERGED
        return Cell(outcome, "", False, predicted, measured, error, cost)


FIXED_JACOBIAN = FixedJacobian(
    "fixed_jacobian", "plain fixed Jacobian, six modes and eight points", rough_state
)
FIXED_JACOBIAN_POINT = FixedJacobian(
    "fixed_jacobian_point", "plain fixed Jacobian, one point in sliding", sliding_state
)
