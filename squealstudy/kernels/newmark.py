"""The contact-friction kernel for one design point (paper eq. 7), of Newmark or exact modes."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.jit import entry_kernel
from squealstudy.kernels.newmark_layout import (
    PAUSE,
    RUNNING,
    STATUS,
    STEP,
    Modal,
    Saved,
    Settings,
    Work,
)
from squealstudy.kernels.newmark_pass import pass_one
from squealstudy.kernels.newmark_step import advance


@entry_kernel
def newmark(B: np.ndarray, modal: Modal, settings: Settings, work: Work, saved: Saved) -> None:
    """Integrate design 0 to its end, failure or pause; `work.counts` and `work.real` tell which.

    A paused design is RUNNING; with a later PAUSE the next call goes on as if there had been none.

    Parameters
    ----------
    B : ndarray (nt, n, ROWS), f8 or f4
        Tiles of the observation matrix, see tile.
    modal, settings, work, saved : newmark_layout tuples
        `work` holds the initial q and v in the rows Q_TRIAL and V_TRIAL as well.
    """
    while work.counts[0, STATUS] == RUNNING:
        pass_one(B, modal, work, 0)
        advance(B, modal, settings, work, saved, 0)
        if work.counts[0, STEP] == work.counts[0, PAUSE]:
            return
