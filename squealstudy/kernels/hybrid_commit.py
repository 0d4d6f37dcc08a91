"""The first and the accepted states of a hybrid run, and the work done between them."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.hybrid_contact import evaluate
from squealstudy.kernels.hybrid_layout import (
    ALPHA,
    ALPHA_S,
    D_DAMPING,
    D_FRICTION,
    DV,
    FOUND,
    KQ,
    KV,
    LEFT,
    MOST_TIMES,
    OLD_T,
    OLD_W,
    OLD_X,
    PAST,
    RATE,
    RATE_END,
    RATE_S,
    RATE_S_END,
    RHS,
    W_BELT,
    W_LOAD,
    Y_END,
    Hybrid,
    Level,
    Q,
    R,
    State,
    V,
    Y,
)
from squealstudy.kernels.hybrid_vector import multiply
from squealstudy.kernels.jit import fast_kernel, kernel


@kernel
def start(model: Hybrid, state: State) -> bool:
    """Forces of the initial state in vectors Q and V; False where they are not finite."""
    rows, point, x = state.rows, state.point, state.vectors
    nc, k = point.shape[0], model.d.size
    multiply(model.K, x[Q], x[KQ])
    multiply(model.K, x[V], x[KV])
    multiply(model.B, x[Q], rows[Y])
    x_base = rows[Y, 0 : 3 * nc : 3].copy()
    point[:, OLD_X] = x_base
    multiply(model.B, x[V], rows[Y])
    forces = rows[PAST, : 3 * nc]
    forces[:] = 0.0
    y = rows[Y, : 3 * nc]
    F = np.empty(3 * nc)
    change2, bounds2 = evaluate(model.points, model.law, 0.0, x_base, y, forces, point, F)
    forces[:] = F
    for a in range(k):
        rows[PAST, 3 * nc + a] = -model.d[a] * rows[Y, 3 * nc + a]
    rows[LEFT] = rows[PAST]
    for i in range(nc):
        keep_point(point[i])
    total = 0.0
    for i in range(3 * nc):
        total += forces[i] * forces[i]
    return total < 1e290 and change2 < 1e290 and bounds2 < 1e290


@kernel
def commit(model: Hybrid, level: Level, state: State) -> None:
    """Accept the step whose change of velocity is in row DV: state, work, histories of forces."""
    rows, point, x, modes = state.rows, state.point, state.vectors, state.modes
    h = level.h
    kdv = x[RHS]
    multiply(model.K, x[DV], kdv)
    damped = 0.0
    for j in range(x.shape[1]):
        damped += (2.0 * x[V, j] + x[DV, j]) * (2.0 * x[KV, j] + kdv[j])
        x[Q, j] += h * (x[V, j] + 0.5 * x[DV, j])
        x[V, j] += x[DV, j]
        x[KQ, j] += h * (x[KV, j] + 0.5 * kdv[j])
        x[KV, j] += kdv[j]
    damped *= model.beta
    for j in range(modes.shape[1]):
        v = modes[RATE, j] + modes[RATE_END, j]
        v_s = modes[RATE_S, j] + modes[RATE_S_END, j]
        damped += model.c[j] * v * v - model.beta * model.omega2[j] * v_s * v_s
        modes[ALPHA, j] += 0.5 * h * v
        modes[ALPHA_S, j] += 0.5 * h * v_s
        modes[RATE, j] = modes[RATE_END, j]
        modes[RATE_S, j] = modes[RATE_S_END, j]
    nc = point.shape[0]
    for a in range(model.d.size):
        own = 3 * nc + a
        rows[Y_END, own] = -rows[R, own] / model.d[a]
        seen = rows[Y_END, own] + rows[Y, own]
        damped += model.d[a] * seen * seen
    state.work[D_DAMPING] += 0.25 * h * damped
    add_contact_work(model, state, h)
    for i in range(nc):
        point[i, OLD_X] += 0.5 * h * (rows[Y, 3 * i] + rows[Y_END, 3 * i])
    rows[Y] = rows[Y_END]
    for age in range(MOST_TIMES - 1, 0, -1):
        rows[PAST + age] = rows[PAST + age - 1]
    rows[PAST] = rows[FOUND]
    rows[LEFT] = 2.0 * rows[FOUND] - rows[R]  # the impulse of what this step left out is not lost


@fast_kernel
def add_contact_work(model: Hybrid, state: State, h: float) -> None:
    """Work at the contact points over a step, by the trapezoidal rule; remembers their state."""
    belt = 0.0
    sliding = 0.0
    load = 0.0
    speed = model.law[8]
    point = state.point
    for i in range(point.shape[0]):
        w1, w2 = point[i, OLD_W] + point[i, 1], point[i, OLD_W + 1] + point[i, 2]
        t1, t2 = point[i, OLD_T] + point[i, 4], point[i, OLD_T + 1] + point[i, 5]
        belt += t1
        sliding += w1 * t1 + w2 * t2
        load -= model.points[i, 6] * (w1 - 2.0 * speed) + model.points[i, 7] * w2
        keep_point(point[i])
    state.work[W_LOAD] += 0.5 * h * load
    state.work[W_BELT] -= 0.5 * h * speed * belt
    state.work[D_FRICTION] -= 0.25 * h * sliding


@fast_kernel
def keep_point(own: np.ndarray) -> None:
    """The trial state of a point is accepted."""
    own[OLD_W], own[OLD_W + 1] = own[1], own[2]
    own[OLD_T], own[OLD_T + 1] = own[4], own[5]
