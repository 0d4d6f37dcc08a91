"""The contact-friction Newmark kernel for one design point (paper eq. 7; beta 1/4, gamma 1/2)."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.jit import kernel
from squealstudy.kernels.newmark_layout import (
    FORCE,
    Q_TRIAL,
    RUNNING,
    STATUS,
    V_TRIAL,
    Modal,
    Saved,
    Settings,
    Work,
)
from squealstudy.kernels.newmark_pass import pass_one
from squealstudy.kernels.newmark_step import advance


@kernel
def newmark(B: np.ndarray, modal: Modal, settings: Settings, work: Work, saved: Saved) -> None:
    """Integrate design 0 to its end or failure; `work.counts` and `work.real` tell which.

    Parameters
    ----------
    B : ndarray (nc, 3, n), f8 or f4
        Observation [N; T1; T2] of every contact point.
    modal, settings, work, saved : newmark_layout tuples
        `work` holds the initial q and v in the rows Q_TRIAL and V_TRIAL as well.
    """
    x = work.x[0]
    while work.counts[0, STATUS] == RUNNING:
        pass_one(B, modal.points, modal.laws[0], x[Q_TRIAL], x[V_TRIAL], x[FORCE], work.point[0])
        advance(B, modal, settings, work, saved, 0)
