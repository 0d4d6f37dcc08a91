"""Generalised-alpha steps with the contact forces at the alpha point (Chung & Hulbert 1993).

Unknown is the acceleration a_m = (1 - alpha_m) a_1 + alpha_m a_0 in the balance

    a_m + C v_f + K q_f = load + F(q_f, v_f),    q_f = (1 - alpha_f) q_1 + alpha_f q_0,

in which q_f and v_f are affine in a_m, with the factors b_q, b_v, and so in the pull
g = a_m + C v_f + K q_f: Newmark's iteration serves all members. HHT-alpha has alpha_m = 0;
alpha_m = alpha_f = 1/2 is the midpoint rule, which with the forces of `pass_gradient` conserves
energy.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.integrator_state import close_step, open_run, shown
from squealstudy.kernels.jit import entry_kernel, fast_kernel
from squealstudy.kernels.newmark_between import damping_power
from squealstudy.kernels.newmark_correct import place, relax
from squealstudy.kernels.newmark_forces import friction_change, pass_gradient, pass_one, residual
from squealstudy.kernels.newmark_layout import (
    X_START,
    ModalArrays,
    SavedArrays,
    Scheme,
    StepSettings,
    WorkArrays,
)
from squealstudy.kernels.newmark_step import (
    MAX_FINITE_SQUARE,
    count_pass,
    halved,
    keep_points,
    open_part,
    part_done,
)
from squealstudy.kernels.newmark_stiff import mock_up
from squealstudy.kernels.newmark_vector import copy, dot, move


@fast_kernel
def predict(
    x: np.ndarray, modes: np.ndarray, E: np.ndarray, scheme: Scheme, h: float, ratio: float
) -> None:
    """q_f and v_f without the pull, and a trial state as newmark_step.predict makes it.

    With a_m = 0 they are q and v, whose own forces C v + K q come off the pull.
    """
    past = scheme.alpha_m / (1.0 - scheme.alpha_m)
    now = 1.0 - scheme.alpha_f
    a_q = now * h * h * (0.5 - scheme.beta - scheme.beta * past)
    a_v = now * h * (1.0 - scheme.gamma - scheme.gamma * past)
    for j in range(x.shape[1]):
        q = x[at.Q, j] + now * h * x[at.V, j] + a_q * x[at.A, j]
        v = x[at.V, j] + a_v * x[at.A, j]
        free = modes[at.C, j] * v + modes[at.W2, j] * q
        x[at.Q_BASE, j], x[at.V_BASE, j] = q - E[at.LAST_Q, j] * free, v - E[at.LAST_V, j] * free
        x[at.PULL_TRIAL, j] = x[at.PULL, j] + ratio * (x[at.PULL, j] - x[at.PULL_OLD, j])
    place(x, E)


@fast_kernel
def solve(
    B: np.ndarray, modal: ModalArrays, settings: StepSettings, scheme: Scheme, work: WorkArrays
) -> int:
    """Iterate to balance at the alpha point: DONE, or the reason why not."""
    counts, real, x = work.counts[0], work.real[0], work.x[0]
    E = modal.steps[0, counts[at.HALVING]]
    limit, limit_t = settings.tolerance**2, settings.tolerance_t**2
    while True:
        if scheme.gradient:
            pass_gradient(B, modal, work)
        else:
            pass_one(B, modal, work, 0)
        count_pass(work.counts[0])
        counts[at.ITERATION] += 1
        e2, scale2 = residual(modal, work, 0)
        change2, bound2 = friction_change(modal, work, 0)
        if not (
            e2 < MAX_FINITE_SQUARE and scale2 < MAX_FINITE_SQUARE and change2 < MAX_FINITE_SQUARE
        ):
            return at.NOT_FINITE
        balanced = e2 <= limit * scale2 + real[at.FLOOR2]
        balanced = balanced and change2 <= limit_t * bound2
        if balanced and scheme.gradient:
            return at.DONE  # as it was evaluated: the gaps at its end are needed
        if not balanced and counts[at.ITERATION] >= settings.max_iterations:
            return at.NOT_CONVERGED
        mock_up(modal, work, 0, counts[at.HALVING])
        if not balanced:
            relax(settings, work, 0, E, e2)
            continue
        move(x[at.PULL_TRIAL], real[at.OMEGA], x[at.DELTA])
        place(x, E)
        return at.DONE


@fast_kernel
def add_work(modal: ModalArrays, work: WorkArrays) -> None:
    """Work over an accepted sub-step with its forces and velocities at the alpha point."""
    x, modes, h = work.x[0], modal.modes[0], work.real[0, at.SUBSTEP]
    w_load = 0.0
    damped = 0.0
    for j in range(x.shape[1]):
        v = x[at.V_TRIAL, j]
        w_load += modes[at.LOAD, j] * v
        damped += modes[at.C, j] * v * v
    for m in range(modal.shapes.shape[0]):
        y = dot(modal.shapes[m], x[at.V_TRIAL])
        damped += modal.component_terms[0, 0, m] * y * y
    if modal.between_of[0] >= 0:
        damped += damping_power(x)
    belt = 0.0
    sliding = 0.0
    point, points = work.point[0], modal.points[0]
    for i in range(point.shape[1]):
        speed = points[at.POINT_SPEED, i]
        belt += speed * point[at.OUT_T1, i]
        sliding += (
            point[at.OUT_W1, i] * point[at.OUT_T1, i] + point[at.OUT_W2, i] * point[at.OUT_T2, i]
        )
        w_load -= (
            points[at.POINT_T1, i] * (point[at.OUT_W1, i] - speed)
            + points[at.POINT_T2, i] * point[at.OUT_W2, i]
        )
    real = work.real[0]
    real[at.W_LOAD] += h * w_load
    real[at.W_BELT] -= h * belt
    real[at.D_FRICTION] -= h * sliding
    real[at.D_DAMPING] += h * damped


@fast_kernel
def keep_state(x: np.ndarray, modes: np.ndarray, scheme: Scheme) -> None:
    """The state at the end of the sub-step from that at its alpha point."""
    now, kept = 1.0 / (1.0 - scheme.alpha_f), 1.0 / (1.0 - scheme.alpha_m)
    for j in range(x.shape[1]):
        q, v, pull = x[at.Q_TRIAL, j], x[at.V_TRIAL, j], x[at.PULL_TRIAL, j]
        a = pull - modes[at.C, j] * v - modes[at.W2, j] * q
        x[at.PULL_OLD, j] = x[at.PULL, j]
        x[at.PULL, j] = pull
        x[at.Q, j] += now * (q - x[at.Q, j])
        x[at.V, j] += now * (v - x[at.V, j])
        x[at.A, j] = kept * (a - scheme.alpha_m * x[at.A, j])


@fast_kernel
def accept(modal: ModalArrays, settings: StepSettings, scheme: Scheme, work: WorkArrays) -> bool:
    """Close a sub-step; whether a whole step is done."""
    counts, real, point = work.counts[0], work.real[0], work.point[0]
    add_work(modal, work)
    keep_state(work.x[0], modal.modes[0], scheme)
    real[at.SUBSTEP_OLD] = real[at.SUBSTEP]
    keep_points(point, modal.fixed.shape[2], real[at.SUBSTEP])
    for i in range(point.shape[1]):
        point[X_START, i] = 2.0 * point[at.OUT_X, i] - point[X_START, i]
    return part_done(settings, counts)


@fast_kernel
def show(B: np.ndarray, modal: ModalArrays, work: WorkArrays) -> None:
    """Evaluate the accepted state, for output: the points stood at an alpha point."""
    x, point = work.x[0], work.point[0]
    copy(x[at.Q], x[at.Q_TRIAL])
    copy(x[at.V], x[at.V_TRIAL])
    pass_one(B, modal, work, 0)
    count_pass(work.counts[0])
    for i in range(point.shape[1]):
        point[X_START, i] = point[at.OUT_X, i]


@entry_kernel
def alpha_method(
    B: np.ndarray,
    modal: ModalArrays,
    settings: StepSettings,
    scheme: Scheme,
    work: WorkArrays,
    saved: SavedArrays,
) -> None:
    """Integrate design 0 to its end or failure; arguments as of `newmark_batch`.

    A sub-step that fails is halved as far as the settings allow. Evaluations for output count.
    """
    open_run(B, modal, settings, work, saved)
    counts = work.counts[0]
    while counts[at.STATUS] == at.RUNNING:
        h = settings.h / (1 << counts[at.HALVING])
        ratio = open_part(settings, work, 0, modal.fixed.shape[2], h)
        predict(work.x[0], modal.modes[0], modal.steps[0, counts[at.HALVING]], scheme, h, ratio)
        reason = solve(B, modal, settings, scheme, work)
        if reason == at.DONE:
            if accept(modal, settings, scheme, work):
                if shown(settings, counts[at.STEP]):
                    show(B, modal, work)
                close_step(modal, settings, work, saved)
        elif not halved(settings, counts):
            counts[at.STATUS] = reason
