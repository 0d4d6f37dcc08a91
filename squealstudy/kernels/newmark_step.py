"""One design point between two evaluations of its contact forces (THEORY.md eq. (66)).

Every design has its own time, sub-step, iteration and status; an evaluation at its trial state
(`pass_one` or the batched pass) is followed by `advance`, which accepts, corrects, halves or stops
and leaves the next trial state. Designs therefore cannot disturb each other.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.jit import fast_kernel, part_kernel
from squealstudy.kernels.newmark_correct import correct_fixed, correct_newton, direction, place
from squealstudy.kernels.newmark_dense import point_row
from squealstudy.kernels.newmark_layout import (
    DELTA,
    DONE,
    E2_OLD,
    FIRST_Q,
    FIRST_V,
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
    PULL,
    PULL_OLD,
    PULL_TRIAL,
    Q_BASE,
    Q_TRIAL,
    QQ,
    QV,
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
    VQ,
    VV,
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
def predict(x: np.ndarray, E: np.ndarray, ratio: float) -> None:
    """What a sub-step of coefficients E (N_STEP, n) does without the new pull; a trial state.

    The pull is extrapolated over `ratio` times the last sub-step: the diagonal system is solved
    for it as the method does that for any, and only the pull needs iterations.
    """
    for j in range(x.shape[1]):
        q, v, pull = x[Q, j], x[V, j], x[PULL, j]
        x[Q_BASE, j] = E[QQ, j] * q + E[QV, j] * v + E[FIRST_Q, j] * pull
        x[V_BASE, j] = E[VQ, j] * q + E[VV, j] * v + E[FIRST_V, j] * pull
        x[PULL_TRIAL, j] = pull + ratio * (pull - x[PULL_OLD, j])
    place(x, E)


@fast_kernel
def keep_state(x: np.ndarray) -> None:
    """The trial state is accepted."""
    for j in range(x.shape[1]):
        x[Q, j], x[V, j] = x[Q_TRIAL, j], x[V_TRIAL, j]
        x[PULL_OLD, j] = x[PULL, j]
        x[PULL, j] = x[PULL_TRIAL, j]


@fast_kernel
def guess_friction(point: np.ndarray, h: float) -> None:
    """Friction forces of the points (N_POINT, nc) a time h after the accepted ones."""
    for i in range(point.shape[1]):
        point[GUESS, i] = point[OLD + 2, i] + h * point[SLOPE, i]
        point[GUESS + 1, i] = point[OLD + 3, i] + h * point[SLOPE + 1, i]


@part_kernel
def begin(modal: Modal, settings: Settings, work: Work, k: int, h: float) -> None:
    """Open a sub-step h from the accepted state."""
    counts, real = work.counts[k], work.real[k]
    known = settings.extrapolate and real[SUBSTEP_OLD] > 0.0
    ratio = h / real[SUBSTEP_OLD] if known else 0.0
    real[SUBSTEP] = h
    real[OMEGA] = 1.0
    real[STEP_LENGTH] = 1.0
    real[E2_OLD] = 0.0
    counts[ITERATION] = 0
    predict(work.x[k], modal.steps[k, counts[LEVEL]], ratio)
    guess_friction(work.point[k], h if settings.extrapolate else 0.0)


@fast_kernel
def keep_points(point: np.ndarray, h: float) -> None:
    """The trial state of the points (N_POINT, nc) is accepted; slopes over h, none for h = 0."""
    rate = 1.0 / h if h > 0.0 else 0.0
    for i in range(point.shape[1]):
        point[SLOPE, i] = (point[4, i] - point[OLD + 2, i]) * rate
        point[SLOPE + 1, i] = (point[5, i] - point[OLD + 3, i]) * rate
        point[OLD, i] = point[1, i]
        point[OLD + 1, i] = point[2, i]
        point[OLD + 2, i] = point[4, i]
        point[OLD + 3, i] = point[5, i]


@fast_kernel
def force_floor(B: np.ndarray, modal: Modal, work: Work, k: int) -> float:
    """Square of the force that rounding leaves in sums over the contact points."""
    load = modal.modes[k, LOAD]
    total = dot(load, load)
    mu, point, points = modal.laws[k, 4], work.point[k], modal.points[k]
    for i in range(modal.fixed.shape[2]):
        normal = points[1, i] * point[3, i]
        drag = points[2, i] * mu * normal
        point_row(B, i, work.row)
        N, T1, T2 = work.row[0], work.row[1], work.row[2]
        total += dot(N, N) * normal * normal + (dot(T1, T1) + dot(T2, T2)) * drag * drag
    return ROUND_OFF * ROUND_OFF * total


@part_kernel
def start(B: np.ndarray, modal: Modal, settings: Settings, work: Work, k: int) -> bool:
    """Pull of the initial state from the first evaluation; False if it is not finite."""
    x, real = work.x[k], work.real[k]
    fill(x[PULL_TRIAL], 0.0)
    e2, _ = residual(modal, work, k)
    real[FLOOR2] = force_floor(B, modal, work, k)
    copy(x[DELTA], x[PULL_TRIAL])
    keep_state(x)
    copy(x[PULL], x[PULL_OLD])
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


@part_kernel
def accept(B: np.ndarray, modal: Modal, settings: Settings, work: Work, k: int) -> int:
    """Close a sub-step: the last residual still corrects the state, at no evaluation's cost."""
    counts, real, x = work.counts[k], work.real[k], work.x[k]
    h = real[SUBSTEP]
    if counts[MODE] == FIXED and direction(B, modal, settings, work, k):
        move(x[PULL_TRIAL], real[OMEGA], x[DELTA])
        place(x, modal.steps[k, counts[LEVEL]])
    add_work(modal, settings, work, k, h)
    keep_state(x)
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


@part_kernel
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


@part_kernel
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
        begin(modal, settings, work, k, settings.h / (1 << counts[LEVEL]))
