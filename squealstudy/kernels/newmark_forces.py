"""Contact forces at a trial state and the residual of an implicit step there.

The fused pass over the observation matrix, F = B^T r(B [q; v]), for one design point: for every
contact point three dots, the laws, three axpys; B is read from memory once, a panel of tiles at a
time (THEORY.md eq. (62)).

The same pass with difference quotients of the contact potential (THEORY.md eq. (74)): between the
gaps g0 and g1 the pressure is -(U(g1) - U(g0)) / (g1 - g0), so that its work is what the potential
U loses, whatever the step (Gonzalez 1996, discrete gradients); the limit for g1 -> g0 is p(g0).

Arrays of one design point: `points` (N_POINT_ROWS, nc), rows POINT_* of newmark_layout; `law`
(N_LAW,), a `laws.law_row`; `point` (N_POINT, nc), the state of its contact points, of which one
evaluation leaves the rows OUT_* and, for B^T r, the rows R_*.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, hot_kernel
from squealstudy.kernels.laws import (
    friction_tangent,
    frictions,
    mean_pressures,
    pressures,
)
from squealstudy.kernels.newmark_between import add_damping_forces
from squealstudy.kernels.newmark_layout import X_START, ModalArrays, WorkArrays
from squealstudy.kernels.newmark_vector import dot, fill, move
from squealstudy.kernels.spring_points import (
    damper_force,
    law_begin,
    mean_spring_pressures,
    other_forces,
    pressure_of,
    spring_pressures,
    typical_mu,
)
from squealstudy.kernels.tile import LANES, POINTS, observe_one, spread_one


@hot_kernel
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


@hot_kernel
def residual(modal: ModalArrays, work: WorkArrays, k: int) -> tuple[float, float]:
    """Force residual of design k into row DELTA; its square and the square of its scale."""
    x = work.x[k]
    e2, scale2 = balance(x, modal.modes[k])
    changed = add_damping_forces(modal, work, k)
    for m in range(modal.shapes.shape[0]):
        d, s, u = modal.component_terms[k, 0, m], modal.component_terms[k, 1, m], modal.shapes[m]
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
def all_forces(modal: ModalArrays, work: WorkArrays, k: int) -> tuple[float, float]:
    """All forces beyond the free modes at the evaluated trial state of design k, into row DELTA.

    Their square and the square of their scale.
    """
    fill(work.x[k, at.PULL_TRIAL], 0.0)
    return residual(modal, work, k)


@hot_kernel
def friction_change(modal: ModalArrays, work: WorkArrays, k: int) -> tuple[float, float]:
    """Squared change of the friction forces since the guess, and the square of their bounds.

    This is the balance in the tangential directions: points that stick hardly show in the forces
    of all modes. The new forces become the guess.
    """
    mu = modal.laws[k, at.LAW_MU]
    point, points = work.point[k], modal.points[k]
    change = 0.0
    bounds = work.real[k, at.FLOOR2]
    for i in range(modal.fixed.shape[2]):
        e1 = point[at.OUT_T1, i] - point[at.GUESS_1, i]
        e2 = point[at.OUT_T2, i] - point[at.GUESS_2, i]
        change += e1 * e1 + e2 * e2
        largest = typical_mu(modal.laws[k], points, i) if points[at.POINT_LAW, i] > 0.0 else mu
        bound = points[at.POINT_AREA, i] * points[at.POINT_FRICTION, i] * largest
        bound *= point[at.OUT_P, i]
        bounds += bound * bound
        point[at.GUESS_1, i] = point[at.OUT_T1, i]
        point[at.GUESS_2, i] = point[at.OUT_T2, i]
    return change, bounds


@fast_kernel
def take_points(tile: np.ndarray, point: np.ndarray, first: int) -> None:
    """An observed tile (ROWS,) into the points (N_POINT, nc) from `first` on."""
    for c in range(3):
        for i in range(POINTS):
            point[at.OUT_X + c, first + i] = tile[c * POINTS + i]


@fast_kernel
def give_forces(point: np.ndarray, tile: np.ndarray, first: int) -> None:
    """Generalised forces of the points from `first` on into a tile (ROWS,)."""
    for c in range(3):
        for i in range(POINTS):
            tile[c * POINTS + i] = point[at.R_N + c, first + i]


@hot_kernel
def observe_panel(panel: np.ndarray, first: int, work: WorkArrays, k: int) -> None:
    """Gaps and velocities of the points of a panel of tiles (.., n, ROWS) at a trial state."""
    x, tiles = work.x[k], work.tiles
    for t in range(panel.shape[0]):
        observe_one(panel[t], x[at.Q_TRIAL], x[at.V_TRIAL], tiles[t, 0])
        take_points(tiles[t, 0], work.point[k], first + t * POINTS)


@hot_kernel
def spread_panel(panel: np.ndarray, first: int, work: WorkArrays, k: int) -> None:
    """Add the forces of the points of a panel, the first of them `first`, to row FORCE."""
    for t in range(panel.shape[0]):
        give_forces(work.point[k], work.tiles[t, 0], first + t * POINTS)
        spread_one(panel[t], work.tiles[t, 0], work.x[k, at.FORCE])


@hot_kernel
def is_small(B: np.ndarray) -> bool:
    """Whether observations are those of few points and coordinates, which fill no tile."""
    return B.shape[1] < LANES


@hot_kernel
def observe_few(B: np.ndarray, x: np.ndarray, point: np.ndarray, nc: int) -> None:
    """Gaps and velocities of nc points at the trial state of x (N_ROWS, n), point by point."""
    for i in range(nc):
        gap, w1, w2 = 0.0, 0.0, 0.0
        for j in range(x.shape[1]):
            gap += B[0, j, i] * x[at.Q_TRIAL, j]
            w1 += B[0, j, POINTS + i] * x[at.V_TRIAL, j]
            w2 += B[0, j, 2 * POINTS + i] * x[at.V_TRIAL, j]
        point[at.OUT_X, i], point[at.OUT_W1, i], point[at.OUT_W2, i] = gap, w1, w2


@hot_kernel
def spread_few(B: np.ndarray, x: np.ndarray, point: np.ndarray, nc: int) -> None:
    """Add the forces of nc points to row FORCE of x (N_ROWS, n)."""
    for i in range(nc):
        N, t1, t2 = point[at.R_N, i], point[at.R_1, i], point[at.R_2, i]
        for j in range(x.shape[1]):
            pushed = B[0, j, i] * N + B[0, j, POINTS + i] * t1
            x[at.FORCE, j] += pushed + B[0, j, 2 * POINTS + i] * t2


@hot_kernel
def pass_one(B: np.ndarray, modal: ModalArrays, work: WorkArrays, k: int) -> None:
    """Contact and friction forces in modal coordinates at the trial state of design k.

    Parameters
    ----------
    B : ndarray (nt, n, ROWS), f8 or f4
        Tiles of the observation matrix; arithmetic is f8 in any case.
    modal, work : newmark_layout tuples
        The rows Q_TRIAL and V_TRIAL of `work.x` are read, FORCE is overwritten with B^T r and
        `work.point` with the state of every point.
    """
    fill(work.x[k, at.FORCE], 0.0)
    step, nc = work.tiles.shape[0], modal.fixed.shape[2]
    if is_small(B):
        observe_few(B, work.x[k], work.point[k], nc)
        point_forces(modal.points[k], modal.laws[k], work.point[k], 0, nc)
        spread_few(B, work.x[k], work.point[k], nc)
        return
    for t in range(0, B.shape[0], step):
        panel = B[t : min(t + step, B.shape[0])]
        first, last = t * POINTS, min((t + panel.shape[0]) * POINTS, nc)
        observe_panel(panel, first, work, k)
        point_forces(modal.points[k], modal.laws[k], work.point[k], first, last)
        spread_panel(panel, first, work, k)


@fast_kernel
def gradient_forces(
    points: np.ndarray, law: np.ndarray, point: np.ndarray, first: int, last: int
) -> None:
    """As `point_forces` with the mean pressure over the step.

    OUT_X holds the change of gap at the midpoint, X_START that at the beginning.
    """
    begin_points(points, point, first, last)
    gap, x, x0 = points[at.POINT_GAP], point[at.OUT_X], point[X_START]
    mean_pressures(law, gap, x, x0, point[at.OUT_P], first, last)
    mean_spring_pressures(points, point, first, last)
    slide(points, law, point, first, last)


@fast_kernel
def pass_gradient(B: np.ndarray, modal: ModalArrays, work: WorkArrays) -> None:
    """As `pass_one` for design 0 with a midpoint in the trial rows."""
    fill(work.x[0, at.FORCE], 0.0)
    step, nc = work.tiles.shape[0], modal.fixed.shape[2]
    if is_small(B):
        observe_few(B, work.x[0], work.point[0], nc)
        gradient_forces(modal.points[0], modal.laws[0], work.point[0], 0, nc)
        spread_few(B, work.x[0], work.point[0], nc)
        return
    for t in range(0, B.shape[0], step):
        panel = B[t : min(t + step, B.shape[0])]
        first, last = t * POINTS, min((t + panel.shape[0]) * POINTS, nc)
        observe_panel(panel, first, work, 0)
        gradient_forces(modal.points[0], modal.laws[0], work.point[0], first, last)
        spread_panel(panel, first, work, 0)


@hot_kernel
def slide(points: np.ndarray, law: np.ndarray, point: np.ndarray, first: int, last: int) -> None:
    """Friction forces and what is beyond the base state, from the pressures in row OUT_P."""
    area, factor = points[at.POINT_AREA], points[at.POINT_FRICTION]
    w1, w2, p = point[at.OUT_W1], point[at.OUT_W2], point[at.OUT_P]
    frictions(law, area, factor, w1, w2, p, point[at.OUT_T1], point[at.OUT_T2], first, last)
    other_forces(points, law, point, first, last)
    beyond_base(points, point, first, last)


@hot_kernel
def begin_points(points: np.ndarray, point: np.ndarray, first: int, last: int) -> None:
    """Absolute sliding velocities from those of the motion."""
    speed, w1 = points[at.POINT_SPEED], point[at.OUT_W1]
    for i in range(first, last):
        w1[i] += speed[i]


@hot_kernel
def beyond_base(points: np.ndarray, point: np.ndarray, first: int, last: int) -> None:
    """Rows R_* of the points first to last - 1: forces less those of the base state."""
    for i in range(first, last):
        normal = points[at.POINT_AREA, i] * point[at.OUT_P, i] - points[at.POINT_NORMAL, i]
        point[at.R_N, i] = normal + points[at.POINT_STIFFNESS, i] * point[at.OUT_X, i]
        point[at.R_1, i] = point[at.OUT_T1, i] - points[at.POINT_T1, i]
        point[at.R_2, i] = point[at.OUT_T2, i] - points[at.POINT_T2, i]


@hot_kernel
def point_forces(
    points: np.ndarray, law: np.ndarray, point: np.ndarray, first: int, last: int
) -> None:
    """State and generalised forces of the points first to last - 1 of one design.

    Parameters
    ----------
    points : ndarray (N_POINT_ROWS, nc), law : ndarray (N_LAW,)
    point : ndarray (N_POINT, nc)
        The rows OUT_X, OUT_W1 and OUT_W2 hold N q [m], T1 q' and T2 q' [m/s]; the velocities are
        overwritten with the absolute ones, the rows behind them and R_* are filled.

    Notes
    -----
    R_N contains + k_ref x: the tangent at the reference is inside the diagonal stiffness.
    """
    begin_points(points, point, first, last)
    pressures(law, points[at.POINT_GAP], point[at.OUT_X], point[at.OUT_P], first, last)
    spring_pressures(points, point, first, last)
    slide(points, law, point, first, last)


@fast_kernel
def tangents(
    law: np.ndarray, points: np.ndarray, point: np.ndarray, i: int
) -> tuple[float, float, float, float, float, float]:
    """Derivatives of the forces R_* of the evaluated point i.

    dr_n/dx, dt1/dx, dt2/dx [N/m], dt1/dw1, dt1/dw2 = dt2/dw1, dt2/dw2 [N s/m].
    """
    area = points[at.POINT_AREA, i]
    p, kappa = pressure_of(law, points, i, point[at.OUT_X, i])
    w1, w2 = point[at.OUT_W1, i], point[at.OUT_W2, i]
    point_law = law[law_begin(points, i) :]
    d11, d12, d22, s1, s2 = friction_tangent(point_law, points[at.POINT_FRICTION, i], p, w1, w2)
    if points[at.POINT_SPRING_DAMPING, i] != 0.0:
        _, d11 = damper_force(w1, points[at.POINT_SPRING_DAMPING, i])
    kn, push = points[at.POINT_STIFFNESS, i] - area * kappa, -area * kappa
    return kn, push * s1, push * s2, area * d11, area * d12, area * d22
