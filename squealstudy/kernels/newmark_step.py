"""The course of one design point between two evaluations of its contact forces (paper figure 4).

Every design has its own time, sub-step, iteration and status; an evaluation at its trial state
(`pass_one` or the batched pass) is followed by `advance`, which accepts, corrects, halves or stops
and leaves the next trial state. Designs therefore cannot disturb each other.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.newmark_correct import correct_fixed, correct_newton, direction, place
from squealstudy.kernels.newmark_layout import (
    A_OLD,
    A_TRIAL,
    DELTA,
    DONE,
    E2_OLD,
    FIXED,
    FLOOR2,
    GUESS,
    HALVINGS,
    ITERATION,
    LEVEL,
    LOAD,
    MAX_PASSES,
    MODE,
    NEWTON,
    NOT_CONVERGED,
    NOT_FINITE,
    OLD,
    OMEGA,
    PASSES,
    POSITION,
    Q_BASE,
    Q_TRIAL,
    RUNNING,
    SINGULAR,
    SLOPE,
    START,
    STATUS,
    STEP,
    STEP_LENGTH,
    STEP_PASSES,
    STORED_END,
    STORED_START,
    SUBSTEP,
    SUBSTEP_OLD,
    V_BASE,
    V_TRIAL,
    A,
    Modal,
    Q,
    Saved,
    Settings,
    V,
    Work,
)
from squealstudy.kernels.newmark_output import add_work, save, stored_energy
from squealstudy.kernels.newmark_residual import friction_change, residual
from squealstudy.kernels.newmark_vector import copy, dot, fill, move

BIG = 1e290  # squares at or beyond it, and NaN, are not finite
ROUND_OFF = 1e-12  # forces below this share of the contact forces at the start mean nothing
# what a design does next
GO_ON, BEGIN, CLOSE = 0, 1, 2


@fast_kernel
def begin(work: Work, k: int, h: float) -> None:
    """Open a sub-step h: Newmark's explicit part (beta 1/4, gamma 1/2), forces extrapolated."""
    counts, real = work.counts[k], work.real[k]
    ratio = h / real[SUBSTEP_OLD] if real[SUBSTEP_OLD] > 0.0 else 0.0
    real[SUBSTEP] = h
    real[OMEGA] = 1.0
    real[STEP_LENGTH] = 1.0
    real[E2_OLD] = 0.0
    counts[ITERATION] = 0
    x = work.x[k]
    for j in range(x.shape[1]):
        x[Q_BASE, j] = x[Q, j] + h * x[V, j] + 0.25 * h * h * x[A, j]
        x[V_BASE, j] = x[V, j] + 0.5 * h * x[A, j]
        x[A_TRIAL, j] = x[A, j] + ratio * (x[A, j] - x[A_OLD, j])
    place(x, h)
    point = work.point[k]
    for i in range(point.shape[0]):
        point[i, GUESS] = point[i, OLD + 2] + h * point[i, SLOPE]
        point[i, GUESS + 1] = point[i, OLD + 3] + h * point[i, SLOPE + 1]


@fast_kernel
def keep_points(point: np.ndarray, h: float) -> None:
    """The trial state of the points (nc, N_POINT) is accepted; slopes over h, none for h = 0."""
    for i in range(point.shape[0]):
        if h > 0.0:
            point[i, SLOPE] = (point[i, 4] - point[i, OLD + 2]) / h
            point[i, SLOPE + 1] = (point[i, 5] - point[i, OLD + 3]) / h
        point[i, OLD] = point[i, 1]
        point[i, OLD + 1] = point[i, 2]
        point[i, OLD + 2] = point[i, 4]
        point[i, OLD + 3] = point[i, 5]


@fast_kernel
def force_floor(B: np.ndarray, modal: Modal, work: Work, k: int) -> float:
    """Square of the force that rounding leaves in sums over the contact points."""
    load = modal.modes[k, LOAD]
    total = dot(load, load)
    mu, point, points = modal.laws[k, 4], work.point[k], modal.points
    for i in range(B.shape[0]):
        normal = points[i, 1] * point[i, 3]
        drag = points[i, 2] * mu * normal
        for j in range(B.shape[2]):
            N, T1, T2 = B[i, 0, j], B[i, 1, j], B[i, 2, j]
            total += (N * normal) ** 2 + (T1 * T1 + T2 * T2) * drag * drag
    return ROUND_OFF * ROUND_OFF * total


@fast_kernel
def start(B: np.ndarray, modal: Modal, settings: Settings, work: Work, k: int) -> bool:
    """Acceleration of the initial state from the first evaluation; False if it is not finite."""
    x, real = work.x[k], work.real[k]
    fill(x[A_TRIAL], 0.0)
    e2, _ = residual(modal, work, k)
    real[FLOOR2] = force_floor(B, modal, work, k)
    copy(x[DELTA], x[A])
    copy(x[DELTA], x[A_OLD])
    keep_points(work.point[k], 0.0)
    work.counts[k, MODE] = NEWTON if settings.newton else FIXED
    return e2 < BIG


@fast_kernel
def fail(settings: Settings, counts: np.ndarray, reason: int) -> int:
    """After a failed iteration: halve, then a fresh Jacobian, then stop with the reason."""
    if counts[LEVEL] < settings.max_halvings:
        counts[LEVEL] += 1
        counts[HALVINGS] += 1
    elif counts[MODE] == FIXED:
        counts[MODE] = NEWTON
    else:
        counts[STATUS] = reason
    return BEGIN


@fast_kernel
def accept(B: np.ndarray, modal: Modal, settings: Settings, work: Work, k: int) -> int:
    """Close a sub-step: the last residual still corrects the state, at no evaluation's cost."""
    counts, real, x = work.counts[k], work.real[k], work.x[k]
    h = real[SUBSTEP]
    if counts[MODE] == FIXED and direction(B, modal, settings, work, k):
        move(x[A_TRIAL], real[OMEGA], x[DELTA])
        place(x, h)
    add_work(modal, work, k, h)
    copy(x[Q_TRIAL], x[Q])
    copy(x[V_TRIAL], x[V])
    copy(x[A], x[A_OLD])
    copy(x[A_TRIAL], x[A])
    real[SUBSTEP_OLD] = h
    keep_points(work.point[k], h)
    counts[MODE] = NEWTON if settings.newton else FIXED
    counts[POSITION] += 1 << (settings.max_halvings - counts[LEVEL])
    if counts[POSITION] < 1 << settings.max_halvings:
        return BEGIN
    counts[POSITION] = 0
    counts[LEVEL] = 0
    counts[STEP] += 1
    counts[MAX_PASSES] = max(counts[MAX_PASSES], counts[STEP_PASSES])
    counts[STEP_PASSES] = 0
    if counts[STEP] == settings.n_steps:
        counts[STATUS] = DONE
    return CLOSE


@fast_kernel
def iterate(B: np.ndarray, modal: Modal, settings: Settings, work: Work, k: int) -> int:
    """Judge an evaluation and correct, accept or give up; what to do next."""
    counts, real = work.counts[k], work.real[k]
    counts[ITERATION] += 1
    counts[STEP_PASSES] += 1
    counts[PASSES] += 1
    e2, scale2 = residual(modal, work, k)
    change2, bound2 = friction_change(modal, work, k)
    if not (e2 < BIG and scale2 < BIG and change2 < BIG):
        return fail(settings, counts, NOT_FINITE)
    balanced = e2 <= settings.tolerance * settings.tolerance * scale2 + real[FLOOR2]
    if balanced and change2 <= settings.tolerance_t * settings.tolerance_t * bound2:
        return accept(B, modal, settings, work, k)
    if counts[ITERATION] >= settings.max_iterations:
        return fail(settings, counts, NOT_CONVERGED)
    if counts[MODE] == FIXED:
        solved = correct_fixed(B, modal, settings, work, k, e2)
    else:
        solved = correct_newton(B, modal, work, k, e2)
    return GO_ON if solved else fail(settings, counts, SINGULAR)


@fast_kernel
def advance(
    B: np.ndarray, modal: Modal, settings: Settings, work: Work, saved: Saved, k: int
) -> None:
    """After an evaluation at the trial state of design k: its next trial state, or its end."""
    counts = work.counts[k]
    if counts[MODE] == START:
        if not start(B, modal, settings, work, k):
            counts[STATUS] = NOT_FINITE
            return
        work.real[k, STORED_START] = stored_energy(modal, work, k)
        then = CLOSE
    else:
        then = iterate(B, modal, settings, work, k)
    if then == CLOSE and settings.save_every > 0 and counts[STEP] % settings.save_every == 0:
        save(modal, settings, work, saved, k)
    if counts[STATUS] == DONE:
        work.real[k, STORED_END] = stored_energy(modal, work, k)
    if counts[STATUS] == RUNNING and then != GO_ON:
        begin(work, k, settings.h / (1 << counts[LEVEL]))
