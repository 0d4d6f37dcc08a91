"""The first and the accepted states of a hybrid run: work between them, energies, histories."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import hybrid_layout as at
from squealstudy.kernels import newmark_layout as its
from squealstudy.kernels.hybrid_contact import MAX_FINITE_SQUARE, evaluate
from squealstudy.kernels.hybrid_layout import Contact, HybridArrays, HybridState, StepSize
from squealstudy.kernels.hybrid_step import multiply
from squealstudy.kernels.jit import kernel
from squealstudy.kernels.newmark_output import contact_energy, contact_row, contact_work
from squealstudy.kernels.newmark_step import keep_points
from squealstudy.kernels.regimes import find_regimes
from squealstudy.kernels.row_sums import add_row, clear_sums, close_row, take_now


@kernel
def start(model: HybridArrays, state: HybridState) -> bool:
    """Forces of the initial state in vectors Q and V; False where they are not finite."""
    rows, point, x = state.rows, state.point, state.vectors
    nc, k = point.shape[0], model.d.size
    multiply(model.K, x[at.Q], x[at.KQ])
    multiply(model.K, x[at.V], x[at.KV])
    multiply(model.B, x[at.Q], rows[at.Y])
    x_base = rows[at.Y, 0 : 3 * nc : 3].copy()
    point[:, its.X_START] = x_base
    multiply(model.B, x[at.V], rows[at.Y])
    forces = rows[at.PAST, : 3 * nc]
    forces[:] = 0.0
    y = rows[at.Y, : 3 * nc]
    F = np.empty(3 * nc)
    contact = Contact(
        points=model.points, law=model.law, half=0.0, x_base=x_base, y=y, r=forces, trial=point
    )
    change2, bounds2 = evaluate(contact, F)
    forces[:] = F
    for a in range(k):
        rows[at.PAST, 3 * nc + a] = -model.d[a] * rows[at.Y, 3 * nc + a]
    rows[at.LEFT] = rows[at.PAST]
    find_regimes(model.points.T, model.law, point.T, nc)
    keep_points(point.T, nc, 0.0)
    total = 0.0
    for i in range(3 * nc):
        total += forces[i] * forces[i]
    return total < MAX_FINITE_SQUARE and change2 < MAX_FINITE_SQUARE and bounds2 < MAX_FINITE_SQUARE


@kernel
def commit(model: HybridArrays, level: StepSize, state: HybridState) -> None:
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
    load, belt, sliding = contact_work(model.points.T, point.T, nc, 0.0)
    state.work[at.W_LOAD] += 0.5 * h * load
    state.work[at.W_BELT] += 0.5 * h * belt
    state.work[at.D_FRICTION] -= 0.25 * h * sliding
    find_regimes(model.points.T, model.law, point.T, nc)
    keep_points(point.T, nc, h)
    for i in range(nc):
        point[i, its.X_START] += 0.5 * h * (rows[at.Y, 3 * i] + rows[at.Y_END, 3 * i])
    rows[at.Y] = rows[at.Y_END]
    for age in range(at.MOST_TIMES - 1, 0, -1):
        rows[at.PAST + age] = rows[at.PAST + age - 1]
    rows[at.PAST] = rows[at.FOUND]
    # the impulse of what this step left out is not lost
    rows[at.LEFT] = 2.0 * rows[at.FOUND] - rows[at.R]


@kernel
def potential_energy(model: HybridArrays, state: HybridState) -> float:
    """Contact potential from the reference state beyond the tangent that is in K, J."""
    return contact_energy(model.points.T, model.law, state.point[:, its.X_START])


@kernel
def history_row(model: HybridArrays, state: HybridState, row: np.ndarray) -> None:
    """Fill the columns newmark_layout.HISTORY of contact and work."""
    point = state.point
    contact_row(model.points.T, model.law, point.T, point.shape[0], np.empty(0), 0.0, row)
    row[its.WORK : its.WORK + 4] = state.work


@kernel
def sum_step(
    model: HybridArrays, state: HybridState, h: float, row: np.ndarray, sums: np.ndarray
) -> None:
    """Add the accepted sub-step h to the sums (N_SUM,) of row_sums, none for the start, h = 0.

    `row` (len(HISTORY),) is room. The energy, which takes products with K, is not summed.
    """
    point = state.point
    contact_row(model.points.T, model.law, point.T, point.shape[0], np.empty(0), 0.0, row)
    row[its.MODAL_ENERGY] = np.nan
    if h > 0.0:
        add_row(sums, row, h)
    else:
        take_now(sums, row)
        clear_sums(sums)


@kernel
def sums_to_row(sums: np.ndarray, row: np.ndarray) -> None:
    """Columns of a row of histories from the sums since the one before, which begin anew."""
    close_row(sums, row)
