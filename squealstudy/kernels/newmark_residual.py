"""Residual of an implicit step at a trial state, and the change of the friction forces."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.newmark_layout import Modal, Work
from squealstudy.kernels.newmark_vector import dot, fill, move


@fast_kernel
def balance(x: np.ndarray, modes: np.ndarray) -> tuple[float, float]:
    """DELTA = load + FORCE - pull; the squares of it and of its scale: inertia, contact forces."""
    e2 = 0.0
    scale2 = 0.0
    for j in range(x.shape[1]):
        pull, F = x[at.PULL_TRIAL, j], x[at.FORCE, j]
        a = pull - modes[at.C, j] * x[at.V_TRIAL, j] - modes[at.W2, j] * x[at.Q_TRIAL, j]
        R = modes[at.LOAD, j] + F - pull
        x[at.DELTA, j] = R
        e2 += R * R
        scale2 += a * a + F * F
    return e2, scale2


@fast_kernel
def residual(modal: Modal, work: Work, k: int) -> tuple[float, float]:
    """Force residual of design k into row DELTA; its square and the square of its scale."""
    x = work.x[k]
    e2, scale2 = balance(x, modal.modes[k])
    changed = False
    for m in range(modal.shapes.shape[0]):
        d, s, u = modal.tuned[k, 0, m], modal.tuned[k, 1, m], modal.shapes[m]
        if d == 0.0 and s == 0.0:
            continue
        force = d * dot(u, x[at.V_TRIAL])
        if s != 0.0:
            force += s * dot(u, x[at.Q_TRIAL])
        move(x[at.DELTA], -force, u)
        changed = True
    if changed:
        e2 = dot(x[at.DELTA], x[at.DELTA])
    return e2, scale2


@fast_kernel
def all_forces(modal: Modal, work: Work, k: int) -> tuple[float, float]:
    """All forces beyond the free modes at the evaluated trial state of design k, into row DELTA.

    Their square and the square of their scale.
    """
    fill(work.x[k, at.PULL_TRIAL], 0.0)
    return residual(modal, work, k)


@fast_kernel
def friction_change(modal: Modal, work: Work, k: int) -> tuple[float, float]:
    """Squared change of the friction forces since the guess, and the square of their bounds.

    This is the balance in the tangential directions: points that stick hardly show in the forces
    of all modes. The new forces become the guess.
    """
    mu = modal.laws[k, at.LAW_MU]
    point, points = work.point[k], modal.points[k]
    change = 0.0
    bounds = work.real[k, at.FLOOR2]
    for i in range(point.shape[1]):
        e1 = point[at.OUT_T1, i] - point[at.GUESS_1, i]
        e2 = point[at.OUT_T2, i] - point[at.GUESS_2, i]
        change += e1 * e1 + e2 * e2
        bound = points[at.POINT_AREA, i] * points[at.POINT_FRICTION, i] * mu * point[at.OUT_P, i]
        bounds += bound * bound
        point[at.GUESS_1, i] = point[at.OUT_T1, i]
        point[at.GUESS_2, i] = point[at.OUT_T2, i]
    return change, bounds
