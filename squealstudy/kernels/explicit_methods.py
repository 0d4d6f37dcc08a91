"""Explicit methods, one or few evaluations of the contact forces a step.

Exponential steps: each mode's free motion exact, its contact forces by PEC. Over a step
q'' + c q' + w2 q = f(t) is solved exactly for a polynomial f, whose coefficients come from one
evaluation at a predicted state (predict, evaluate, correct); see
motion.integrators.exact_free_motion for the coefficients.

Central differences: velocities stand at half steps. Modal damping is implicit, which costs nothing;
friction and the damping of shapes need a velocity at whole steps, for which there is only an
estimate.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.integrator_state import close_step, finite, open_run
from squealstudy.kernels.jit import entry_kernel, fast_kernel
from squealstudy.kernels.newmark_between import accept_damping_forces
from squealstudy.kernels.newmark_forces import all_forces, pass_one
from squealstudy.kernels.newmark_layout import (
    E_QQ,
    E_QV,
    E_VQ,
    E_VV,
    P1_Q,
    P1_V,
    P2_Q,
    P2_V,
    P3_Q,
    P3_V,
    ModalArrays,
    SavedArrays,
    StepSettings,
    WorkArrays,
)
from squealstudy.kernels.newmark_output import add_sums, add_work
from squealstudy.kernels.newmark_step import count_pass, keep_points
from squealstudy.kernels.newmark_vector import copy
from squealstudy.kernels.regimes import find_regimes


@fast_kernel
def predict(x: np.ndarray, E: np.ndarray, linear: bool) -> None:
    """Free motion with the last forces held, or extrapolated with those before them.

    The part with held forces is kept in Q_BASE and V_BASE.
    """
    ahead = 1.0 if linear else 0.0
    for j in range(x.shape[1]):
        q, v, g = x[at.Q, j], x[at.V, j], x[at.PULL, j]
        qb = E[E_QQ, j] * q + E[E_QV, j] * v + E[P1_Q, j] * g
        vb = E[E_VQ, j] * q + E[E_VV, j] * v + E[P1_V, j] * g
        slope = ahead * (g - x[at.PULL_OLD, j])
        x[at.Q_BASE, j], x[at.V_BASE, j] = qb, vb
        x[at.Q_TRIAL, j] = qb + E[P2_Q, j] * slope
        x[at.V_TRIAL, j] = vb + E[P2_V, j] * slope


@fast_kernel
def correct(x: np.ndarray, E: np.ndarray, quadratic: bool) -> None:
    """The new state with forces linear or quadratic in time through the new ones in DELTA."""
    for j in range(x.shape[1]):
        new, g, old = x[at.DELTA, j], x[at.PULL, j], x[at.PULL_OLD, j]
        slope, bend = new - g, 0.0
        if quadratic:
            slope, bend = 0.5 * (new - old), new - 2.0 * g + old
        x[at.Q_TRIAL, j] = x[at.Q_BASE, j] + E[P2_Q, j] * slope + E[P3_Q, j] * bend
        x[at.V_TRIAL, j] = x[at.V_BASE, j] + E[P2_V, j] * slope + E[P3_V, j] * bend


@fast_kernel
def one_step(
    B: np.ndarray,
    modal: ModalArrays,
    settings: StepSettings,
    work: WorkArrays,
    E: np.ndarray,
    h: float,
    third: bool,
) -> None:
    """A step with the coefficients E (N_COEFFICIENT, n) of its length h, accepted."""
    x = work.x[0]
    predict(x, E, third)
    pass_one(B, modal, work, 0)
    count_pass(work.counts[0])
    all_forces(modal, work, 0)
    correct(x, E, third)
    add_work(modal, settings, work, 0, h)
    accept_damping_forces(x)
    copy(x[at.Q_TRIAL], x[at.Q])
    copy(x[at.V_TRIAL], x[at.V])
    copy(x[at.PULL], x[at.PULL_OLD])
    copy(x[at.DELTA], x[at.PULL])
    find_regimes(modal.points[0], modal.laws[0], work.point[0], modal.fixed.shape[2])
    keep_points(work.point[0], modal.fixed.shape[2], h)
    add_sums(modal, settings, work, 0, h)
    if not finite(x[at.DELTA]):
        work.counts[0, at.STATUS] = at.NOT_FINITE


@entry_kernel
def predictor_corrector_steps(
    B: np.ndarray,
    modal: ModalArrays,
    settings: StepSettings,
    E: np.ndarray,
    parts: int,
    work: WorkArrays,
    saved: SavedArrays,
) -> None:
    """Integrate design 0 to its end or failure; arguments as of `newmark_batch`.

    Parameters
    ----------
    E : ndarray (2, N_COEFFICIENT, n)
        Coefficients of a step, and of one of `parts` parts of the first step.
    parts : int
        0 for order 2; else order 3, whose first step is made of so many of order 2.
    """
    open_run(B, modal, settings, work, saved)
    x, counts = work.x[0], work.counts[0]
    while counts[at.STATUS] == at.RUNNING:
        if parts > 0 and counts[at.STEP] == 0:
            copy(x[at.PULL], x[at.DELTA_OLD])
            for _ in range(parts):
                one_step(B, modal, settings, work, E[1], settings.h / parts, False)
            copy(x[at.DELTA_OLD], x[at.PULL_OLD])
        else:
            one_step(B, modal, settings, work, E[0], settings.h, parts > 0)
        counts[at.STEP] += 1
        if counts[at.STATUS] == at.RUNNING:
            close_step(modal, settings, work, saved)


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
    B: np.ndarray,
    modal: ModalArrays,
    settings: StepSettings,
    lagged: bool,
    work: WorkArrays,
    saved: SavedArrays,
) -> None:
    """Integrate design 0 to its end or failure; arguments as of `newmark_batch`.

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
        accept_damping_forces(x)
        copy(x[at.Q_TRIAL], x[at.Q])
        copy(x[at.V_TRIAL], x[at.V])
        find_regimes(modal.points[0], modal.laws[0], work.point[0], modal.fixed.shape[2])
        keep_points(work.point[0], modal.fixed.shape[2], h)
        add_sums(modal, settings, work, 0, h)
        counts[at.STEP] += 1
        close_step(modal, settings, work, saved)
