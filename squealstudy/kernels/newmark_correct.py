"""Corrections of the trial pull: fixed Jacobian with Aitken's factor, and Newton.

A sub-step's end is affine in the pull there, so the residual load + F - pull has a Jacobian that is
one but for forces beyond the reference tangent. Where that is dense, -dR/dpull has forces after q
and v, times the answers LAST_Q and LAST_V of these to the pull, and LU factors (rows pivoted).
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, hot_kernel, part_kernel
from squealstudy.kernels.newmark_forces import tangents
from squealstudy.kernels.newmark_layout import ModalArrays, StepSettings, WorkArrays
from squealstudy.kernels.newmark_stiff import mock_up
from squealstudy.kernels.newmark_vector import copy, fill, move
from squealstudy.kernels.tile import POINTS

OMEGA_MIN, OMEGA_MAX = 0.02, 2.0  # Aitken factor
SHORTEST_NEWTON_STEP = 1e-3
NOT_FACTORED = -1  # in the first pivot


@hot_kernel
def place(x: np.ndarray, E: np.ndarray) -> None:
    """Trial state of a sub-step E (N_STEP, n) that belongs to the trial pull; x (N_ROWS, n)."""
    for j in range(x.shape[1]):
        x[at.Q_TRIAL, j] = x[at.Q_BASE, j] + E[at.LAST_Q, j] * x[at.PULL_TRIAL, j]
        x[at.V_TRIAL, j] = x[at.V_BASE, j] + E[at.LAST_V, j] * x[at.PULL_TRIAL, j]


@hot_kernel
def direction(
    B: np.ndarray, modal: ModalArrays, settings: StepSettings, work: WorkArrays, k: int
) -> bool:
    """Correction from the residual by the fixed Jacobian; False where that is singular."""
    level = work.counts[k, at.HALVING]
    if not settings.dense:
        mock_up(modal, work, k, level)
        return True
    slot = k * (settings.levels + 1) + level
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
def relax(settings: StepSettings, work: WorkArrays, k: int, E: np.ndarray, e2: float) -> None:
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
    B: np.ndarray, modal: ModalArrays, settings: StepSettings, work: WorkArrays, k: int, e2: float
) -> bool:
    """One correction by the fixed Jacobian, relaxed after Aitken; False if it is singular."""
    if not direction(B, modal, settings, work, k):
        return False
    relax(settings, work, k, modal.steps[k, work.counts[k, at.HALVING]], e2)
    return True


@part_kernel
def correct_newton(B: np.ndarray, modal: ModalArrays, work: WorkArrays, k: int, e2: float) -> bool:
    """One correction by a fresh Jacobian; a step that made the residual grow is halved instead."""
    counts, real, x = work.counts[k], work.real[k], work.x[k]
    level = counts[at.HALVING]
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


@fast_kernel
def lu_factor(A: np.ndarray, pivots: np.ndarray) -> bool:
    """Factor A (n, n) in place; `pivots` (n,) int. False for a singular or NaN matrix."""
    n = A.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if not abs(A[best, k]) > 0.0:
            return False
        pivots[k] = best
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            A[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= factor * A[k, j]
    return True


@fast_kernel
def lu_solve(A: np.ndarray, pivots: np.ndarray, x: np.ndarray) -> None:
    """X <- A^-1 x with the factors of `lu_factor`."""
    n = x.size
    for k in range(n):
        p = pivots[k]
        x[k], x[p] = x[p], x[k]
    for i in range(n):
        total = x[i]
        for j in range(i):
            total -= A[i, j] * x[j]
        x[i] = total
    for i in range(n - 1, -1, -1):
        total = x[i]
        for j in range(i + 1, n):
            total -= A[i, j] * x[j]
        x[i] = total / A[i, i]


@fast_kernel
def linear_jacobian(modal: ModalArrays, k: int, level: int, row: np.ndarray, A: np.ndarray) -> None:
    """A of design k without contact beyond the reference tangent; `row` (3, n) is room."""
    component_terms, E = modal.component_terms[k], modal.steps[k, level]
    place, turning = modal.between_of[k], modal.turning_of[k]
    for i in range(A.shape[0]):
        fill(A[i], 0.0)
        A[i, i] = 1.0
        if place >= 0:
            for j in range(A.shape[1]):
                A[i, j] += modal.between[place, i, j] * E[at.LAST_V, j]
        if turning >= 0:
            for j in range(A.shape[1]):
                A[i, j] += modal.turning[turning, i, j] * E[at.LAST_V, j]
    for m in range(modal.shapes.shape[0]):
        d, s, u, answer = component_terms[0, m], component_terms[1, m], modal.shapes[m], row[0]
        for j in range(u.size):
            answer[j] = u[j] * (d * E[at.LAST_V, j] + s * E[at.LAST_Q, j])
        for i in range(A.shape[0]):
            move(A[i], u[i], answer)


@fast_kernel
def add_point(
    A: np.ndarray,
    row: np.ndarray,
    E: np.ndarray,
    D00: float,
    D10: float,
    D11: float,
    D12: float,
    D20: float,
    D22: float,
) -> None:
    """A += row^T D answer with row = [N; T1; T2] (3, n), D01 = D02 = 0 and D21 = D12.

    The answers of gap and velocities to the pull are N LAST_Q, T1 LAST_V, T2 LAST_V.
    """
    for i in range(A.shape[0]):
        b0, b1, b2 = row[0, i], row[1, i], row[2, i]
        x0 = b0 * D00 + b1 * D10 + b2 * D20
        x1 = b1 * D11 + b2 * D12
        x2 = b1 * D12 + b2 * D22
        for j in range(A.shape[1]):
            A[i, j] += E[at.LAST_Q, j] * x0 * row[0, j]
            A[i, j] += E[at.LAST_V, j] * (x1 * row[1, j] + x2 * row[2, j])


@fast_kernel
def point_row(B: np.ndarray, i: int, row: np.ndarray) -> None:
    """[N; T1; T2] of point i (3, n) from the tiles (nt, n, ROWS)."""
    tile, p = B[i // POINTS], i % POINTS
    for c in range(3):
        for j in range(row.shape[1]):
            row[c, j] = tile[j, c * POINTS + p]


@part_kernel
def fixed_jacobian(
    B: np.ndarray, modal: ModalArrays, k: int, level: int, row: np.ndarray, A: np.ndarray
) -> None:
    """The fixed Jacobian, contact factor and tangential mock-up in it (THEORY.md eq. (67)).

    `row` (3, n) is room for one point's rows of B.
    """
    linear_jacobian(modal, k, level, row, A)
    for i in range(modal.fixed.shape[2]):
        normal, tangential = modal.fixed[k, 0, i], modal.fixed[k, 1, i]
        if normal != 0.0 or tangential != 0.0:
            point_row(B, i, row)
            E = modal.steps[k, level]
            add_point(A, row, E, normal, 0.0, tangential, 0.0, 0.0, tangential)


@part_kernel
def true_jacobian(
    B: np.ndarray,
    modal: ModalArrays,
    k: int,
    level: int,
    point: np.ndarray,
    row: np.ndarray,
    A: np.ndarray,
) -> None:
    """The consistent Jacobian of the step at the state `point` (N_POINT, nc) of the points."""
    linear_jacobian(modal, k, level, row, A)
    law, points, E = modal.laws[k], modal.points[k], modal.steps[k, level]
    for i in range(modal.fixed.shape[2]):
        kn, s1, s2, d11, d12, d22 = tangents(law, points, point, i)
        point_row(B, i, row)
        add_point(
            A, row, E, -kn, -s1, -d11, -d12, -s2, -d22
        )  # of the residual, forces on its right
