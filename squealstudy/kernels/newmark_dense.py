"""Dense Jacobians of a step after its new pull, and their LU factors (rows pivoted).

-dR/dpull has forces after q and v, times the answers LAST_Q and LAST_V of these to the pull.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.contact_point import tangents
from squealstudy.kernels.jit import fast_kernel, part_kernel
from squealstudy.kernels.newmark_layout import Modal
from squealstudy.kernels.newmark_vector import fill, move
from squealstudy.kernels.tile import POINTS


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
def linear_jacobian(modal: Modal, k: int, level: int, row: np.ndarray, A: np.ndarray) -> None:
    """A of design k without contact beyond the reference tangent; `row` (3, n) is room."""
    tuned, E = modal.tuned[k], modal.steps[k, level]
    for i in range(A.shape[0]):
        fill(A[i], 0.0)
        A[i, i] = 1.0
    for m in range(modal.shapes.shape[0]):
        d, s, u, answer = tuned[0, m], tuned[1, m], modal.shapes[m], row[0]
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
    B: np.ndarray, modal: Modal, k: int, level: int, row: np.ndarray, A: np.ndarray
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
    modal: Modal,
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
