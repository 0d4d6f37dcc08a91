"""Products with the sparse matrices of a hybrid model, and its modes' part of a step."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import hybrid_layout as at
from squealstudy.kernels.hybrid_layout import Hybrid, Sparse, State
from squealstudy.kernels.jit import fast_kernel


@fast_kernel
def multiply(A: Sparse, x: np.ndarray, y: np.ndarray) -> None:
    """Y = A x."""
    for i in range(y.size):
        total = 0.0
        for k in range(A.indptr[i], A.indptr[i + 1]):
            total += A.data[k] * x[A.indices[k]]
        y[i] = total


@fast_kernel
def spread(A: Sparse, factor: float, x: np.ndarray, y: np.ndarray) -> None:
    """Y += factor A^T x, by rows of A."""
    for i in range(x.size):
        if x[i] != 0.0:
            scaled = factor * x[i]
            for k in range(A.indptr[i], A.indptr[i + 1]):
                y[A.indices[k]] += A.data[k] * scaled


@fast_kernel
def modal_force(model: Hybrid, r: np.ndarray, force: np.ndarray) -> None:
    """Force = (B phi)^T r (m,)."""
    force[:] = 0.0
    for i in range(r.size):
        if r[i] != 0.0:
            row = model.B_modes[i]
            for j in range(force.size):
                force[j] += r[i] * row[j]


@fast_kernel
def free_rates(model: Hybrid, state: State, h: float) -> None:
    """Velocities of all modes at the end of a step without forces."""
    modes = state.modes
    for j in range(model.omega2.size):
        w2, c = model.omega2[j], model.c[j]
        c_s = model.beta * w2
        stiff = 1.0 + 0.25 * h * h * w2
        v, v_s = modes[at.RATE, j], modes[at.RATE_S, j]
        pull = h * (w2 * (modes[at.ALPHA, j] + 0.5 * h * v) + c * v)
        pull_s = h * (w2 * (modes[at.ALPHA_S, j] + 0.5 * h * v_s) + c_s * v_s)
        modes[at.RATE_END, j] = v - pull / (stiff + 0.5 * h * c)
        modes[at.RATE_S_END, j] = v_s - pull_s / (stiff + 0.5 * h * c_s)


@fast_kernel
def move_rates(model: Hybrid, state: State, h: float, force: np.ndarray) -> None:
    """Velocities of all modes at the end of a step += those of `force` (m,), from rest."""
    modes = state.modes
    for j in range(force.size):
        stiff = 1.0 + 0.25 * h * h * model.omega2[j]
        impulse = 0.5 * h * force[j]
        modes[at.RATE_END, j] += impulse / (stiff + 0.5 * h * model.c[j])
        modes[at.RATE_S_END, j] += impulse / (stiff + 0.5 * h * model.beta * model.omega2[j])
