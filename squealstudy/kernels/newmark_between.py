"""Damping between the coordinates of a design: the one full matrix D of a run.

Its force -D q' is part of the pull, so that iterations find it as they find contact forces. A step
multiplies with D where forces are evaluated, nowhere else: the work of D over a step is a quadratic
form, which the product at the last evaluation gives to second order in what the state was corrected
by since.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.newmark_layout import ModalArrays, WorkArrays
from squealstudy.kernels.newmark_vector import copy, dot


@fast_kernel
def resist(modal: ModalArrays, work: WorkArrays, k: int) -> bool:
    """Take D q' off row DELTA of design k at its trial state; False where it has no D."""
    place = modal.between_of[k]
    if place < 0:
        return False
    x, D = work.x[k], modal.between[place]
    copy(x[at.V_TRIAL], x[at.V_SEEN])
    for i in range(x.shape[1]):
        force = dot(D[i], x[at.V_SEEN])
        x[at.RESISTED, i] = force
        x[at.DELTA, i] -= force
    return True


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


@fast_kernel
def keep_resisted(x: np.ndarray) -> None:
    """The trial state of x (N_ROWS, n) is accepted."""
    copy(x[at.V_SEEN], x[at.V_SEEN_OLD])
    copy(x[at.RESISTED], x[at.RESISTED_OLD])
