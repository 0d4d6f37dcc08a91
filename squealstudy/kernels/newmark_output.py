"""Energies, torque, contact shares and the rows of the histories."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, hot_kernel, part_kernel
from squealstudy.kernels.newmark_between import damping_work
from squealstudy.kernels.newmark_layout import ModalArrays, SavedArrays, StepSettings, WorkArrays
from squealstudy.kernels.newmark_vector import copy, dot, fill
from squealstudy.kernels.regimes import find_regimes
from squealstudy.kernels.row_sums import (
    add_row,
    clear_sums,
    close_row,
    close_squares,
    take_now,
)
from squealstudy.kernels.spring_points import energy_of

OPEN_SHARE = 0.01  # a point is open below this share of the mean pressure of steady sliding


@hot_kernel
def add_work(
    modal: ModalArrays, settings: StepSettings, work: WorkArrays, k: int, h: float
) -> None:
    """Work over an accepted sub-step h, with the new velocity in row V_TRIAL and the old one in V.

    Products of means are exact for average acceleration, whose energies balance; with the products
    of `settings.changes` = 1 this is the trapezoidal rule of force times velocity, which has no
    bias over periods of motion that is smooth.
    """
    x, modes, share = work.x[k], modal.modes[k], settings.changes
    w_load = 0.0
    damped = 0.0
    for j in range(x.shape[1]):
        total, change = x[at.V_TRIAL, j] + x[at.V, j], x[at.V_TRIAL, j] - x[at.V, j]
        w_load += modes[at.LOAD, j] * total
        damped += modes[at.C, j] * (total * total + share * change * change)
    for m in range(modal.shapes.shape[0]):
        if modal.component_terms[k, 0, m] == 0.0:
            continue
        y0, y1 = dot(modal.shapes[m], x[at.V]), dot(modal.shapes[m], x[at.V_TRIAL])
        damped += modal.component_terms[k, 0, m] * ((y0 + y1) ** 2 + share * (y1 - y0) ** 2)
    if modal.between_of[k] >= 0:
        damped += damping_work(x, share)
    nc = modal.fixed.shape[2]
    load, belt, sliding = contact_work(modal.points[k], work.point[k], nc, share)
    real = work.real[k]
    real[at.W_LOAD] += 0.5 * h * (w_load + load)
    real[at.W_BELT] += 0.5 * h * belt
    real[at.D_FRICTION] -= 0.25 * h * sliding
    real[at.D_DAMPING] += 0.25 * h * damped


@hot_kernel
def contact_work(
    points: np.ndarray, point: np.ndarray, nc: int, share: float
) -> tuple[float, float, float]:
    """Powers at nc points over a step, from the states before and after it; `share` as above.

    Twice the mean power of the loads that balance the base and of the belt, four times that of
    friction, W.
    """
    load = 0.0
    belt = 0.0
    sliding = 0.0
    for i in range(nc):
        w1 = point[at.OLD_W1, i] + point[at.OUT_W1, i]
        w2 = point[at.OLD_W2, i] + point[at.OUT_W2, i]
        t1 = point[at.OLD_T1, i] + point[at.OUT_T1, i]
        t2 = point[at.OLD_T2, i] + point[at.OUT_T2, i]
        along = (point[at.OUT_W1, i] - point[at.OLD_W1, i]) * (
            point[at.OUT_T1, i] - point[at.OLD_T1, i]
        )
        across = (point[at.OUT_W2, i] - point[at.OLD_W2, i]) * (
            point[at.OUT_T2, i] - point[at.OLD_T2, i]
        )
        speed = points[at.POINT_SPEED, i]
        belt -= speed * t1
        sliding += w1 * t1 + w2 * t2 + share * (along + across)
        load -= points[at.POINT_T1, i] * (w1 - 2.0 * speed) + points[at.POINT_T2, i] * w2
    return load, belt, sliding


@fast_kernel
def modal_energy(x: np.ndarray, w2: np.ndarray) -> float:
    """Kinetic energy and that of the reference stiffness, J."""
    total = 0.0
    for j in range(w2.size):
        total += x[at.V, j] * x[at.V, j] + w2[j] * x[at.Q, j] * x[at.Q, j]
    return 0.5 * total


@fast_kernel
def stored_energy(modal: ModalArrays, work: WorkArrays, k: int) -> float:
    """All stored energy of design k from the reference state, J, contact potential included."""
    x = work.x[k]
    total = modal_energy(x, modal.modes[k, at.W2])
    for m in range(modal.shapes.shape[0]):
        y = dot(modal.shapes[m], x[at.Q])
        total += 0.5 * modal.component_terms[k, 1, m] * y * y
    gaps = work.point[k, at.OUT_X][: modal.fixed.shape[2]]  # without those that fill a tile
    return total + contact_energy(modal.points[k], modal.laws[k], gaps)


@fast_kernel
def contact_energy(points: np.ndarray, law: np.ndarray, gaps: np.ndarray) -> float:
    """Energy [J] of all points from the reference state beyond the tangents in the stiffness.

    `gaps` (nc,) are their changes.
    """
    total = 0.0
    for i in range(gaps.size):
        gap = gaps[i]
        U = energy_of(law, points, i, gap) - energy_of(law, points, i, 0.0)
        total += (
            points[at.POINT_AREA, i] * U
            + points[at.POINT_NORMAL, i] * gap
            - 0.5 * points[at.POINT_STIFFNESS, i] * gap * gap
        )
    return total


@fast_kernel
def brakes(points: np.ndarray, i: int) -> bool:
    """Whether sliding with friction is imposed on point i."""
    if points[at.POINT_FRICTION, i] == 0.0:
        return False
    return points[at.POINT_LAW, i] <= 0.0 or points[at.POINT_RADIUS, i] != 0.0


@hot_kernel
def contact_row(
    points: np.ndarray,
    law: np.ndarray,
    point: np.ndarray,
    nc: int,
    own: np.ndarray,
    h: float,
    row: np.ndarray,
) -> None:
    """Torque, normal force, shares of the area, and creep of nc points, into a row of histories.

    Their regimes are known. Points without friction neither stick nor slip, and no sliding is
    imposed on some (an arm of 0 and a law of their own): none of these counts them. A point is open
    below 1 % of the area mean of pressure in the design's own steady sliding, whatever the others
    do at that instant: a contact may lift off as a whole.

    The friction of a point that sticks alternates from step to step where the step is long for its
    slope: k_t A times its compliance `own` (Modal.self_compliance, empty where unknown) is then
    above 1. It counts with its mean over the last sub-step h, as the trapezoidal rule applied it.
    """
    torque = 0.0
    force = 0.0
    steady = 0.0
    area = 0.0
    for i in range(nc):
        torque -= points[at.POINT_RADIUS, i] * point[at.OUT_T1, i]
        if brakes(points, i):
            force += points[at.POINT_AREA, i] * point[at.OUT_P, i]
            steady += points[at.POINT_NORMAL, i]
            area += points[at.POINT_AREA, i]
    stick = 0.0
    opened = 0.0
    creep = 0.0
    limit = OPEN_SHARE * steady / area if area > 0.0 else 0.0
    for i in range(nc):
        if not brakes(points, i):
            continue
        if point[at.OUT_P, i] <= limit:
            opened += points[at.POINT_AREA, i] / area
        elif point[at.OUT_REGIME, i] == at.STICKS:
            stick += points[at.POINT_AREA, i] / area
            w1, w2, speed = point[at.OUT_W1, i], point[at.OUT_W2, i], abs(points[at.POINT_SPEED, i])
            creep = max(creep, (w1 * w1 + w2 * w2) ** 0.5 / speed if speed > 0.0 else 0.0)
            if i < own.size and law[at.LAW_SLOPE] * points[at.POINT_AREA, i] * own[i] > 1.0:
                torque += 0.5 * h * points[at.POINT_RADIUS, i] * point[at.RATE_1, i]
    row[at.TORQUE] = torque
    row[at.NORMAL_FORCE] = force
    row[at.STICK] = stick
    row[at.SLIP] = 1.0 - stick - opened if area > 0.0 else 0.0
    row[at.OPEN] = opened
    row[at.CREEP] = creep


@fast_kernel
def ringing_step(settings: StepSettings, h: float) -> float:
    """Sub-step h over which friction may alternate; 0 where steps are cut and it does not."""
    return 0.0 if settings.corner_halvings > 0 else h


@fast_kernel
def begin_sums(modal: ModalArrays, work: WorkArrays, k: int) -> None:
    """The initial state of design k is where its sums begin."""
    row, sums, x = work.now[k], work.sums[k], work.x[k]
    nc = modal.fixed.shape[2]
    contact_row(modal.points[k], modal.laws[k], work.point[k], nc, modal.self_compliance, 0.0, row)
    row[at.MODAL_ENERGY] = modal_energy(x, modal.modes[k, at.W2])
    take_now(sums, row)
    clear_sums(sums)


@hot_kernel
def add_sums(
    modal: ModalArrays, settings: StepSettings, work: WorkArrays, k: int, h: float
) -> None:
    """Add the accepted sub-step h of design k; Q and V hold its end, the rows before them are gone.

    Squares of the coordinates are summed by the rule of rectangles, which over many steps is the
    trapezoidal one but for the first and the last.
    """
    row, sums, x = work.now[k], work.sums[k], work.x[k]
    nc, rings = modal.fixed.shape[2], ringing_step(settings, h)
    contact_row(
        modal.points[k], modal.laws[k], work.point[k], nc, modal.self_compliance, rings, row
    )
    row[at.MODAL_ENERGY] = modal_energy(x, modal.modes[k, at.W2])
    add_row(sums, row, h)
    for j in range(x.shape[1]):
        x[at.SUM_QQ, j] += h * x[at.Q, j] * x[at.Q, j]
        x[at.SUM_VV, j] += h * x[at.V, j] * x[at.V, j]


@part_kernel
def save(
    modal: ModalArrays, settings: StepSettings, work: WorkArrays, saved: SavedArrays, k: int
) -> None:
    """Append the accepted state of design k to its histories."""
    counts, x = work.counts[k], work.x[k]
    number = counts[at.SAVED]
    row = saved.history[k, number]
    fill(row, 0.0)
    row[at.TIME] = counts[at.STEP] * settings.h
    nc = modal.fixed.shape[2]
    if nc > 0:
        points, law, point = modal.points[k], modal.laws[k], work.point[k]
        find_regimes(points, law, point, nc)
        rings = ringing_step(settings, work.real[k, at.SUBSTEP_OLD])
        contact_row(points, law, point, nc, modal.self_compliance, rings, row)
    for i in range(4):
        row[at.WORK + i] = work.real[k, at.W_LOAD + i]
    row[at.STORED] = stored_energy(modal, work, k)
    row[at.MODAL_ENERGY] = modal_energy(x, modal.modes[k, at.W2])
    for m in range(modal.sensors.shape[1]):
        saved.sensed[k, number, 0, m] = dot(modal.sensors[k, m], x[at.Q])
        saved.sensed[k, number, 1, m] = dot(modal.sensors[k, m], x[at.V])
    close_squares(x, modal.sensors[k], work.sums[k, at.SUM_TIME], saved.squares[k, number])
    close_row(work.sums[k], row)
    if saved.q.shape[1] > 0:
        copy(x[at.Q], saved.q[k, number])
    counts[at.SAVED] += 1
