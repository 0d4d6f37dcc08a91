"""Beginning and end of a run and of its steps, for the integrators beside Newmark; design 0."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.newmark_forces import pass_one
from squealstudy.kernels.newmark_layout import (
    SCALE,
    X_START,
    ModalArrays,
    SavedArrays,
    StepSettings,
    WorkArrays,
)
from squealstudy.kernels.newmark_output import modal_energy, save, stored_energy
from squealstudy.kernels.newmark_step import (
    MAX_FINITE_SQUARE,
    NEGLIGIBLE_FORCE_RATIO,
    close_passes,
    start,
)
from squealstudy.kernels.newmark_vector import dot
from squealstudy.kernels.spring_points import energy_of

BLOW_UP = 100.0  # energy (here the kinetic) over all that was put in


@fast_kernel
def open_run(
    B: np.ndarray, modal: ModalArrays, settings: StepSettings, work: WorkArrays, saved: SavedArrays
) -> None:
    """Evaluate the initial state in the trial rows and accept it; the status where that fails."""
    pass_one(B, modal, work, 0)
    if not start(B, modal, settings, work, 0):
        work.counts[0, at.STATUS] = at.NOT_FINITE
        return
    real, point, x, modes = work.real[0], work.point[0], work.x[0], modal.modes[0]
    for j in range(x.shape[1]):
        x[at.A, j] = x[at.PULL, j] - modes[at.C, j] * x[at.V, j] - modes[at.W2, j] * x[at.Q, j]
    for i in range(point.shape[1]):
        point[X_START, i] = point[at.OUT_X, i]
    real[at.STORED_START] = stored_energy(modal, work, 0)
    real[SCALE] = released(modal, settings, work)
    if settings.save_every > 0:
        save(modal, settings, work, saved, 0)


@fast_kernel
def released(modal: ModalArrays, settings: StepSettings, work: WorkArrays) -> float:
    """Energy [J] that the initial state may set free, and that of a step under all its forces."""
    real, law, points, point = work.real[0], modal.laws[0], modal.points[0], work.point[0]
    total = abs(real[at.STORED_START]) + modal_energy(work.x[0], modal.modes[0, at.W2])
    for i in range(point.shape[1]):
        total += points[at.POINT_AREA, i] * energy_of(law, points, i, point[at.OUT_X, i])
    return total + 0.5 * settings.h * settings.h * real[at.FLOOR2] / (
        NEGLIGIBLE_FORCE_RATIO * NEGLIGIBLE_FORCE_RATIO
    )


@fast_kernel
def finite(x: np.ndarray) -> bool:
    """False where the squares of x (n,) overflow or are NaN."""
    return dot(x, x) < MAX_FINITE_SQUARE


@fast_kernel
def shown(settings: StepSettings, step: int) -> bool:
    """Whether the state after `step` steps leaves the kernel."""
    if step == settings.n_steps:
        return True
    return settings.save_every > 0 and step % settings.save_every == 0


@fast_kernel
def close_step(
    modal: ModalArrays, settings: StepSettings, work: WorkArrays, saved: SavedArrays
) -> None:
    """Judge, save and end after the accepted state of a whole step that was counted in STEP."""
    counts, real, v = work.counts[0], work.real[0], work.x[0, at.V]
    close_passes(counts)
    kinetic = 0.5 * dot(v, v)
    if not (kinetic < MAX_FINITE_SQUARE and finite(work.x[0, at.FORCE])):
        counts[at.STATUS] = at.NOT_FINITE
    elif kinetic > BLOW_UP * (
        real[SCALE] + abs(real[at.W_LOAD]) + abs(real[at.W_BELT]) + max(-real[at.D_DAMPING], 0.0)
    ):
        counts[at.STATUS] = at.BLOWN_UP
    else:
        if settings.save_every > 0 and counts[at.STEP] % settings.save_every == 0:
            save(modal, settings, work, saved, 0)
        if counts[at.STEP] == settings.n_steps:
            counts[at.STATUS] = at.DONE
            real[at.STORED_END] = stored_energy(modal, work, 0)
