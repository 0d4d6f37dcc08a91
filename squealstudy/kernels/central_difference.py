"""Central differences: explicit, one evaluation of the contact forces a step.

Velocities stand at half steps. Modal damping is implicit, which costs nothing; friction and the
damping of shapes need a velocity at whole steps, for which there is only an estimate.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.integrator_state import close_step, open_run
from squealstudy.kernels.jit import entry_kernel, fast_kernel
from squealstudy.kernels.newmark_layout import Modal, Saved, Settings, Work
from squealstudy.kernels.newmark_output import add_work
from squealstudy.kernels.newmark_pass import pass_one
from squealstudy.kernels.newmark_residual import all_forces
from squealstudy.kernels.newmark_step import count_pass, keep_points
from squealstudy.kernels.newmark_vector import copy


@fast_kernel
def drift(x: np.ndarray, h: float, lagged: bool) -> None:
    """Displacement of the next step from the half-step velocity in V_BASE; a velocity there.

    The velocity is that of half a step before, or extrapolated with the last acceleration.
    """
    ahead = 0.0 if lagged else 0.5 * h
    for j in range(x.shape[1]):
        x[at.Q_TRIAL, j] = x[at.Q, j] + h * x[at.V_BASE, j]
        x[at.V_TRIAL, j] = x[at.V_BASE, j] + ahead * x[at.A, j]


@fast_kernel
def kick(x: np.ndarray, modes: np.ndarray, h: float) -> None:
    """The next half-step velocity from the pull of the trial state in DELTA.

    It leaves the velocity and the acceleration of the whole step in V_TRIAL and A.
    """
    for j in range(x.shape[1]):
        c, before = modes[at.C, j], x[at.V_BASE, j]
        force = x[at.DELTA, j] - modes[at.W2, j] * x[at.Q_TRIAL, j]
        after = ((1.0 - 0.5 * h * c) * before + h * force) / (1.0 + 0.5 * h * c)
        x[at.V_BASE, j] = after
        x[at.V_TRIAL, j] = 0.5 * (before + after)
        x[at.A, j] = (after - before) / h


@entry_kernel
def central_difference(
    B: np.ndarray, modal: Modal, settings: Settings, lagged: bool, work: Work, saved: Saved
) -> None:
    """Integrate design 0 to its end or failure; arguments as of `newmark.newmark`.

    `lagged`: friction sees the velocity of half a step before, which is of order 1; else an
    extrapolated one, of order 2 with half the stability in stick.
    """
    open_run(B, modal, settings, work, saved)
    x, h, counts = work.x[0], settings.h, work.counts[0]
    for j in range(x.shape[1]):
        x[at.V_BASE, j] = x[at.V, j] + 0.5 * h * x[at.A, j]
    while counts[at.STATUS] == at.RUNNING:
        drift(x, h, lagged)
        pass_one(B, modal, work, 0)
        count_pass(work.counts[0])
        all_forces(modal, work, 0)
        kick(x, modal.modes[0], h)
        add_work(modal, settings, work, 0, h)
        copy(x[at.Q_TRIAL], x[at.Q])
        copy(x[at.V_TRIAL], x[at.V])
        keep_points(work.point[0], h)
        counts[at.STEP] += 1
        close_step(modal, settings, work, saved)
