"""Case that maps where a Newmark step with a fixed Jacobian converges by the plain iteration.

The iteration a <- a + J^-1 R(a) for the pull a, THEORY.md eq. (66), changes a small error by the
spectral radius of I - J^-1 J_true, THEORY.md eq. (69): J is the fixed Jacobian, J_true is -dR/da
at the solution.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.laws import friction_tangent, law_row
from squealstudy.kernels.newmark_batch import newmark_batch, newmark_trace
from squealstudy.laboratory.method_stability.contact_models import (
    CONTACT_KNOBS,
    ContactState,
    rough_state,
    sliding_state,
)
from squealstudy.laboratory.method_stability.contract import (
    CONVERGED,
    SLOW,
    WRONG,
    CaseResult,
    StabilityCase,
    failed,
)
from squealstudy.motion.integrators.newmark import Newmark, NewmarkNewton
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import KernelRun

SLOW_FROM = 40  # a step with more iterations is slow: runs then halve it
# largest error of the pull, over `scale`, at the end of a step that is right
MAX_REL_PULL_ERROR = 1e-5
MAX_ITERATIONS = 4000  # 2 % below the boundary a step takes 1,000 iterations
CONVERGED_TOLERANCE = 1e-9  # tolerance of a step that counts as converged
# tolerance of an iteration that is made for its residuals and need not converge
TRACE_TOLERANCE = 1e-15
# distance from the solution, over `scale`, at which the local iteration starts
START_REL_DISTANCE = 1e-8
# `rate` reads residuals until they have grown or shrunk by these factors from the first residual
GROWN_RESIDUAL_RATIO, SHRUNK_RESIDUAL_RATIO = 1e5, 1e-3
NOT_CONVERGED = "not_converged"
NO_REFERENCE = "newton found no end of the step"


def measure(
    state_of: Callable[[Mapping[str, float]], ContactState], knobs: Mapping[str, float]
) -> CaseResult:
    """Take one step with a setting of the knobs, and compare it with Newton's method.

    `predicted` is the spectral radius, `measured` the factor by which the kernel's iteration
    changes a small error; `cost` counts iterations.
    """
    state, h, factor = state_of(knobs), knobs["step"], knobs["contact_factor"]
    settings = plain_settings(h, factor)
    with np.errstate(over="ignore", invalid="ignore"):
        end = solved(state, h)
        trace = iterate(state, settings, np.zeros(0))
        cost = float(len(trace.residuals) + 1)  # the last residual is not in the trace
        if end is None:
            return failed(NO_REFERENCE, predicted=np.nan, cost=cost)
        predicted = radius(state, end, h, factor)
        measured = local_contraction(state, settings, end)
    if not trace.converged:
        return failed(NOT_CONVERGED, predicted=predicted, measured=measured, cost=cost)
    error = float(np.linalg.norm(trace.pull - end.pull)) / scale(state, end.pull)
    outcome = SLOW if cost > SLOW_FROM else CONVERGED
    if error > MAX_REL_PULL_ERROR:
        outcome = WRONG
    return CaseResult(
        outcome=outcome, predicted=predicted, measured=measured, error=error, cost=cost
    )


@dataclass(frozen=True)
class Trace:
    """Residuals (m,) of an iteration, whether it converged, and its last pull (n,)."""

    residuals: np.ndarray
    converged: bool
    pull: np.ndarray


def plain_settings(step: float, contact_factor: float) -> MotionSettings:
    """Settings of one step by the plain iteration, without any measure that helps convergence."""
    plain = Newmark(
        max_halvings=0, aitken=False, contact_factor=contact_factor, tangential_damping="never"
    )
    return MotionSettings(
        duration=step,
        step=step,
        save_every=0,
        integrator=plain,
        tolerance=CONVERGED_TOLERANCE,
        max_iterations=MAX_ITERATIONS,
    )


@dataclass(frozen=True)
class Solution:
    """End of a step: displacement, velocity and pull (all forces on the free modes), (n,) each."""

    q: np.ndarray
    v: np.ndarray
    pull: np.ndarray


def iterate(state: ContactState, settings: MotionSettings, first: np.ndarray) -> Trace:
    """Run the kernel's iteration of one step from the pull `first`, (n,).

    With an empty `first`, (0,), it starts from the predictor of the kernel.
    """
    run = KernelRun.of(state.system, [state.design], settings)
    work = run.work
    start = np.zeros(work.x.shape[2] if len(first) else 0)  # rows of the kernel are padded
    start[: len(first)] = first
    squares = np.zeros(settings.max_iterations)
    n = newmark_trace(*run.arguments, start, squares)
    converged = bool(work.counts[0, layout.STATUS] == layout.DONE)
    return Trace(np.sqrt(squares[:n]), converged, work.x[0, layout.PULL, : state.system.n].copy())


def solved(state: ContactState, step: float) -> Solution | None:
    """The end of the step by Newton's method; None where that does not converge."""
    settings = MotionSettings(
        duration=step,
        step=step,
        save_every=0,
        integrator=NewmarkNewton(max_halvings=0),
        tolerance=CONVERGED_TOLERANCE**0.5,  # Newton's method uses the square
        max_iterations=400,
    )
    run = KernelRun.of(state.system, [state.design], settings)
    newmark_batch(*run.arguments)
    work, n = run.work, state.system.n
    if work.counts[0, layout.STATUS] != layout.DONE:
        return None
    return Solution(*(work.x[0, row, :n].copy() for row in (layout.Q, layout.V, layout.PULL)))


def radius(state: ContactState, solution: Solution, step: float, contact_factor: float) -> float:
    """Spectral radius of I - J^-1 J_true at the end of a step."""
    J, J_true = jacobians(state, solution.q, solution.v, step, contact_factor)
    values = np.linalg.eigvals(np.eye(len(J)) - np.linalg.solve(J, J_true))
    return float(np.abs(values).max())


def jacobians(
    state: ContactState, q: np.ndarray, v: np.ndarray, step: float, contact_factor: float
) -> tuple[np.ndarray, np.ndarray]:
    """Fixed and consistent Jacobian (n, n) of a step that ends at q, v.

    They are those of the kernel (THEORY.md eq. (67), (68)), from the laws and with plain products.
    """
    system, design = state.system, state.design
    N, T1, T2, k_ref = system.N, system.T1, system.T2, system.k_ref
    q_of_pull, v_of_pull = step * step / 4, step / 2  # changes of q, v with the pull at the end
    linear = np.diag(1.0 + v_of_pull * design.c + q_of_pull * system.omega2)
    # omega2 has k_ref in it: only the difference from it is added
    fixed = linear + q_of_pull * N.T @ (((contact_factor - 1.0) * k_ref)[:, None] * N)
    p, kappa = design.contact.evaluate((system.gap if design.gap is None else design.gap) + N @ q)
    law = law_row(design.contact, design.friction)
    w1, w2 = design.speed * system.speed_factor + T1 @ v, T2 @ v
    slopes = [
        friction_tangent(law, *point) for point in zip(system.frictional, p, w1, w2, strict=True)
    ]
    # slopes of friction forces: of t1, t2 with the sliding velocities, and with the pressure
    d11, d12, d22, t1_p, t2_p = (system.area * np.array(slopes).T)[:, :, None]
    k_n = (system.area * kappa)[:, None]
    true = linear + q_of_pull * N.T @ ((k_n - k_ref[:, None]) * N)
    by_velocity = T1.T @ (d11 * T1 + d12 * T2) + T2.T @ (d12 * T1 + d22 * T2)
    # an opening gap lowers the pressure by kappa
    by_gap = -(T1.T @ (t1_p * kappa[:, None] * N) + T2.T @ (t2_p * kappa[:, None] * N))
    return fixed, true - v_of_pull * by_velocity - q_of_pull * by_gap


def local_contraction(state: ContactState, settings: MotionSettings, solution: Solution) -> float:
    """Factor by which an iteration changes a small error of the solution.

    Above 1 the iteration leaves the solution. It is 0 where the solution is reached at once, inf
    where the iteration breaks down at once.
    """
    pull = solution.pull
    direction = np.random.default_rng(1).normal(size=len(pull))
    first = pull + START_REL_DISTANCE * scale(state, pull) * direction / np.linalg.norm(direction)
    trace = iterate(state, replace(settings, tolerance=TRACE_TOLERANCE), first)
    if len(trace.residuals) < 2:
        return 0.0 if trace.converged else np.inf
    return rate(trace.residuals)


def scale(state: ContactState, pull: np.ndarray) -> float:
    """Norm of the pull (n,) plus that of the reference normal forces, which never vanishes."""
    return float(np.linalg.norm(pull) + np.linalg.norm(state.system.N.T @ state.system.force[:, 0]))


def rate(e: np.ndarray) -> float:
    """Mean factor between successive residuals e (m,), m > 1.

    Only the later half of the residuals is used, up to the first that has grown or shrunk too far:
    round-off or other branches of the law then change the factor.
    """
    out_of_range = np.flatnonzero(
        (e >= GROWN_RESIDUAL_RATIO * e[0]) | (e <= SHRUNK_RESIDUAL_RATIO * e[0])
    )
    last = max(int(out_of_range[0]) - 1 if len(out_of_range) else len(e) - 1, 1)
    middle = last // 2
    return float((e[last] / e[middle]) ** (1.0 / (last - middle)))


def _case(
    name: str, title: str, state_of: Callable[[Mapping[str, float]], ContactState]
) -> StabilityCase:
    """Case of the fixed Jacobian for one contact law."""
    return StabilityCase(
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
