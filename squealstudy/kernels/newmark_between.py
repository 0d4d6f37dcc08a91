"""Damping between the coordinates of a design: the one full matrix D of a run.

Its force -D q' is part of the pull, so that iterations find it as they find contact forces. A step
multiplies with D where forces are evaluated, nowhere else: the work of D over a step is a quadratic
form, which the product at the last evaluation gives to second order in what the state was corrected
by since.

D is read from memory at every evaluation, by each design of a batch its own: it is kept in single
precision (entries to 6e-8, of a part of the damping) and its lower half alone is read.

So is G, the gyroscopic matrix of a design that turns, which is read whole.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, hot_kernel
from squealstudy.kernels.newmark_layout import ModalArrays, WorkArrays
from squealstudy.kernels.newmark_vector import copy, fill, move

ROWS_AT_ONCE = 4


@fast_kernel
def multiply(D: np.ndarray, v: np.ndarray, u: np.ndarray) -> None:
    """U = D v of a symmetric D (n, n) with zeros on the diagonal, by its lower half."""
    fill(u, 0.0)
    whole = v.size - v.size % ROWS_AT_ONCE
    for i in range(whole, v.size):
        for j in range(i):
            u[i] += D[i, j] * v[j]
            u[j] += D[i, j] * v[i]
    for i in range(0, whole, ROWS_AT_ONCE):
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
def turn(G: np.ndarray, v: np.ndarray, u: np.ndarray) -> None:
    """Take G v off u, of a full G (n, n): it does no work, and counts in none."""
    for i in range(v.size):
        for j in range(v.size):
            u[i] -= G[i, j] * v[j]


@hot_kernel
def resist(modal: ModalArrays, work: WorkArrays, k: int) -> bool:
    """Take (D + G) q' off row DELTA of design k at its trial state; False where it has neither."""
    place, turning = modal.between_of[k], modal.turning_of[k]
    x = work.x[k]
    if place >= 0:
        copy(x[at.V_TRIAL], x[at.V_SEEN])
        multiply(modal.between[place], x[at.V_SEEN], x[at.RESISTED])
        move(x[at.DELTA], -1.0, x[at.RESISTED])
    if turning >= 0:
        turn(modal.turning[turning], x[at.V_TRIAL], x[at.DELTA])
    return place >= 0 or turning >= 0


@fast_kernel
def resisted_power(x: np.ndarray) -> float:
    """q'^T D q' in the trial state of x (N_ROWS, n), evaluated before its last correction."""
    total = 0.0
    for j in range(x.shape[1]):
        total += (2.0 * x[at.V_TRIAL, j] - x[at.V_SEEN, j]) * x[at.RESISTED, j]
    return total


@fast_kernel
def resisted_work(x: np.ndarray, share: float) -> float:
    """Products of D with sums and changes of velocity over a step, as `add_work` weighs them."""
    before = 0.0
    both = 0.0
    for j in range(x.shape[1]):
        v0, v1 = x[at.V, j], x[at.V_TRIAL, j]
        u0, u1 = x[at.RESISTED_OLD, j], x[at.RESISTED, j]
        before += (2.0 * v0 - x[at.V_SEEN_OLD, j]) * u0
        both += v0 * u1 + (v1 - x[at.V_SEEN, j]) * u0
    return (1.0 + share) * (before + resisted_power(x)) + 2.0 * (1.0 - share) * both


@hot_kernel
def keep_resisted(x: np.ndarray) -> None:
    """The trial state of x (N_ROWS, n) is accepted."""
    copy(x[at.V_SEEN], x[at.V_SEEN_OLD])
    copy(x[at.RESISTED], x[at.RESISTED_OLD])
