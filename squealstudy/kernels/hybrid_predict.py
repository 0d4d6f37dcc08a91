"""The right-hand side of a hybrid Newmark step, with extrapolated contact forces.

Average acceleration, with J = M + (h beta/2 + h^2/4) K and dv the change of velocity::

    J dv = h/2 B^T (r_0 + r_1) - h K (q_0 + (h/2 + beta) v_0)
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import hybrid_layout as at
from squealstudy.kernels.hybrid_layout import Hybrid, Level, State
from squealstudy.kernels.hybrid_vector import spread
from squealstudy.kernels.jit import fast_kernel, kernel


@fast_kernel
def extrapolate(rows: np.ndarray, first: int, last: int, known: int) -> None:
    """Predict the forces of the rows first to last - 1 into row R, from `known` times (1 to 5).

    Polynomials through 1 to 4 times (constant to cubic); their errors at the last time are the
    backward differences of one order more, and the one that was best then is taken: smooth sliding
    earns a high order, points that just stuck, slid or opened a low one.
    """
    best = 0
    least = np.inf
    for order in range(min(known, at.MOST_TIMES) - 1):
        e2 = 0.0
        for i in range(first, last):
            r1, r2, r3, r4 = (
                rows[at.PAST, i],
                rows[at.PAST + 1, i],
                rows[at.PAST + 2, i],
                rows[at.PAST + 3, i],
            )
            if order == 0:
                e = r1 - r2
            elif order == 1:
                e = r1 - 2.0 * r2 + r3
            elif order == 2:
                e = r1 - 3.0 * r2 + 3.0 * r3 - r4
            else:
                e = r1 - 4.0 * r2 + 6.0 * r3 - 4.0 * r4 + rows[at.PAST + 4, i]
            e2 += e * e
        if e2 < least:
            best, least = order, e2
    for i in range(first, last):
        r1, r2, r3, r4 = (
            rows[at.PAST, i],
            rows[at.PAST + 1, i],
            rows[at.PAST + 2, i],
            rows[at.PAST + 3, i],
        )
        r = r1
        if best == 1:
            r = 2.0 * r1 - r2
        elif best == 2:
            r = 3.0 * (r1 - r2) + r3
        elif best == 3:
            r = 4.0 * (r1 + r3) - 6.0 * r2 - r4
        rows[at.R, i] = r
        rows[at.R_GUESS, i] = r


@kernel
def predict(model: Hybrid, level: Level, state: State, known: int) -> None:
    """Extrapolate the forces from `known` times and leave the right-hand side in row RHS."""
    rows, x = state.rows, state.vectors
    h = level.h
    nb = 3 * state.point.shape[0]
    for first in range(0, nb, 3):
        extrapolate(rows, first, first + 3, known)
    for i in range(nb, rows.shape[1]):
        extrapolate(rows, i, i + 1, known)
    for j in range(x.shape[1]):
        x[at.RHS, j] = -h * (x[at.KQ, j] + (0.5 * h + model.beta) * x[at.KV, j])
    spread(model.B, 0.5 * h, rows[at.LEFT] + rows[at.R], x[at.RHS])
