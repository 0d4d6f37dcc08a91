"""Beginning and end of a run and of its steps, for the integrators beside Newmark; design 0."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.contact_point import potential
from squealstudy.kernels.integrator_layout import SCALE, X_START
from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.newmark_layout import (
    BLOWN_UP,
    DONE,
    FLOOR2,
    FORCE,
    HALVINGS,
    LEVEL,
    MAX_PASSES,
    NOT_FINITE,
    PASSES,
    POSITION,
    PULL,
    STATUS,
    STEP,
    STEP_PASSES,
    STORED_END,
    STORED_START,
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
from squealstudy.kernels.newmark_output import modal_energy, save, stored_energy
from squealstudy.kernels.newmark_pass import pass_one
from squealstudy.kernels.newmark_step import BIG, ROUND_OFF, start
from squealstudy.kernels.newmark_vector import dot

BLOW_UP = 100.0  # energy (here the kinetic) over all that was put in


@fast_kernel
def open_run(B: np.ndarray, modal: Modal, settings: Settings, work: Work, saved: Saved) -> None:
    """Evaluate the initial state in the trial rows and accept it; the status where that fails."""
    pass_one(B, modal, work, 0)
    if not start(B, modal, settings, work, 0):
        work.counts[0, STATUS] = NOT_FINITE
        return
    real, point, x, modes = work.real[0], work.point[0], work.x[0], modal.modes[0]
    for j in range(x.shape[1]):
        x[A, j] = x[PULL, j] - modes[C, j] * x[V, j] - modes[W2, j] * x[Q, j]
    for i in range(point.shape[1]):
        point[X_START, i] = point[0, i]
    real[STORED_START] = stored_energy(modal, work, 0)
    real[SCALE] = released(modal, settings, work)
    if settings.save_every > 0:
        save(modal, settings, work, saved, 0)


@fast_kernel
def released(modal: Modal, settings: Settings, work: Work) -> float:
    """Energy [J] that the initial state may set free, and that of a step under all its forces."""
    real, law, points, point = work.real[0], modal.laws[0], modal.points[0], work.point[0]
    total = abs(real[STORED_START]) + modal_energy(work.x[0], modal.modes[0, W2])
    for i in range(point.shape[1]):
        gap = points[0, i] + point[0, i]
        total += points[1, i] * potential(int(law[0]), law[1], law[2], gap)
    return total + 0.5 * settings.h * settings.h * real[FLOOR2] / (ROUND_OFF * ROUND_OFF)


@fast_kernel
def count_pass(work: Work) -> None:
    """One more evaluation of the contact forces."""
    work.counts[0, STEP_PASSES] += 1
    work.counts[0, PASSES] += 1


@fast_kernel
def part_done(settings: Settings, counts: np.ndarray) -> bool:
    """Count an accepted sub-step; whether it ends a whole step."""
    counts[POSITION] += 1 << (settings.max_halvings - counts[LEVEL])
    if counts[POSITION] < 1 << settings.max_halvings:
        return False
    counts[POSITION] = 0
    counts[LEVEL] = 0
    counts[STEP] += 1
    return True


@fast_kernel
def halve(settings: Settings, counts: np.ndarray, reason: int) -> None:
    """After a failed sub-step: try half of it, or stop with the reason."""
    if counts[LEVEL] < settings.max_halvings:
        counts[LEVEL] += 1
        counts[HALVINGS] += 1
    else:
        counts[STATUS] = reason


@fast_kernel
def finite(x: np.ndarray) -> bool:
    """False where the squares of x (n,) overflow or are NaN."""
    return dot(x, x) < BIG


@fast_kernel
def shown(settings: Settings, step: int) -> bool:
    """Whether the state after `step` steps leaves the kernel."""
    if step == settings.n_steps:
        return True
    return settings.save_every > 0 and step % settings.save_every == 0


@fast_kernel
def close_step(modal: Modal, settings: Settings, work: Work, saved: Saved) -> None:
    """Judge, save and end after the accepted state of a whole step that was counted in STEP."""
    counts, real, v = work.counts[0], work.real[0], work.x[0, V]
    counts[MAX_PASSES] = max(counts[MAX_PASSES], counts[STEP_PASSES])
    counts[STEP_PASSES] = 0
    kinetic = 0.5 * dot(v, v)
    if not (kinetic < BIG and finite(work.x[0, FORCE])):
        counts[STATUS] = NOT_FINITE
    elif kinetic > BLOW_UP * (real[SCALE] + abs(real[W_LOAD]) + abs(real[W_BELT])):
        counts[STATUS] = BLOWN_UP
    else:
        if settings.save_every > 0 and counts[STEP] % settings.save_every == 0:
            save(modal, settings, work, saved, 0)
        if counts[STEP] == settings.n_steps:
            counts[STATUS] = DONE
            real[STORED_END] = stored_energy(modal, work, 0)
