"""One hybrid Newmark step: forces extrapolated, then balanced after the forward/back solve.

Average acceleration, with J = M + (h beta/2 + h^2/4) K and dv the change of velocity
(THEORY.md eq. (82))::

    J dv = h/2 B^T (r_0 + r_1) - h K (q_0 + (h/2 + beta) v_0)

What the balanced contact forces (THEORY.md eq. (83)) change in the state is added by columns of
J^-1 B^T for a few points, or left as the right-hand side of a second solve for many.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import hybrid_layout as at
from squealstudy.kernels import newmark_layout as its
from squealstudy.kernels.hybrid_contact import (
    contact_iteration,
    friction_bound2,
    quadratic_form,
)
from squealstudy.kernels.hybrid_layout import (
    Contact,
    HybridArrays,
    HybridState,
    Limits,
    Sparse,
    StepSize,
)
from squealstudy.kernels.jit import fast_kernel, kernel, room_kernel
from squealstudy.kernels.newmark_vector import dot, move

# of the tolerances in the contact iteration: what it leaves, extrapolation amplifies
INNER_TOLERANCE_FACTOR = 0.02
# backward differences of one order more each; they vanish for the force that is extrapolated
DIFFERENCES = np.array([[1.0, -1, 0, 0, 0], [1, -2, 1, 0, 0], [1, -3, 3, -1, 0], [1, -4, 6, -4, 1]])


@kernel
def balance(
    model: HybridArrays,
    level: StepSize,
    state: HybridState,
    dv: np.ndarray,
    limits: Limits,
) -> tuple[int, int, float, int, bool]:
    """Find the contact forces at the end of a step whose predicted change of velocity is `dv`.

    Returns the outcome, the evaluations, the largest contraction factor, the points whose forces
    differ from the predicted ones by more than the tolerances, and whether these are so many that a
    solve costs less than their columns of J^-1 B^T: row RHS then holds its right-hand side. A
    smaller difference acts in the next step instead: its impulse is never lost, and the forces that
    later ones are extrapolated from hold it already.
    """
    rows, point, x = state.rows, state.point, state.vectors
    half = 0.5 * level.h
    nb = 3 * point.shape[0]
    x[at.DV] = dv
    y = predicted_velocities(model, level, state)
    eliminated = eliminate_shapes(model, level, rows[at.R, nb:], y[nb:])
    y_c = y[:nb].copy()
    for i in range(nb):
        y_c[i] += dot(level.G_shapes[i], eliminated)
    rows[at.Y_END, :nb] = y_c
    r = rows[at.R, :nb]
    # dv = h a and J dv = h (all forces): the square of all forces in the metric of G is h/2 a J a
    scale2 = quadratic_form(level.G, r) + 0.5 / level.h * dot(dv, x[at.RHS])
    contact = Contact(
        points=model.points,
        law=model.law,
        half=half,
        x_base=point[:, its.X_START] + half * rows[at.Y, 0:nb:3],
        y=y_c,
        r=r,
        trial=point,
    )
    tight = Limits(
        INNER_TOLERANCE_FACTOR * limits.tolerance,
        INNER_TOLERANCE_FACTOR * limits.tolerance_t,
        limits.max_iterations,
    )
    outcome, evaluations, contraction = contact_iteration(
        contact, level.G, level.floor2, scale2, tight
    )
    rows[at.FOUND] = rows[at.R]
    lack = r - rows[at.R_GUESS, :nb]
    corrected, n_corrected = points_to_correct(contact, level, lack, scale2, limits)
    solve = 3 * n_corrected * dv.size > level.fill
    if solve:
        corrected[:] = True
    change = np.zeros(rows.shape[1])
    for i in range(nb):
        if corrected[i // 3]:
            change[i] = lack[i]
            move(rows[at.Y_END, :nb], lack[i], level.G[i])
        else:  # what these forces lack acts in the next step
            r[i] = rows[at.R_GUESS, i]
    change_shapes(level, eliminated, change, rows, nb)
    carry(model, level, state, change, solve)
    return outcome, evaluations, contraction, n_corrected, solve


@room_kernel
def predicted_velocities(model: HybridArrays, level: StepSize, state: HybridState) -> np.ndarray:
    """B v (3 nc + k,) at the end of a step with the predicted forces; velocities of the modes."""
    rows, modes = state.rows, state.modes
    force = np.empty(model.omega2.size)
    free_rates(model, state, level.h)
    modal_force(model, rows[at.LEFT] + rows[at.R], force)
    move_rates(model, state, level.h, force)
    lag = force
    for j in range(lag.size):
        lag[j] = modes[at.RATE_END, j] - modes[at.RATE_S_END, j]
        lag[j] -= modes[at.RATE, j] - modes[at.RATE_S, j]
    y = np.empty(rows.shape[1])
    multiply(model.B, state.vectors[at.DV], y)
    for i in range(y.size):
        y[i] += rows[at.Y, i] + dot(model.B_modes[i], lag)
    return y


@room_kernel
def eliminate_shapes(
    model: HybridArrays, level: StepSize, r: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """Change of the shapes' forces (k,) that makes r = -d y while the contact forces stay.

    Their dampers are linear, so that they leave the contact iteration: `level.G` knows them.
    """
    change = np.zeros(r.size)
    for b in range(r.size):
        lack = y[b] + r[b] / model.d[b]
        for a in range(r.size):
            change[a] -= level.shape_inverse[a, b] * lack
    return change


@room_kernel
def change_shapes(
    level: StepSize, eliminated: np.ndarray, change: np.ndarray, rows: np.ndarray, nb: int
) -> None:
    """The part of the shapes in `change` (3 nc + k,) beside contact forces, and their forces."""
    k = eliminated.size
    seen = np.zeros(k)
    for i in range(nb):
        if change[i] != 0.0:
            move(seen, change[i], level.G_shapes[i])
    for a in range(k):
        change[nb + a] = eliminated[a] - dot(level.shape_inverse[a], seen)
        rows[at.R, nb + a] += change[nb + a]
        rows[at.FOUND, nb + a] = rows[at.R, nb + a]


@room_kernel
def carry(
    model: HybridArrays, level: StepSize, state: HybridState, change: np.ndarray, solve: bool
) -> None:
    """What a change of forces (3 nc + k,) does to the modes and to DV, or to the next RHS."""
    x = state.vectors
    force = np.empty(model.omega2.size)
    modal_force(model, change, force)
    move_rates(model, state, level.h, force)
    if solve:
        x[at.RHS] = 0.0
        spread(model.B, 0.5 * level.h, change, x[at.RHS])
        return
    for i in range(change.size):
        if change[i] != 0.0:
            move(x[at.DV], 0.5 * level.h * change[i], level.X[i])


@room_kernel
def points_to_correct(
    contact: Contact, level: StepSize, lack: np.ndarray, scale2: float, limits: Limits
) -> tuple[np.ndarray, int]:
    """The fewest points (nc,) whose forces must be corrected, and their number.

    All others together differ from the predicted forces by less than the tolerances.
    """
    nc = contact.points.shape[0]
    bounds2 = 0.0
    e2, e2_t = np.empty(nc), np.empty(nc)
    for i in range(nc):
        bounds2 += friction_bound2(contact.points, contact.law, contact.trial, i)
        e2[i] = 0.0
        for a in range(3 * i, 3 * i + 3):
            for b in range(3 * i, 3 * i + 3):
                e2[i] += lack[a] * level.G[a, b] * lack[b]
        e2_t[i] = lack[3 * i + 1] ** 2 + lack[3 * i + 2] ** 2
    limit = limits.tolerance * limits.tolerance * scale2 + level.floor2
    limit_t = limits.tolerance_t * limits.tolerance_t * bounds2
    corrected = np.zeros(nc, dtype=np.bool_)
    share = 1.0
    while True:
        count = 0
        light = 0.0
        light_t = 0.0
        for i in range(nc):
            corrected[i] = e2[i] > share * limit or e2_t[i] > share * limit_t
            if corrected[i]:
                count += 1
            else:
                light += e2[i]
                light_t += e2_t[i]
        if (light <= limit and light_t <= limit_t) or share * nc < 1.0:
            return corrected, count
        share *= 0.5


@fast_kernel
def multiply(A: Sparse, x: np.ndarray, y: np.ndarray) -> None:
    """Write the product A x of a sparse matrix (m, n) with x (n,) into y (m,)."""
    for i in range(y.size):
        total = 0.0
        for k in range(A.indptr[i], A.indptr[i + 1]):
            total += A.data[k] * x[A.indices[k]]
        y[i] = total


@fast_kernel
def spread(A: Sparse, factor: float, x: np.ndarray, y: np.ndarray) -> None:
    """Y += factor A^T x, by rows of A."""
    for i in range(x.size):
        if x[i] != 0.0:
            scaled = factor * x[i]
            for k in range(A.indptr[i], A.indptr[i + 1]):
                y[A.indices[k]] += A.data[k] * scaled


@fast_kernel
def modal_force(model: HybridArrays, r: np.ndarray, force: np.ndarray) -> None:
    """Force = (B phi)^T r (m,)."""
    force[:] = 0.0
    for i in range(r.size):
        if r[i] != 0.0:
            row = model.B_modes[i]
            for j in range(force.size):
                force[j] += r[i] * row[j]


@fast_kernel
def free_rates(model: HybridArrays, state: HybridState, h: float) -> None:
    """Velocities of all modes at the end of a step without forces."""
    modes = state.modes
    for j in range(model.omega2.size):
        w2, c = model.omega2[j], model.c[j]
        c_s = model.beta * w2
        stiff = 1.0 + 0.25 * h * h * w2
        v, v_s = modes[at.RATE, j], modes[at.RATE_S, j]
        pull = h * (w2 * (modes[at.ALPHA, j] + 0.5 * h * v) + c * v)
        pull_s = h * (w2 * (modes[at.ALPHA_S, j] + 0.5 * h * v_s) + c_s * v_s)
        modes[at.RATE_END, j] = v - pull / (stiff + 0.5 * h * c)
        modes[at.RATE_S_END, j] = v_s - pull_s / (stiff + 0.5 * h * c_s)


@fast_kernel
def move_rates(model: HybridArrays, state: HybridState, h: float, force: np.ndarray) -> None:
    """Velocities of all modes at the end of a step += those of `force` (m,), from rest."""
    modes = state.modes
    for j in range(force.size):
        stiff = 1.0 + 0.25 * h * h * model.omega2[j]
        impulse = 0.5 * h * force[j]
        modes[at.RATE_END, j] += impulse / (stiff + 0.5 * h * model.c[j])
        modes[at.RATE_S_END, j] += impulse / (stiff + 0.5 * h * model.beta * model.omega2[j])


@fast_kernel
def extrapolate(rows: np.ndarray, first: int, last: int, known: int) -> None:
    """Predict the forces of the rows first to last - 1 into row R, from `known` times (1 to 5).

    Polynomials through 1 to 4 times (constant to cubic); their errors at the last time are the
    backward differences of one order more, and the one that was best then is taken: smooth sliding
    earns a high order, points that just stuck, slid or opened a low one.
    """
    best, least, past = 0, np.inf, rows[at.PAST :]
    for order in range(min(known, at.MOST_TIMES) - 1):
        e2 = 0.0
        for i in range(first, last):
            e = 0.0
            for age in range(order + 2):
                e += DIFFERENCES[order, age] * past[age, i]
            e2 += e * e
        if e2 < least:
            best, least = order, e2
    for i in range(first, last):
        r = 0.0
        for age in range(best + 1):
            r -= DIFFERENCES[best, age + 1] * past[age, i]
        rows[at.R, i] = r
        rows[at.R_GUESS, i] = r


@kernel
def predict(model: HybridArrays, level: StepSize, state: HybridState, known: int) -> None:
    """Extrapolate the forces from `known` times and leave the right-hand side in row RHS."""
    rows, x = state.rows, state.vectors
    h = level.h
    nb = 3 * state.point.shape[0]
    for first in range(0, nb, 3):
        extrapolate(rows, first, first + 3, known)
    for i in range(nb, rows.shape[1]):
        extrapolate(rows, i, i + 1, known)
    for j in range(x.shape[1]):
        x[at.RHS, j] = -h * (x[at.KQ, j] + (0.5 * h + model.beta) * x[at.KV, j])
    spread(model.B, 0.5 * h, rows[at.LEFT] + rows[at.R], x[at.RHS])
