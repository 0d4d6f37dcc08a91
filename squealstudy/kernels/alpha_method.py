"""Generalised-alpha steps with the contact forces at the alpha point (Chung & Hulbert 1993).

Unknown is the acceleration a_m = (1 - alpha_m) a_1 + alpha_m a_0 in the balance

    a_m + C v_f + K q_f = load + F(q_f, v_f),    q_f = (1 - alpha_f) q_1 + alpha_f q_0,

in which q_f and v_f are affine in a_m, with the factors b_q, b_v, and so in the pull
g = a_m + C v_f + K q_f: Newmark's iteration serves all members. HHT-alpha has alpha_m = 0;
alpha_m = alpha_f = 1/2 is the midpoint rule, which with the forces of `gradient_pass` conserves
energy.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.gradient_pass import pass_gradient
from squealstudy.kernels.integrator_layout import X_START, Scheme
from squealstudy.kernels.integrator_state import (
    close_step,
    count_pass,
    halve,
    open_run,
    part_done,
    shown,
)
from squealstudy.kernels.jit import entry_kernel, fast_kernel
from squealstudy.kernels.newmark_correct import place, relax
from squealstudy.kernels.newmark_layout import (
    D_DAMPING,
    D_FRICTION,
    DELTA,
    DONE,
    E2_OLD,
    FLOOR2,
    ITERATION,
    LAST_Q,
    LAST_V,
    LEVEL,
    LOAD,
    NOT_CONVERGED,
    NOT_FINITE,
    OMEGA,
    PULL,
    PULL_OLD,
    PULL_TRIAL,
    Q_BASE,
    Q_TRIAL,
    RUNNING,
    STATUS,
    STEP,
    SUBSTEP,
    SUBSTEP_OLD,
    V_BASE,
    V_TRIAL,
    W2,
    W_BELT,
    W_LOAD,
    A,
    C,
    Modal,
    Q,
    Saved,
    Settings,
    V,
    Work,
)
from squealstudy.kernels.newmark_pass import pass_one
from squealstudy.kernels.newmark_residual import friction_change, residual
from squealstudy.kernels.newmark_step import BIG, guess_friction, keep_points
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
        q = x[Q, j] + now * h * x[V, j] + a_q * x[A, j]
        v = x[V, j] + a_v * x[A, j]
        free = modes[C, j] * v + modes[W2, j] * q
        x[Q_BASE, j], x[V_BASE, j] = q - E[LAST_Q, j] * free, v - E[LAST_V, j] * free
        x[PULL_TRIAL, j] = x[PULL, j] + ratio * (x[PULL, j] - x[PULL_OLD, j])
    place(x, E)


@fast_kernel
def begin(modal: Modal, settings: Settings, scheme: Scheme, work: Work, h: float) -> None:
    """Open a sub-step h from the accepted state."""
    counts, real = work.counts[0], work.real[0]
    known = settings.extrapolate and real[SUBSTEP_OLD] > 0.0
    real[SUBSTEP], real[OMEGA], real[E2_OLD] = h, 1.0, 0.0
    counts[ITERATION] = 0
    ratio = h / real[SUBSTEP_OLD] if known else 0.0
    predict(work.x[0], modal.modes[0], modal.steps[0, counts[LEVEL]], scheme, h, ratio)
    guess_friction(work.point[0], h if settings.extrapolate else 0.0)


@fast_kernel
def solve(B: np.ndarray, modal: Modal, settings: Settings, scheme: Scheme, work: Work) -> int:
    """Iterate to balance at the alpha point: DONE, or the reason why not."""
    counts, real, x = work.counts[0], work.real[0], work.x[0]
    E = modal.steps[0, counts[LEVEL]]
    limit, limit_t = settings.tolerance**2, settings.tolerance_t**2
    while True:
        if scheme.gradient:
            pass_gradient(B, modal, work)
        else:
            pass_one(B, modal, work, 0)
        count_pass(work)
        counts[ITERATION] += 1
        e2, scale2 = residual(modal, work, 0)
        change2, bound2 = friction_change(modal, work, 0)
        if not (e2 < BIG and scale2 < BIG and change2 < BIG):
            return NOT_FINITE
        balanced = e2 <= limit * scale2 + real[FLOOR2]
        balanced = balanced and change2 <= limit_t * bound2
        if balanced and scheme.gradient:
            return DONE  # as it was evaluated: the gaps at its end are needed
        if not balanced and counts[ITERATION] >= settings.max_iterations:
            return NOT_CONVERGED
        mock_up(modal, work, 0, counts[LEVEL])
        if not balanced:
            relax(settings, work, 0, E, e2)
            continue
        move(x[PULL_TRIAL], real[OMEGA], x[DELTA])
        place(x, E)
        return DONE


@fast_kernel
def add_work(modal: Modal, work: Work) -> None:
    """Work over an accepted sub-step with its forces and velocities at the alpha point."""
    x, modes, h = work.x[0], modal.modes[0], work.real[0, SUBSTEP]
    w_load = 0.0
    damped = 0.0
    for j in range(x.shape[1]):
        v = x[V_TRIAL, j]
        w_load += modes[LOAD, j] * v
        damped += modes[C, j] * v * v
    for m in range(modal.shapes.shape[0]):
        y = dot(modal.shapes[m], x[V_TRIAL])
        damped += modal.tuned[0, 0, m] * y * y
    speed = modal.laws[0, 8]
    belt = 0.0
    sliding = 0.0
    point, points = work.point[0], modal.points[0]
    for i in range(point.shape[1]):
        belt += point[4, i]
        sliding += point[1, i] * point[4, i] + point[2, i] * point[5, i]
        w_load -= points[6, i] * (point[1, i] - speed) + points[7, i] * point[2, i]
    real = work.real[0]
    real[W_LOAD] += h * w_load
    real[W_BELT] -= h * speed * belt
    real[D_FRICTION] -= h * sliding
    real[D_DAMPING] += h * damped


@fast_kernel
def keep_state(x: np.ndarray, modes: np.ndarray, scheme: Scheme) -> None:
    """The state at the end of the sub-step from that at its alpha point."""
    now, kept = 1.0 / (1.0 - scheme.alpha_f), 1.0 / (1.0 - scheme.alpha_m)
    for j in range(x.shape[1]):
        q, v, pull = x[Q_TRIAL, j], x[V_TRIAL, j], x[PULL_TRIAL, j]
        a = pull - modes[C, j] * v - modes[W2, j] * q
        x[PULL_OLD, j] = x[PULL, j]
        x[PULL, j] = pull
        x[Q, j] += now * (q - x[Q, j])
        x[V, j] += now * (v - x[V, j])
        x[A, j] = kept * (a - scheme.alpha_m * x[A, j])


@fast_kernel
def accept(modal: Modal, settings: Settings, scheme: Scheme, work: Work) -> bool:
    """Close a sub-step; whether a whole step is done."""
    counts, real, point = work.counts[0], work.real[0], work.point[0]
    add_work(modal, work)
    keep_state(work.x[0], modal.modes[0], scheme)
    real[SUBSTEP_OLD] = real[SUBSTEP]
    keep_points(point, real[SUBSTEP])
    for i in range(point.shape[1]):
        point[X_START, i] = 2.0 * point[0, i] - point[X_START, i]
    return part_done(settings, counts)


@fast_kernel
def show(B: np.ndarray, modal: Modal, work: Work) -> None:
    """Evaluate the accepted state, for output: the points stood at an alpha point."""
    x, point = work.x[0], work.point[0]
    copy(x[Q], x[Q_TRIAL])
    copy(x[V], x[V_TRIAL])
    pass_one(B, modal, work, 0)
    count_pass(work)
    for i in range(point.shape[1]):
        point[X_START, i] = point[0, i]


@entry_kernel
def alpha_method(
    B: np.ndarray, modal: Modal, settings: Settings, scheme: Scheme, work: Work, saved: Saved
) -> None:
    """Integrate design 0 to its end or failure; arguments as of `newmark.newmark`.

    A sub-step that fails is halved as far as the settings allow. Evaluations for output count.
    """
    open_run(B, modal, settings, work, saved)
    counts = work.counts[0]
    while counts[STATUS] == RUNNING:
        begin(modal, settings, scheme, work, settings.h / (1 << counts[LEVEL]))
        reason = solve(B, modal, settings, scheme, work)
        if reason == DONE:
            if accept(modal, settings, scheme, work):
                if shown(settings, counts[STEP]):
                    show(B, modal, work)
                close_step(modal, settings, work, saved)
        else:
            halve(settings, counts, reason)
