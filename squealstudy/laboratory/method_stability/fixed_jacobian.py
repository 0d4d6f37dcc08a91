"""Plain fixed-Jacobian Newmark: does one step converge from its predictor, without any help."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

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
    Case,
    Cell,
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


def measure(
    state_of: Callable[[Mapping[str, float]], ContactState], knobs: Mapping[str, float]
) -> Cell:
    """`measured` is the factor by which the kernel's iteration changes a small error."""
    state, h, factor = state_of(knobs), knobs["step"], knobs["contact_factor"]
    settings = plain_settings(h, factor)
    with np.errstate(over="ignore", invalid="ignore"):
        end = solved(state, h)
        trace = iterate(state, settings, np.zeros(0))
        cost = float(len(trace.residuals) + 1)
        if end is None:
            return Cell(outcome=FAILED, predicted=np.nan, cost=cost, by=NO_REFERENCE, flagged=True)
        predicted = radius(state, end, h, factor)
        measured = local_contraction(state, settings, end)
    if not trace.converged:
        return Cell(
            outcome=FAILED,
            predicted=predicted,
            measured=measured,
            cost=cost,
            by=NOT_CONVERGED,
            flagged=True,
        )
    error = float(np.linalg.norm(trace.pull - end.pull)) / scale(state, end.pull)
    outcome = WRONG if error > SAME else SLOW if cost > SLOW_FROM else CONVERGED
    return Cell(outcome=outcome, predicted=predicted, measured=measured, error=error, cost=cost)


def _case(name: str, title: str, state_of: Callable[[Mapping[str, float]], ContactState]) -> Case:
    return Case(
        name=name,
        title=title,
        boundary="spectral radius of I - J^-1 J_true at the end of the step = 1",
        settings=CONTACT_KNOBS,
        measure=partial(measure, state_of),
    )


FIXED_JACOBIAN = _case(
    "fixed_jacobian", "plain fixed Jacobian, six modes and eight points", rough_state
)
FIXED_JACOBIAN_POINT = _case(
    "fixed_jacobian_point", "plain fixed Jacobian, one point in sliding", sliding_state
)
