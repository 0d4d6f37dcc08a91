"""The first and the accepted states of a hybrid run: work between them, energies, histories."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import hybrid_layout as at
from squealstudy.kernels import newmark_layout as its
from squealstudy.kernels.hybrid_contact import evaluate
from squealstudy.kernels.hybrid_layout import Hybrid, Level, State
from squealstudy.kernels.hybrid_step import multiply
from squealstudy.kernels.jit import fast_kernel, kernel
from squealstudy.kernels.laws import mu_at, potential

OPEN = 0.01  # a point is open below this share of the mean pressure


@kernel
def start(model: Hybrid, state: State) -> bool:
    """Forces of the initial state in vectors Q and V; False where they are not finite."""
    rows, point, x = state.rows, state.point, state.vectors
    nc, k = point.shape[0], model.d.size
    multiply(model.K, x[at.Q], x[at.KQ])
    multiply(model.K, x[at.V], x[at.KV])
    multiply(model.B, x[at.Q], rows[at.Y])
    x_base = rows[at.Y, 0 : 3 * nc : 3].copy()
    point[:, at.OLD_X] = x_base
    multiply(model.B, x[at.V], rows[at.Y])
    forces = rows[at.PAST, : 3 * nc]
    forces[:] = 0.0
    y = rows[at.Y, : 3 * nc]
    F = np.empty(3 * nc)
    change2, bounds2 = evaluate(model.points, model.law, 0.0, x_base, y, forces, point, F)
    forces[:] = F
    for a in range(k):
        rows[at.PAST, 3 * nc + a] = -model.d[a] * rows[at.Y, 3 * nc + a]
    rows[at.LEFT] = rows[at.PAST]
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
    kdv = x[at.RHS]
    multiply(model.K, x[at.DV], kdv)
    damped = 0.0
    for j in range(x.shape[1]):
        damped += (2.0 * x[at.V, j] + x[at.DV, j]) * (2.0 * x[at.KV, j] + kdv[j])
        x[at.Q, j] += h * (x[at.V, j] + 0.5 * x[at.DV, j])
        x[at.V, j] += x[at.DV, j]
        x[at.KQ, j] += h * (x[at.KV, j] + 0.5 * kdv[j])
        x[at.KV, j] += kdv[j]
    damped *= model.beta
    for j in range(modes.shape[1]):
        v = modes[at.RATE, j] + modes[at.RATE_END, j]
        v_s = modes[at.RATE_S, j] + modes[at.RATE_S_END, j]
        damped += model.c[j] * v * v - model.beta * model.omega2[j] * v_s * v_s
        modes[at.ALPHA, j] += 0.5 * h * v
        modes[at.ALPHA_S, j] += 0.5 * h * v_s
        modes[at.RATE, j] = modes[at.RATE_END, j]
        modes[at.RATE_S, j] = modes[at.RATE_S_END, j]
    nc = point.shape[0]
    for a in range(model.d.size):
        own = 3 * nc + a
        rows[at.Y_END, own] = -rows[at.R, own] / model.d[a]
        seen = rows[at.Y_END, own] + rows[at.Y, own]
        damped += model.d[a] * seen * seen
    state.work[at.D_DAMPING] += 0.25 * h * damped
    add_contact_work(model, state, h)
    for i in range(nc):
        point[i, at.OLD_X] += 0.5 * h * (rows[at.Y, 3 * i] + rows[at.Y_END, 3 * i])
    rows[at.Y] = rows[at.Y_END]
    for age in range(at.MOST_TIMES - 1, 0, -1):
        rows[at.PAST + age] = rows[at.PAST + age - 1]
    rows[at.PAST] = rows[at.FOUND]
    rows[at.LEFT] = (
        2.0 * rows[at.FOUND] - rows[at.R]
    )  # the impulse of what this step left out is not lost


@fast_kernel
def add_contact_work(model: Hybrid, state: State, h: float) -> None:
    """Work at the contact points over a step, by the trapezoidal rule; remembers their state."""
    belt = 0.0
    sliding = 0.0
    load = 0.0
    speed = model.law[its.LAW_SPEED]
    point = state.point
    for i in range(point.shape[0]):
        own, base = point[i], model.points[i]
        w1, w2 = own[at.OLD_W1] + own[its.OUT_W1], own[at.OLD_W2] + own[its.OUT_W2]
        t1, t2 = own[at.OLD_T1] + own[its.OUT_T1], own[at.OLD_T2] + own[its.OUT_T2]
        belt += t1
        sliding += w1 * t1 + w2 * t2
        load -= base[its.POINT_T1] * (w1 - 2.0 * speed) + base[its.POINT_T2] * w2
        keep_point(own)
    state.work[at.W_LOAD] += 0.5 * h * load
    state.work[at.W_BELT] -= 0.5 * h * speed * belt
    state.work[at.D_FRICTION] -= 0.25 * h * sliding


@fast_kernel
def keep_point(own: np.ndarray) -> None:
    """The trial state of a point is accepted."""
    own[at.OLD_W1], own[at.OLD_W2] = own[its.OUT_W1], own[its.OUT_W2]
    own[at.OLD_T1], own[at.OLD_T2] = own[its.OUT_T1], own[its.OUT_T2]


@kernel
def contact_energy(model: Hybrid, state: State) -> float:
    """Contact potential from the reference state beyond the tangent that is in K, J."""
    law = model.law
    total = 0.0
    for i in range(model.points.shape[0]):
        point, gap = model.points[i], state.point[i, at.OLD_X]
        U = potential(law, point[its.POINT_GAP] + gap) - potential(law, point[its.POINT_GAP])
        total += point[its.POINT_AREA] * U + point[its.POINT_NORMAL] * gap
        total -= 0.5 * point[its.POINT_STIFFNESS] * gap * gap
    return total


@kernel
def history_row(model: Hybrid, state: State, row: np.ndarray) -> None:
    """Fill the columns newmark_layout.HISTORY of contact and work: row[1:10], row[12]."""
    torque = 0.0
    force = 0.0
    area = 0.0
    law = model.law
    for i in range(model.points.shape[0]):
        point, trial = model.points[i], state.point[i]
        torque -= point[its.POINT_RADIUS] * trial[its.OUT_T1]
        force += point[its.POINT_AREA] * trial[its.OUT_P]
        area += point[its.POINT_AREA]
    stick = 0.0
    opened = 0.0
    creep = 0.0
    for i in range(model.points.shape[0]):
        point, trial = model.points[i], state.point[i]
        p, share = trial[its.OUT_P], point[its.POINT_AREA] / area
        s = (trial[its.OUT_W1] * trial[its.OUT_W1] + trial[its.OUT_W2] * trial[its.OUT_W2]) ** 0.5
        mu, _, _ = mu_at(law, s, p)
        if p <= OPEN * force / area:
            opened += share
        elif law[its.LAW_SLOPE] * s < point[its.POINT_FRICTION] * mu * p:
            stick += share
            creep = max(creep, s)
    row[1], row[2] = torque, force
    row[3], row[4], row[5] = stick, 1.0 - stick - opened, opened
    row[12] = creep
    for i in range(4):
        row[6 + i] = state.work[i]
