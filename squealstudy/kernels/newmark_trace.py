"""A plain fixed-Jacobian step whose residuals are kept: what the iteration does, not what it gives.

Neither halving nor Newton comes to its help: a step that would need one ends the trace.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_entry_kernel
from squealstudy.kernels.newmark_correct import place
from squealstudy.kernels.newmark_layout import Modal, Saved, Settings, Work
from squealstudy.kernels.newmark_pass import pass_one
from squealstudy.kernels.newmark_step import advance
from squealstudy.kernels.newmark_vector import copy


@fast_entry_kernel
def newmark_trace(
    B: np.ndarray,
    modal: Modal,
    settings: Settings,
    work: Work,
    saved: Saved,
    first: np.ndarray,
    squares: np.ndarray,
) -> int:
    """Iterate one step of design 0; how many squared residuals were written to `squares` (m,).

    Parameters
    ----------
    B, modal, settings, work, saved
        As of `newmark_batch.newmark_batch`, of one step without halvings.
    first : ndarray (n,) or (0,)
        Trial pull to start from; empty for that of the predictor.

    Notes
    -----
    The step converged where `work.counts[0, STATUS]` is DONE; its last residual is not written.
    """
    counts, real, x, n = work.counts[0], work.real[0], work.x[0], 0
    while counts[at.STATUS] == at.RUNNING and n < squares.size:
        starts = counts[at.MODE] == at.START
        pass_one(B, modal, work, 0)
        advance(B, modal, settings, work, saved, 0)
        if counts[at.STATUS] != at.RUNNING or not (starts or counts[at.MODE] == at.FIXED):
            break
        if starts and first.size > 0:
            copy(first, x[at.PULL_TRIAL])
            place(x, modal.steps[0, 0])
        elif not starts:
            squares[n] = real[at.E2_OLD]
            n += 1
    return n
