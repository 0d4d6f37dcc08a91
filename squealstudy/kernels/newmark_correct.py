"""Corrections of the trial pull: fixed Jacobian with Aitken's factor, and Newton.

A sub-step's end is affine in the pull there, so the residual load + F - pull has a Jacobian that is
one but for forces beyond the reference tangent.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, part_kernel
from squealstudy.kernels.newmark_dense import fixed_jacobian, lu_factor, lu_solve, true_jacobian
from squealstudy.kernels.newmark_layout import Modal, Settings, Work
from squealstudy.kernels.newmark_stiff import mock_up
from squealstudy.kernels.newmark_vector import copy, move

OMEGA_MIN, OMEGA_MAX = 0.02, 2.0  # Aitken factor
SHORTEST_NEWTON_STEP = 1e-3
NOT_FACTORED = -1  # in the first pivot


@fast_kernel
def place(x: np.ndarray, E: np.ndarray) -> None:
    """Trial state of a sub-step E (N_STEP, n) that belongs to the trial pull; x (N_ROWS, n)."""
    for j in range(x.shape[1]):
        x[at.Q_TRIAL, j] = x[at.Q_BASE, j] + E[at.LAST_Q, j] * x[at.PULL_TRIAL, j]
        x[at.V_TRIAL, j] = x[at.V_BASE, j] + E[at.LAST_V, j] * x[at.PULL_TRIAL, j]


@fast_kernel
def direction(B: np.ndarray, modal: Modal, settings: Settings, work: Work, k: int) -> bool:
    """Correction from the residual by the fixed Jacobian; False where that is singular."""
    level = work.counts[k, at.LEVEL]
    if not settings.dense:
        mock_up(modal, work, k, level)
        return True
    slot = k * (settings.max_halvings + 1) + level
    lu, pivots = work.lu[slot], work.pivots[slot]
    if pivots[0] == NOT_FACTORED:
        fixed_jacobian(B, modal, k, level, work.row, lu)
        if not lu_factor(lu, pivots):
            pivots[0] = NOT_FACTORED
            return False
    lu_solve(lu, pivots, work.x[k, at.DELTA])
    return True


@fast_kernel
def aitken(delta: np.ndarray, delta_old: np.ndarray, answer: np.ndarray, omega: float) -> float:
    """The next relaxation factor from two successive corrections, compared by `answer` to them.

    In velocities: stiff modes, which hardly answer to a pull, must not decide.
    """
    top = 0.0
    bottom = 0.0
    for j in range(delta.size):
        old = answer[j] * delta_old[j]
        change = answer[j] * delta[j] - old
        top += old * change
        bottom += change * change
    if not bottom > 0.0:
        return omega
    return min(max(-omega * top / bottom, OMEGA_MIN), OMEGA_MAX)


@fast_kernel
def relax(settings: Settings, work: Work, k: int, E: np.ndarray, e2: float) -> None:
    """Add the correction in row DELTA to the trial pull, relaxed after Aitken; E as in `place`."""
    counts, real, x = work.counts[k], work.real[k], work.x[k]
    if counts[at.ITERATION] == 2 and real[at.E2_OLD] > real[at.FLOOR2]:
        real[at.CONTRACTION] = max(real[at.CONTRACTION], (e2 / real[at.E2_OLD]) ** 0.5)
    if settings.aitken and counts[at.ITERATION] > 1:
        real[at.OMEGA] = aitken(x[at.DELTA], x[at.DELTA_OLD], E[at.LAST_V], real[at.OMEGA])
    copy(x[at.DELTA], x[at.DELTA_OLD])
    move(x[at.PULL_TRIAL], real[at.OMEGA], x[at.DELTA])
    place(x, E)
    real[at.E2_OLD] = e2


@part_kernel
def correct_fixed(
    B: np.ndarray, modal: Modal, settings: Settings, work: Work, k: int, e2: float
) -> bool:
    """One correction by the fixed Jacobian, relaxed after Aitken; False if it is singular."""
    if not direction(B, modal, settings, work, k):
        return False
    relax(settings, work, k, modal.steps[k, work.counts[k, at.LEVEL]], e2)
    return True


@part_kernel
def correct_newton(B: np.ndarray, modal: Modal, work: Work, k: int, e2: float) -> bool:
    """One correction by a fresh Jacobian; a step that made the residual grow is halved instead."""
    counts, real, x = work.counts[k], work.real[k], work.x[k]
    level = counts[at.LEVEL]
    if (
        counts[at.ITERATION] > 1
        and e2 > real[at.E2_OLD]
        and real[at.STEP_LENGTH] > SHORTEST_NEWTON_STEP
    ):
        real[at.STEP_LENGTH] *= 0.5
        move(x[at.PULL_TRIAL], -real[at.STEP_LENGTH], x[at.DELTA_OLD])
        place(x, modal.steps[k, level])
        return True
    jacobian, pivots = work.lu[-1], work.pivots[-1]
    true_jacobian(B, modal, k, level, work.point[k], work.row, jacobian)
    counts[at.NEWTON_STEPS] += 1
    if not lu_factor(jacobian, pivots):
        return False
    lu_solve(jacobian, pivots, x[at.DELTA])
    copy(x[at.DELTA], x[at.DELTA_OLD])
    real[at.STEP_LENGTH] = 1.0
    real[at.E2_OLD] = e2
    move(x[at.PULL_TRIAL], 1.0, x[at.DELTA])
    place(x, modal.steps[k, level])
    return True
