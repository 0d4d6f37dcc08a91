"""Residual of an implicit step at a trial state, and the change of the friction forces."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.newmark_layout import (
    DELTA,
    FLOOR2,
    FORCE,
    GUESS,
    LOAD,
    PULL_TRIAL,
    Q_TRIAL,
    V_TRIAL,
    W2,
    C,
    Modal,
    Work,
)
from squealstudy.kernels.newmark_vector import dot, move


@fast_kernel
def balance(x: np.ndarray, modes: np.ndarray) -> tuple[float, float]:
    """DELTA = load + FORCE - pull; the squares of it and of its scale: inertia, contact forces."""
    e2 = 0.0
    scale2 = 0.0
    for j in range(x.shape[1]):
        pull, F = x[PULL_TRIAL, j], x[FORCE, j]
        a = pull - modes[C, j] * x[V_TRIAL, j] - modes[W2, j] * x[Q_TRIAL, j]
        R = modes[LOAD, j] + F - pull
        x[DELTA, j] = R
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
        force = d * dot(u, x[V_TRIAL])
        if s != 0.0:
            force += s * dot(u, x[Q_TRIAL])
        move(x[DELTA], -force, u)
        changed = True
    if changed:
        e2 = dot(x[DELTA], x[DELTA])
    return e2, scale2


@fast_kernel
def friction_change(modal: Modal, work: Work, k: int) -> tuple[float, float]:
    """Squared change of the friction forces since the guess, and the square of their bounds.

    This is the balance in the tangential directions: points that stick hardly show in the forces
    of all modes. The new forces become the guess.
    """
    mu = modal.laws[k, 4]
    point, points = work.point[k], modal.points[k]
    change = 0.0
    bounds = work.real[k, FLOOR2]
    for i in range(point.shape[1]):
        e1 = point[4, i] - point[GUESS, i]
        e2 = point[5, i] - point[GUESS + 1, i]
        change += e1 * e1 + e2 * e2
        bound = points[1, i] * points[2, i] * mu * point[3, i]
        bounds += bound * bound
        point[GUESS, i] = point[4, i]
        point[GUESS + 1, i] = point[5, i]
    return change, bounds
