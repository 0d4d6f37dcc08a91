"""Damping between the coordinates of a design: the one full matrix D of a run.

Its force -D q' is part of the pull: iterations solve for it as for contact forces. D is multiplied
only where forces are evaluated. The work of D over a step, a quadratic form, follows from the
product at the last evaluation, to second order in the correction of the state after it.

Each design reads its D from memory at every evaluation: it is stored in single precision (relative
error 6e-8 of a part of the damping), and only its lower half is read. G, the gyroscopic matrix of a
design that turns, is stored likewise and read whole.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, hot_kernel
from squealstudy.kernels.newmark_layout import ModalArrays, WorkArrays
from squealstudy.kernels.newmark_vector import copy, fill, move

ROWS_AT_ONCE = 4  # rows of D that share a pass over a vector


@fast_kernel
def multiply(D: np.ndarray, v: np.ndarray, u: np.ndarray) -> None:
    """U = D v of a symmetric D (n, n) with zeros on the diagonal, by its lower half."""
    fill(u, 0.0)
    n_in_blocks = v.size - v.size % ROWS_AT_ONCE
    for i in range(n_in_blocks, v.size):
        for j in range(i):
            u[i] += D[i, j] * v[j]
            u[j] += D[i, j] * v[i]
    for i in range(0, n_in_blocks, ROWS_AT_ONCE):
        v0, v1, v2, v3 = v[i], v[i + 1], v[i + 2], v[i + 3]
        u0 = D[i + 1, i] * v1 + D[i + 2, i] * v2 + D[i + 3, i] * v3
        u1 = D[i + 1, i] * v0 + D[i + 2, i + 1] * v2 + D[i + 3, i + 1] * v3
        u2 = D[i + 2, i] * v0 + D[i + 2, i + 1] * v1 + D[i + 3, i + 2] * v3
        u3 = D[i + 3, i] * v0 + D[i + 3, i + 1] * v1 + D[i + 3, i + 2] * v2
        for j in range(i):
            a, b, c, d, x = D[i, j], D[i + 1, j], D[i + 2, j], D[i + 3, j], v[j]
            u0 += a * x
            u1 += b * x
            u2 += c * x
            u3 += d * x
            u[j] += a * v0 + b * v1 + c * v2 + d * v3
        u[i] += u0
        u[i + 1] += u1
        u[i + 2] += u2
        u[i + 3] += u3


@fast_kernel
def subtract_product(G: np.ndarray, v: np.ndarray, u: np.ndarray) -> None:
    """Subtract G v from u, of a full skew-symmetric G (n, n), whose force does no work."""
    for i in range(v.size):
        for j in range(v.size):
            u[i] -= G[i, j] * v[j]


@hot_kernel
def add_damping_forces(modal: ModalArrays, work: WorkArrays, k: int) -> bool:
    """Subtract (D + G) q' of the trial state from row DELTA of design k; False without D and G."""
    damping_row, gyroscopic_row = modal.between_of[k], modal.turning_of[k]
    x = work.x[k]
    if damping_row >= 0:
        copy(x[at.V_TRIAL], x[at.V_SEEN])
        multiply(modal.between[damping_row], x[at.V_SEEN], x[at.RESISTED])
        move(x[at.DELTA], -1.0, x[at.RESISTED])
    if gyroscopic_row >= 0:
        subtract_product(modal.turning[gyroscopic_row], x[at.V_TRIAL], x[at.DELTA])
    return damping_row >= 0 or gyroscopic_row >= 0


@fast_kernel
def damping_power(x: np.ndarray) -> float:
    """q'^T D q' of the trial state of x (N_ROWS, n); D q' is from before its last correction."""
    total = 0.0
    for j in range(x.shape[1]):
        total += (2.0 * x[at.V_TRIAL, j] - x[at.V_SEEN, j]) * x[at.RESISTED, j]
    return total


@fast_kernel
def damping_work(x: np.ndarray, share: float) -> float:
    """Products of D with sums and changes of velocity over a step, weighted as in `add_work`."""
    old_product = 0.0
    mixed_product = 0.0
    for j in range(x.shape[1]):
        v0, v1 = x[at.V, j], x[at.V_TRIAL, j]
        u0, u1 = x[at.RESISTED_OLD, j], x[at.RESISTED, j]
        old_product += (2.0 * v0 - x[at.V_SEEN_OLD, j]) * u0
        mixed_product += v0 * u1 + (v1 - x[at.V_SEEN, j]) * u0
    return (1.0 + share) * (old_product + damping_power(x)) + 2.0 * (1.0 - share) * mixed_product


@hot_kernel
def accept_damping_forces(x: np.ndarray) -> None:
    """Copy velocities and D q' of the trial state of x (N_ROWS, n) to the accepted state."""
    copy(x[at.V_SEEN], x[at.V_SEEN_OLD])
    copy(x[at.RESISTED], x[at.RESISTED_OLD])
