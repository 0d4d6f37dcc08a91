"""Corrections of the trial acceleration: fixed Jacobian with Aitken's factor, and Newton."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.newmark_dense import fixed_jacobian, lu_factor, lu_solve, true_jacobian
from squealstudy.kernels.newmark_layout import (
    A_TRIAL,
    CONTRACTION,
    DELTA,
    DELTA_OLD,
    E2_OLD,
    FLOOR2,
    ITERATION,
    LEVEL,
    NEWTON_STEPS,
    OMEGA,
    Q_BASE,
    Q_TRIAL,
    STEP_LENGTH,
    SUBSTEP,
    V_BASE,
    V_TRIAL,
    W2,
    C,
    Modal,
    Settings,
    Work,
)
from squealstudy.kernels.newmark_stiff import mock_up
from squealstudy.kernels.newmark_vector import copy, move

OMEGA_MIN, OMEGA_MAX = 0.02, 2.0  # Aitken factor
SHORTEST_NEWTON_STEP = 1e-3
NOT_FACTORED = -1  # in the first pivot


@fast_kernel
def place(x: np.ndarray, b_q: float, b_v: float) -> None:
    """Trial displacement and velocity that belong to the trial acceleration; x (N_ROWS, n).

    Their derivatives after it are b_q [s2] and b_v [s]: h^2/4 and h/2 of average acceleration.
    """
    for j in range(x.shape[1]):
        x[Q_TRIAL, j] = x[Q_BASE, j] + b_q * x[A_TRIAL, j]
        x[V_TRIAL, j] = x[V_BASE, j] + b_v * x[A_TRIAL, j]


@fast_kernel
def divide(delta: np.ndarray, modes: np.ndarray, b_q: float, b_v: float) -> None:
    """Correction from the residual by the diagonal Jacobian; b_q, b_v as in `place`."""
    for j in range(delta.size):
        delta[j] /= 1.0 + b_v * modes[C, j] + b_q * modes[W2, j]


@fast_kernel
def direction(B: np.ndarray, modal: Modal, settings: Settings, work: Work, k: int) -> bool:
    """Correction from the residual by the fixed Jacobian; False where that is singular."""
    h = work.real[k, SUBSTEP]
    delta = work.x[k, DELTA]
    if not settings.dense:
        divide(delta, modal.modes[k], 0.25 * h * h, 0.5 * h)
        mock_up(modal, work, k, 0.25 * h * h, 0.5 * h)
        return True
    at = k * (settings.max_halvings + 1) + work.counts[k, LEVEL]
    lu, pivots = work.lu[at], work.pivots[at]
    if pivots[0] == NOT_FACTORED:
        fixed_jacobian(B, modal, k, h, work.row, lu)
        if not lu_factor(lu, pivots):
            pivots[0] = NOT_FACTORED
            return False
    lu_solve(lu, pivots, delta)
    return True


@fast_kernel
def aitken(delta: np.ndarray, delta_old: np.ndarray, omega: float) -> float:
    """The next relaxation factor from two successive corrections."""
    top = 0.0
    bottom = 0.0
    for j in range(delta.size):
        change = delta[j] - delta_old[j]
        top += delta_old[j] * change
        bottom += change * change
    if not bottom > 0.0:
        return omega
    return min(max(-omega * top / bottom, OMEGA_MIN), OMEGA_MAX)


@fast_kernel
def relax(settings: Settings, work: Work, k: int, e2: float) -> None:
    """Add the correction in row DELTA to the trial acceleration, relaxed after Aitken."""
    counts, real, x = work.counts[k], work.real[k], work.x[k]
    if counts[ITERATION] == 2 and real[E2_OLD] > real[FLOOR2]:
        real[CONTRACTION] = max(real[CONTRACTION], (e2 / real[E2_OLD]) ** 0.5)
    if settings.aitken and counts[ITERATION] > 1:
        real[OMEGA] = aitken(x[DELTA], x[DELTA_OLD], real[OMEGA])
    copy(x[DELTA], x[DELTA_OLD])
    move(x[A_TRIAL], real[OMEGA], x[DELTA])
    real[E2_OLD] = e2


@fast_kernel
def correct_fixed(
    B: np.ndarray, modal: Modal, settings: Settings, work: Work, k: int, e2: float
) -> bool:
    """One correction by the fixed Jacobian, relaxed after Aitken; False if it is singular."""
    if not direction(B, modal, settings, work, k):
        return False
    relax(settings, work, k, e2)
    h = work.real[k, SUBSTEP]
    place(work.x[k], 0.25 * h * h, 0.5 * h)
    return True


@fast_kernel
def correct_newton(B: np.ndarray, modal: Modal, work: Work, k: int, e2: float) -> bool:
    """One correction by a fresh Jacobian; a step that made the residual grow is halved instead."""
    counts, real, x = work.counts[k], work.real[k], work.x[k]
    h = real[SUBSTEP]
    if counts[ITERATION] > 1 and e2 > real[E2_OLD] and real[STEP_LENGTH] > SHORTEST_NEWTON_STEP:
        real[STEP_LENGTH] *= 0.5
        move(x[A_TRIAL], -real[STEP_LENGTH], x[DELTA_OLD])
        place(x, 0.25 * h * h, 0.5 * h)
        return True
    jacobian, pivots = work.lu[-1], work.pivots[-1]
    true_jacobian(B, modal, k, h, work.point[k], work.row, jacobian)
    counts[NEWTON_STEPS] += 1
    if not lu_factor(jacobian, pivots):
        return False
    lu_solve(jacobian, pivots, x[DELTA])
    copy(x[DELTA], x[DELTA_OLD])
    real[STEP_LENGTH] = 1.0
    real[E2_OLD] = e2
    move(x[A_TRIAL], 1.0, x[DELTA])
    place(x, 0.25 * h * h, 0.5 * h)
    return True
