"""Exponential trapezoidal rule: each mode's free motion exact, the contact forces implicit.

Forces g beyond the free modes are linear over a step, so that the new state is affine in the new
ones, y_1 = base + P2 g_1, and g_1 = g(y_1) is iterated: order 2 as explicit exponential steps, with
the stability of an implicit method where points stick. Points that stick are solved for as in
Newmark's iteration (newmark_stiff), where P2 takes the place of b_v D^-1. Modes that the step does
not resolve resonate with changes of the contact near omega h = pi; coefficients of average
acceleration serve them as well.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.exponential_steps import forces
from squealstudy.kernels.integrator_layout import (
    E_QQ,
    E_QV,
    E_VQ,
    E_VV,
    P1_Q,
    P1_V,
    P2_Q,
    P2_V,
)
from squealstudy.kernels.integrator_state import (
    close_step,
    count_pass,
    halve,
    open_run,
    part_done,
)
from squealstudy.kernels.jit import entry_kernel, fast_kernel
from squealstudy.kernels.newmark_correct import relax
from squealstudy.kernels.newmark_layout import (
    A_TRIAL,
    DELTA,
    DONE,
    E2_OLD,
    FLOOR2,
    FORCE,
    ITERATION,
    LEVEL,
    NOT_CONVERGED,
    NOT_FINITE,
    OMEGA,
    PULL,
    PULL_OLD,
    Q_BASE,
    Q_TRIAL,
    RUNNING,
    STATUS,
    SUBSTEP,
    SUBSTEP_OLD,
    V_BASE,
    V_TRIAL,
    W2,
    C,
    Modal,
    Q,
    Saved,
    Settings,
    V,
    Work,
)
from squealstudy.kernels.newmark_output import add_work
from squealstudy.kernels.newmark_pass import pass_one
from squealstudy.kernels.newmark_residual import friction_change, residual
from squealstudy.kernels.newmark_step import BIG, guess_friction, keep_points
from squealstudy.kernels.newmark_stiff import mock_up
from squealstudy.kernels.newmark_vector import copy, move


@fast_kernel
def place(x: np.ndarray, E: np.ndarray) -> None:
    """Trial state that belongs to the new forces in A_TRIAL."""
    for j in range(x.shape[1]):
        x[Q_TRIAL, j] = x[Q_BASE, j] + E[P2_Q, j] * x[A_TRIAL, j]
        x[V_TRIAL, j] = x[V_BASE, j] + E[P2_V, j] * x[A_TRIAL, j]


@fast_kernel
def begin(settings: Settings, work: Work, E: np.ndarray, h: float) -> None:
    """Open a sub-step h with coefficients E (N_COEFFICIENT, n) from the accepted state."""
    counts, real, x = work.counts[0], work.real[0], work.x[0]
    known = settings.extrapolate and real[SUBSTEP_OLD] > 0.0
    ratio = h / real[SUBSTEP_OLD] if known else 0.0
    real[SUBSTEP], real[OMEGA], real[E2_OLD] = h, 1.0, 0.0
    counts[ITERATION] = 0
    for j in range(x.shape[1]):
        q, v, g = x[Q, j], x[V, j], x[PULL, j]
        held_q, held_v = E[P1_Q, j] - E[P2_Q, j], E[P1_V, j] - E[P2_V, j]
        x[Q_BASE, j] = E[E_QQ, j] * q + E[E_QV, j] * v + held_q * g
        x[V_BASE, j] = E[E_VQ, j] * q + E[E_VV, j] * v + held_v * g
        x[A_TRIAL, j] = g + ratio * (g - x[PULL_OLD, j])
    place(x, E)
    guess_friction(work.point[0], h if settings.extrapolate else 0.0)


@fast_kernel
def imbalance(modal: Modal, work: Work) -> tuple[float, float]:
    """DELTA = g(y) - g at the evaluated trial state; the squares of it and of its scale.

    The scale is Newmark's: inertia and contact forces.
    """
    x, modes = work.x[0], modal.modes[0]
    residual(modal, work, 0)
    e2 = 0.0
    scale2 = 0.0
    for j in range(x.shape[1]):
        free = modes[C, j] * x[V_TRIAL, j] + modes[W2, j] * x[Q_TRIAL, j]
        a, F = x[A_TRIAL, j] - free, x[FORCE, j]
        R = x[DELTA, j] + free
        x[DELTA, j] = R
        e2 += R * R
        scale2 += a * a + F * F
    return e2, scale2


@fast_kernel
def stick(like: Modal, work: Work, h: float) -> None:
    """Add to DELTA the friction forces to expect of points that stick.

    `like` has 1 + W2 = h / (2 P2_V), which is the diagonal Jacobian that newmark_stiff divides by.
    """
    if like.own.size == 0:
        return
    delta, w2 = work.x[0, DELTA], like.modes[0, W2]
    for j in range(delta.size):
        delta[j] /= 1.0 + w2[j]
    mock_up(like, work, 0, 1.0, 0.5 * h)
    for j in range(delta.size):
        delta[j] *= 1.0 + w2[j]


@fast_kernel
def solve(
    B: np.ndarray, modal: Modal, like: Modal, settings: Settings, work: Work, E: np.ndarray
) -> int:
    """Iterate to equal forces: DONE, or the reason why not."""
    counts, real, x = work.counts[0], work.real[0], work.x[0]
    limit, limit_t = settings.tolerance**2, settings.tolerance_t**2
    while True:
        pass_one(B, modal, work, 0)
        count_pass(work)
        counts[ITERATION] += 1
        e2, scale2 = imbalance(modal, work)
        change2, bound2 = friction_change(modal, work, 0)
        if not (e2 < BIG and scale2 < BIG and change2 < BIG):
            return NOT_FINITE
        balanced = e2 <= limit * scale2 + real[FLOOR2]
        balanced = balanced and change2 <= limit_t * bound2
        if not balanced and counts[ITERATION] >= settings.max_iterations:
            return NOT_CONVERGED
        stick(like, work, real[SUBSTEP])
        if balanced:
            move(x[A_TRIAL], real[OMEGA], x[DELTA])
        else:
            relax(settings, work, 0, e2)
        place(x, E)
        if balanced:
            return DONE


@fast_kernel
def accept(modal: Modal, settings: Settings, work: Work) -> bool:
    """Close a sub-step; whether a whole step is done."""
    counts, real, x = work.counts[0], work.real[0], work.x[0]
    add_work(modal, work, 0, real[SUBSTEP])
    copy(x[Q_TRIAL], x[Q])
    copy(x[V_TRIAL], x[V])
    copy(x[PULL], x[PULL_OLD])
    copy(x[A_TRIAL], x[PULL])
    real[SUBSTEP_OLD] = real[SUBSTEP]
    keep_points(work.point[0], real[SUBSTEP])
    return part_done(settings, counts)


@entry_kernel
def exponential_implicit(
    B: np.ndarray,
    modal: Modal,
    like: Modal,
    settings: Settings,
    E: np.ndarray,
    D: np.ndarray,
    work: Work,
    saved: Saved,
) -> None:
    """Integrate design 0 to its end or failure; arguments as of `newmark.newmark`.

    Parameters
    ----------
    like : Modal
        As `modal` without damping and with room for another W2: see `stick`.
    E : ndarray (L + 1, N_COEFFICIENT, n)
        Coefficients by halving level.
    D : ndarray (L + 1, n)
        h / (2 P2_V) - 1 of each.
    """
    open_run(B, modal, settings, work, saved)
    x, counts = work.x[0], work.counts[0]
    forces(modal, work)
    copy(x[DELTA], x[PULL])
    copy(x[DELTA], x[PULL_OLD])
    while counts[STATUS] == RUNNING:
        level = counts[LEVEL]
        copy(D[level], like.modes[0, W2])
        begin(settings, work, E[level], settings.h / (1 << level))
        reason = solve(B, modal, like, settings, work, E[level])
        if reason == DONE:
            if accept(modal, settings, work):
                close_step(modal, settings, work, saved)
        else:
            halve(settings, counts, reason)
