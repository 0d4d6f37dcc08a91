"""The tangential mock-up: friction solved at the points that are stiff against sliding.

Sticking points multiply a correction by up to h k_t |T|^2 / 2; with that beyond 1 plain corrections
diverge. Few points stick at a time. Their sliding velocities answer to their friction forces t
through the compliance H = T diag(b) T^T of the points alone, with b the answer of the modes'
velocities to the pull (LAST_V)::

    w(t) = w + T b R + H (t - t_last),    t = friction(p, w(t))

It is solved point by point (Gauss-Seidel, closed form at each), stick and slip included; the
correction is then R + T^T (t - t_last).
"""

from __future__ import annotations

import math

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, part_kernel
from squealstudy.kernels.laws import stick_slope
from squealstudy.kernels.newmark_layout import ModalArrays, WorkArrays
from squealstudy.kernels.newmark_vector import dot, move
from squealstudy.kernels.spring_points import coefficient_of

STIFF_POINT_CONTRACTION = 0.05  # contraction that a point alone may cause before it is treated
MIN_SWEEPS, MAX_SWEEPS = 6, 30
# change of the forces in a sweep that ends them, relative to that of all sweeps
SWEEP_REL_TOLERANCE = 1e-2

# columns of Work.stiff: change of the friction force and its bound, N; compliance of the point
# itself, m/(N s). Work.free holds w1, w2 of each with the forces so far.
Z_1, Z_2, BOUND, OWN = 0, 1, 2, 3


@fast_kernel
def stiff_points(modal: ModalArrays, work: WorkArrays, k: int, part: float) -> int:
    """List the stiff points of design k with their velocities at the next trial state.

    `part` of the whole step is taken; row ROOM holds what the modes' velocities change by.
    """
    law, points, point, change = modal.laws[k], modal.points[k], work.point[k], work.x[k, at.ROOM]
    T, stiff = modal.tangential, work.stiff
    m = 0
    for i in range(modal.self_compliance.size):
        own = part * modal.self_compliance[i]
        force2 = (
            point[at.OUT_T1, i] * point[at.OUT_T1, i] + point[at.OUT_T2, i] * point[at.OUT_T2, i]
        )
        s2 = point[at.OUT_W1, i] * point[at.OUT_W1, i] + point[at.OUT_W2, i] * point[at.OUT_W2, i]
        if force2 * own * own > STIFF_POINT_CONTRACTION * STIFF_POINT_CONTRACTION * s2:
            mu, _, _ = coefficient_of(law, points, i, math.sqrt(s2), point[at.OUT_P, i])
            work.listed[m] = i
            work.free[2 * m] = point[at.OUT_W1, i] + dot(T[2 * i], change)
            work.free[2 * m + 1] = point[at.OUT_W2, i] + dot(T[2 * i + 1], change)
            stiff[m, Z_1] = stiff[m, Z_2] = 0.0
            stiff[m, BOUND] = (
                points[at.POINT_AREA, i] * points[at.POINT_FRICTION, i] * mu * point[at.OUT_P, i]
            )
            stiff[m, OWN] = own
            m += 1
    return m


@fast_kernel
def relax_point(
    law: np.ndarray, area: float, w1: float, w2: float, t1: float, t2: float, row: np.ndarray
) -> tuple[float, float]:
    """Friction force of a point whose velocity answers to it with its own compliance alone.

    With the free velocity u = w - own t the law gives t = -k u / (1 + own k) while it sticks with
    slope k, else the bound along -u.
    """
    u1, u2 = w1 - row[OWN] * t1, w2 - row[OWN] * t2
    speed = math.sqrt(u1 * u1 + u2 * u2)
    s = math.sqrt(w1 * w1 + w2 * w2)
    slope = stick_slope(law, area * law[at.LAW_SLOPE], row[BOUND], s)
    rate = slope / (1.0 + row[OWN] * slope)
    if rate * speed > row[BOUND]:
        rate = row[BOUND] / speed
    return -rate * u1, -rate * u2


@fast_kernel
def gather(H: np.ndarray, listed: np.ndarray, m: int, scale: float, small: np.ndarray) -> None:
    """Compliance of the m listed points times `scale` into `small`, rows of length 2 m."""
    for a in range(2 * m):
        row = H[2 * listed[a // 2] + a % 2]
        for b in range(m):
            small[2 * m * a + 2 * b] = scale * row[2 * listed[b]]
            small[2 * m * a + 2 * b + 1] = scale * row[2 * listed[b] + 1]


@fast_kernel
def sweep(modal: ModalArrays, work: WorkArrays, k: int, m: int) -> float:
    """One sweep over the m listed points; squared change of the forces over that of all sweeps."""
    free, small, point = work.free, work.small, work.point[k]
    change = 0.0
    total = 0.0
    for a in range(m):
        i, row = work.listed[a], work.stiff[a]
        t1, t2 = point[at.OUT_T1, i] + row[Z_1], point[at.OUT_T2, i] + row[Z_2]
        new1, new2 = relax_point(
            modal.laws[k],
            modal.points[k, at.POINT_AREA, i],
            free[2 * a],
            free[2 * a + 1],
            t1,
            t2,
            row,
        )
        e1, e2 = new1 - t1, new2 - t2
        row[Z_1] += e1
        row[Z_2] += e2
        change += e1 * e1 + e2 * e2
        total += row[Z_1] * row[Z_1] + row[Z_2] * row[Z_2]
        if e1 == 0.0 and e2 == 0.0:
            continue
        for j in range(2 * m):
            free[j] += small[4 * m * a + j] * e1 + small[4 * m * a + 2 * m + j] * e2
    return change / total if total > 0.0 else 0.0


@part_kernel
def mock_up(modal: ModalArrays, work: WorkArrays, k: int, level: int) -> None:
    """Correct row DELTA, which holds the residual, for the stiff points; the friction expected."""
    if modal.self_compliance.size == 0:
        return
    delta, answer, change = (
        work.x[k, at.DELTA],
        modal.steps[k, level, at.LAST_V],
        work.x[k, at.ROOM],
    )
    for j in range(delta.size):
        change[j] = answer[j] * delta[j]
    part = 1.0 / (1 << level)
    m = stiff_points(modal, work, k, part)
    if m == 0:
        return
    gather(modal.compliance, work.listed, m, part, work.small)
    # many points at once: about the work of a pass over the observation matrix
    worth = modal.self_compliance.size * work.x.shape[2] // (m * m)
    for _ in range(min(max(worth, MIN_SWEEPS), MAX_SWEEPS)):
        if sweep(modal, work, k, m) < SWEEP_REL_TOLERANCE * SWEEP_REL_TOLERANCE:
            break
    point = work.point[k]
    for a in range(m):
        i, z1, z2 = work.listed[a], work.stiff[a, Z_1], work.stiff[a, Z_2]
        move(delta, z1, modal.tangential[2 * i])
        move(delta, z2, modal.tangential[2 * i + 1])
        point[at.GUESS_1, i] += z1
        point[at.GUESS_2, i] += z2
