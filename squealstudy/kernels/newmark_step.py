"""One design point between two evaluations of its contact forces (THEORY.md eq. (66)).

Every design has its own time, sub-step, iteration and status; an evaluation at its trial state
(`pass_one` or the batched pass) is followed by `advance`, which accepts, corrects, halves or stops
and leaves the next trial state. Designs therefore cannot disturb each other.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, hot_kernel, part_kernel
from squealstudy.kernels.newmark_between import accept_damping_forces
from squealstudy.kernels.newmark_correct import (
    correct_fixed,
    correct_newton,
    direction,
    place,
    point_row,
)
from squealstudy.kernels.newmark_forces import all_forces, friction_change, residual
from squealstudy.kernels.newmark_layout import ModalArrays, SavedArrays, StepSettings, WorkArrays
from squealstudy.kernels.newmark_output import (
    add_sums,
    add_work,
    begin_sums,
    save,
    stored_energy,
)
from squealstudy.kernels.newmark_vector import copy, dot, move
from squealstudy.kernels.regimes import find_regimes, meets_corner
from squealstudy.kernels.spring_points import typical_mu

MAX_FINITE_SQUARE = 1e290  # squares at or beyond it, and NaN, are not finite
EQUAL_STEPS = 4  # sub-steps of one length before they grow again
# forces below this share of the contact forces at the start mean nothing
NEGLIGIBLE_FORCE_RATIO = 1e-12
# what a design does next
GO_ON, BEGIN, CLOSE = 0, 1, 2


@hot_kernel
def predict(x: np.ndarray, E: np.ndarray, ratio: float) -> None:
    """What a sub-step of coefficients E (N_STEP, n) does without the new pull; a trial state.

    The pull is extrapolated over `ratio` times the last sub-step: the diagonal system is solved
    for it as the method does that for any, and only the pull needs iterations.
    """
    for j in range(x.shape[1]):
        q, v, pull = x[at.Q, j], x[at.V, j], x[at.PULL, j]
        x[at.Q_BASE, j] = E[at.QQ, j] * q + E[at.QV, j] * v + E[at.FIRST_Q, j] * pull
        x[at.V_BASE, j] = E[at.VQ, j] * q + E[at.VV, j] * v + E[at.FIRST_V, j] * pull
        x[at.PULL_TRIAL, j] = pull + ratio * (pull - x[at.PULL_OLD, j])
    place(x, E)


@hot_kernel
def keep_state(x: np.ndarray) -> None:
    """Accept the trial state: it becomes the state that the next step starts from."""
    accept_damping_forces(x)
    for j in range(x.shape[1]):
        x[at.Q, j], x[at.V, j] = x[at.Q_TRIAL, j], x[at.V_TRIAL, j]
        x[at.PULL_OLD, j] = x[at.PULL, j]
        x[at.PULL, j] = x[at.PULL_TRIAL, j]


@hot_kernel
def guess_friction(point: np.ndarray, nc: int, h: float) -> None:
    """Friction forces of nc points (N_POINT, ..) a time h after the accepted ones."""
    for i in range(nc):
        point[at.GUESS_1, i] = point[at.OLD_T1, i] + h * point[at.RATE_1, i]
        point[at.GUESS_2, i] = point[at.OLD_T2, i] + h * point[at.RATE_2, i]


@hot_kernel
def open_part(settings: StepSettings, work: WorkArrays, k: int, nc: int, h: float) -> float:
    """Open a sub-step h; its ratio to the last one, to extrapolate the pull by, or 0."""
    counts, real = work.counts[k], work.real[k]
    known = settings.extrapolate and real[at.SUBSTEP_OLD] > 0.0
    real[at.SUBSTEP], real[at.OMEGA] = h, 1.0
    real[at.STEP_LENGTH], real[at.E2_OLD] = 1.0, 0.0
    counts[at.ITERATION] = 0
    later = h if settings.extrapolate else 0.0
    guess_friction(work.point[k], nc, later)
    return h / real[at.SUBSTEP_OLD] if known else 0.0


@fast_kernel
def lengthen(settings: StepSettings, counts: np.ndarray) -> None:
    """Double the next sub-step, where it then ends on the grid: steps grow again after a corner.

    Friction that begins to stick settles as exp(-k_t |T|^2 t). The trapezoidal rule answers with
    (1 - z/2) / (1 + z/2) at a sub-step of z such times, wrong by z^3 / 12 of what is left. Of four
    sub-steps of each length those before have left exp(-4 z), of two exp(-2 z): at most .0018 of
    it is wrong, .014 with two, whatever the step.
    """
    counts[at.EQUAL] += 1
    longer = counts[at.HALVING] - 1
    if longer < 0 or counts[at.EQUAL] < EQUAL_STEPS:
        return
    if counts[at.POSITION] % (1 << (settings.levels - longer)) == 0:
        counts[at.HALVING] = longer
        counts[at.EQUAL] = 0


@fast_kernel
def part_done(settings: StepSettings, counts: np.ndarray) -> bool:
    """Count an accepted sub-step; whether it ends a whole step."""
    counts[at.POSITION] += 1 << (settings.levels - counts[at.HALVING])
    whole = counts[at.POSITION] == 1 << settings.levels
    if whole:
        counts[at.POSITION] = 0
    if settings.corner_halvings > 0:
        lengthen(settings, counts)
    elif whole:
        counts[at.HALVING] = 0
    if not whole:
        return False
    counts[at.STEP] += 1
    return True


@fast_kernel
def halved(settings: StepSettings, counts: np.ndarray) -> bool:
    """Halve the sub-step after it failed; False where it is the shortest."""
    if counts[at.HALVING] >= settings.max_halvings:
        return False
    counts[at.HALVING] += 1
    counts[at.HALVINGS] += 1
    counts[at.EQUAL] = 0
    return True


@fast_kernel
def count_pass(counts: np.ndarray) -> None:
    """One more evaluation of the contact forces."""
    counts[at.STEP_PASSES] += 1
    counts[at.PASSES] += 1


@fast_kernel
def close_passes(counts: np.ndarray) -> None:
    """The evaluations of a whole step that ends."""
    counts[at.MAX_PASSES] = max(counts[at.MAX_PASSES], counts[at.STEP_PASSES])
    counts[at.STEP_PASSES] = 0


@part_kernel
def begin(modal: ModalArrays, settings: StepSettings, work: WorkArrays, k: int, h: float) -> None:
    """Open a sub-step h from the accepted state, with a trial state."""
    ratio = open_part(settings, work, k, modal.fixed.shape[2], h)
    predict(work.x[k], modal.steps[k, work.counts[k, at.HALVING]], ratio)


@hot_kernel
def keep_points(point: np.ndarray, nc: int, h: float) -> None:
    """The trial state of nc points (N_POINT, ..) is accepted; slopes over h, none for h = 0."""
    rate = 1.0 / h if h > 0.0 else 0.0
    for i in range(nc):
        point[at.RATE_1, i] = (point[at.OUT_T1, i] - point[at.OLD_T1, i]) * rate
        point[at.RATE_2, i] = (point[at.OUT_T2, i] - point[at.OLD_T2, i]) * rate
        point[at.OLD_W1, i] = point[at.OUT_W1, i]
        point[at.OLD_W2, i] = point[at.OUT_W2, i]
        point[at.OLD_T1, i] = point[at.OUT_T1, i]
        point[at.OLD_T2, i] = point[at.OUT_T2, i]
        point[at.REGIME, i] = point[at.OUT_REGIME, i]


@fast_kernel
def force_floor(B: np.ndarray, modal: ModalArrays, work: WorkArrays, k: int) -> float:
    """Square of the force that rounding leaves in sums over the contact points."""
    load = modal.modes[k, at.LOAD]
    total = dot(load, load)
    point, points = work.point[k], modal.points[k]
    for i in range(modal.fixed.shape[2]):
        normal = points[at.POINT_AREA, i] * point[at.OUT_P, i]
        drag = points[at.POINT_FRICTION, i] * typical_mu(modal.laws[k], points, i) * normal
        point_row(B, i, work.row)
        N, T1, T2 = work.row[0], work.row[1], work.row[2]
        total += dot(N, N) * normal * normal + (dot(T1, T1) + dot(T2, T2)) * drag * drag
    return NEGLIGIBLE_FORCE_RATIO * NEGLIGIBLE_FORCE_RATIO * total


@part_kernel
def start(
    B: np.ndarray, modal: ModalArrays, settings: StepSettings, work: WorkArrays, k: int
) -> bool:
    """Pull of the initial state from the first evaluation; False if it is not finite."""
    x, real = work.x[k], work.real[k]
    e2, _ = all_forces(modal, work, k)
    real[at.FLOOR2] = force_floor(B, modal, work, k)
    copy(x[at.DELTA], x[at.PULL_TRIAL])
    keep_state(x)
    copy(x[at.PULL], x[at.PULL_OLD])
    find_regimes(modal.points[k], modal.laws[k], work.point[k], modal.fixed.shape[2])
    keep_points(work.point[k], modal.fixed.shape[2], 0.0)
    begin_sums(modal, work, k)
    work.counts[k, at.MODE] = at.NEWTON if settings.newton else at.FIXED
    return e2 < MAX_FINITE_SQUARE


@fast_kernel
def fail(settings: StepSettings, counts: np.ndarray, reason: int) -> int:
    """After a failed iteration: halve, then a fresh Jacobian, then stop with the reason."""
    if not halved(settings, counts):
        if counts[at.MODE] == at.FIXED:
            counts[at.MODE] = at.NEWTON
        else:
            counts[at.STATUS] = reason
    return BEGIN


@part_kernel
def accept(
    B: np.ndarray, modal: ModalArrays, settings: StepSettings, work: WorkArrays, k: int
) -> int:
    """Close a sub-step: the last residual still corrects the state, at no evaluation's cost."""
    counts, real, x = work.counts[k], work.real[k], work.x[k]
    h = real[at.SUBSTEP]
    if counts[at.MODE] == at.FIXED and direction(B, modal, settings, work, k):
        move(x[at.PULL_TRIAL], real[at.OMEGA], x[at.DELTA])
        place(x, modal.steps[k, counts[at.HALVING]])
    add_work(modal, settings, work, k, h)
    keep_state(x)
    real[at.SUBSTEP_OLD] = h
    keep_points(work.point[k], modal.fixed.shape[2], h)
    add_sums(modal, settings, work, k, h)
    counts[at.MODE] = at.NEWTON if settings.newton else at.FIXED
    if not part_done(settings, counts):
        return BEGIN
    close_passes(counts)
    if counts[at.STEP] == settings.n_steps:
        counts[at.STATUS] = at.DONE
    return CLOSE


@part_kernel
def iterate(
    B: np.ndarray, modal: ModalArrays, settings: StepSettings, work: WorkArrays, k: int
) -> int:
    """Judge an evaluation and correct, accept or give up; what to do next."""
    counts, real = work.counts[k], work.real[k]
    counts[at.ITERATION] += 1
    count_pass(counts)
    e2, scale2 = residual(modal, work, k)
    change2, bound2 = friction_change(modal, work, k)
    if not (e2 < MAX_FINITE_SQUARE and scale2 < MAX_FINITE_SQUARE and change2 < MAX_FINITE_SQUARE):
        return fail(settings, counts, at.NOT_FINITE)
    balanced = e2 <= settings.tolerance * settings.tolerance * scale2 + real[at.FLOOR2]
    if balanced and change2 <= settings.tolerance_t * settings.tolerance_t * bound2:
        points, point, nc = modal.points[k], work.point[k], modal.fixed.shape[2]
        find_regimes(points, modal.laws[k], point, nc)
        if counts[at.HALVING] < settings.corner_halvings and meets_corner(points, point, nc):
            counts[at.HALVING] += 1
            counts[at.CUTS] += 1
            counts[at.EQUAL] = 0
            return BEGIN
        return accept(B, modal, settings, work, k)
    if counts[at.ITERATION] >= settings.max_iterations:
        return fail(settings, counts, at.NOT_CONVERGED)
    if counts[at.MODE] == at.FIXED:
        solved = correct_fixed(B, modal, settings, work, k, e2)
    else:
        solved = correct_newton(B, modal, work, k, e2)
    return GO_ON if solved else fail(settings, counts, at.SINGULAR)


@part_kernel
def advance(
    B: np.ndarray,
    modal: ModalArrays,
    settings: StepSettings,
    work: WorkArrays,
    saved: SavedArrays,
    k: int,
) -> None:
    """After an evaluation at the trial state of design k: its next trial state, or its end."""
    counts = work.counts[k]
    if counts[at.MODE] == at.START:
        if not start(B, modal, settings, work, k):
            counts[at.STATUS] = at.NOT_FINITE
            return
        work.real[k, at.STORED_START] = stored_energy(modal, work, k)
        then = CLOSE
    else:
        then = iterate(B, modal, settings, work, k)
    if then == CLOSE and settings.save_every > 0 and counts[at.STEP] % settings.save_every == 0:
        save(modal, settings, work, saved, k)
    if counts[at.STATUS] == at.DONE:
        work.real[k, at.STORED_END] = stored_energy(modal, work, k)
    if counts[at.STATUS] == at.RUNNING and then != GO_ON:
        begin(modal, settings, work, k, settings.h / (1 << counts[at.HALVING]))
