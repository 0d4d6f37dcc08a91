"""Dense Jacobians of a Newmark step and their LU factors (rows pivoted), without exceptions."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.contact_laws import law_at
from squealstudy.kernels.friction_laws import friction_tangent
from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.newmark_layout import Modal
from squealstudy.kernels.newmark_vector import fill, move


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
def linear_jacobian(modal: Modal, k: int, h: float, A: np.ndarray) -> None:
    """A = M + h C / 2 + h^2 K / 4 of design k without contact beyond the reference tangent."""
    modes, tuned = modal.modes[k], modal.tuned[k]
    for i in range(A.shape[0]):
        fill(A[i], 0.0)
        A[i, i] = 1.0 + 0.5 * h * modes[1, i] + 0.25 * h * h * modes[0, i]
    for m in range(modal.shapes.shape[0]):
        weight = 0.5 * h * tuned[0, m] + 0.25 * h * h * tuned[1, m]
        u = modal.shapes[m]
        for i in range(A.shape[0]):
            move(A[i], weight * u[i], u)


@fast_kernel
def add_point(
    A: np.ndarray,
    row: np.ndarray,
    D00: float,
    D10: float,
    D11: float,
    D12: float,
    D20: float,
    D22: float,
) -> None:
    """A += row^T D row with row = [N; T1; T2] (3, n), D01 = D02 = 0 and D21 = D12."""
    for i in range(A.shape[0]):
        b0, b1, b2 = row[0, i], row[1, i], row[2, i]
        x0 = b0 * D00 + b1 * D10 + b2 * D20
        x1 = b1 * D11 + b2 * D12
        x2 = b1 * D12 + b2 * D22
        for j in range(A.shape[1]):
            A[i, j] += x0 * row[0, j] + x1 * row[1, j] + x2 * row[2, j]


@fast_kernel
def fixed_jacobian(B: np.ndarray, modal: Modal, k: int, h: float, A: np.ndarray) -> None:
    """The fixed Jacobian with its contact factor and tangential mock-up (eq. 7), dense."""
    linear_jacobian(modal, k, h, A)
    for i in range(B.shape[0]):
        normal = 0.25 * h * h * modal.fixed[k, 0, i]
        tangential = 0.5 * h * modal.fixed[k, 1, i]
        if normal != 0.0 or tangential != 0.0:
            add_point(A, B[i], normal, 0.0, tangential, 0.0, 0.0, tangential)


@fast_kernel
def true_jacobian(
    B: np.ndarray, modal: Modal, k: int, h: float, trial: np.ndarray, A: np.ndarray
) -> None:
    """The consistent Jacobian of the step at the states `trial` (nc, 6 or more) of the points."""
    linear_jacobian(modal, k, h, A)
    law = modal.laws[k]
    hk, hc = 0.25 * h * h, 0.5 * h
    for i in range(B.shape[0]):
        point, state = modal.points[i], trial[i]
        area, factor = point[1], point[2]
        p, kappa = law_at(int(law[0]), law[1], law[2], point[0] + state[0])
        d11, d12, d22, s1, s2 = friction_tangent(
            int(law[3]), factor * law[4], factor * law[5], law[6], law[7], p, state[1], state[2]
        )
        normal = hk * (area * kappa - point[4])
        push = hk * area * kappa  # dt/dg = -kappa dt/dp, and the residual has -T^T t
        drag = -hc * area
        add_point(A, B[i], normal, push * s1, drag * d11, drag * d12, push * s2, drag * d22)
