"""Energies, torque, contact shares and the rows of the histories."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.contact_point import potential
from squealstudy.kernels.friction_laws import mu_at
from squealstudy.kernels.jit import fast_kernel, part_kernel
from squealstudy.kernels.newmark_layout import (
    D_DAMPING,
    D_FRICTION,
    LOAD,
    OLD,
    SAVED,
    SLOPE,
    STEP,
    SUBSTEP_OLD,
    V_TRIAL,
    W2,
    W_BELT,
    W_LOAD,
    C,
    Modal,
    Q,
    Saved,
    Settings,
    V,
    Work,
)
from squealstudy.kernels.newmark_vector import copy, dot, fill

OPEN = 0.01  # a point is open below this share of the mean pressure


@fast_kernel
def add_work(modal: Modal, settings: Settings, work: Work, k: int, h: float) -> None:
    """Work over an accepted sub-step h, with the new velocity in row V_TRIAL and the old one in V.

    Products of means are exact for average acceleration, whose energies balance; with the products
    of `settings.changes` = 1 this is the trapezoidal rule of force times velocity, which has no
    bias over periods of motion that is smooth.
    """
    x, modes, share = work.x[k], modal.modes[k], settings.changes
    w_load = 0.0
    damped = 0.0
    for j in range(x.shape[1]):
        total, change = x[V_TRIAL, j] + x[V, j], x[V_TRIAL, j] - x[V, j]
        w_load += modes[LOAD, j] * total
        damped += modes[C, j] * (total * total + share * change * change)
    for m in range(modal.shapes.shape[0]):
        if modal.tuned[k, 0, m] == 0.0:
            continue
        y0, y1 = dot(modal.shapes[m], x[V]), dot(modal.shapes[m], x[V_TRIAL])
        damped += modal.tuned[k, 0, m] * ((y0 + y1) ** 2 + share * (y1 - y0) ** 2)
    speed = modal.laws[k, 8]
    belt = 0.0
    sliding = 0.0
    point, points = work.point[k], modal.points[k]
    for i in range(point.shape[1]):
        w1 = point[OLD, i] + point[1, i]
        w2 = point[OLD + 1, i] + point[2, i]
        t1 = point[OLD + 2, i] + point[4, i]
        t2 = point[OLD + 3, i] + point[5, i]
        along = (point[1, i] - point[OLD, i]) * (point[4, i] - point[OLD + 2, i])
        across = (point[2, i] - point[OLD + 1, i]) * (point[5, i] - point[OLD + 3, i])
        belt += t1
        sliding += w1 * t1 + w2 * t2 + share * (along + across)
        w_load -= points[6, i] * (w1 - 2.0 * speed) + points[7, i] * w2
    real = work.real[k]
    real[W_LOAD] += 0.5 * h * w_load
    real[W_BELT] -= 0.5 * h * speed * belt
    real[D_FRICTION] -= 0.25 * h * sliding
    real[D_DAMPING] += 0.25 * h * damped


@fast_kernel
def modal_energy(x: np.ndarray, w2: np.ndarray) -> float:
    """Kinetic energy and that of the reference stiffness, J."""
    total = 0.0
    for j in range(w2.size):
        total += x[V, j] * x[V, j] + w2[j] * x[Q, j] * x[Q, j]
    return 0.5 * total


@fast_kernel
def stored_energy(modal: Modal, work: Work, k: int) -> float:
    """All stored energy of design k from the reference state, J, contact potential included."""
    x = work.x[k]
    total = modal_energy(x, modal.modes[k, W2])
    for m in range(modal.shapes.shape[0]):
        y = dot(modal.shapes[m], x[Q])
        total += 0.5 * modal.tuned[k, 1, m] * y * y
    law = modal.laws[k]
    code = int(law[0])
    points, gaps = modal.points[k], work.point[k, 0]
    for i in range(gaps.size):
        gap = gaps[i]
        U = potential(code, law[1], law[2], points[0, i] + gap)
        U -= potential(code, law[1], law[2], points[0, i])
        total += points[1, i] * U + points[5, i] * gap - 0.5 * points[4, i] * gap * gap
    return total


@fast_kernel
def contact_row(
    points: np.ndarray,
    law: np.ndarray,
    point: np.ndarray,
    own: np.ndarray,
    h: float,
    row: np.ndarray,
) -> None:
    """Torque, normal force, stick, slip and open shares of the area: row[1:6]; creep: row[12].

    The friction of a point that sticks alternates from step to step where the step is long for its
    slope: k_t A times its compliance `own` (Modal.own, empty where unknown) is then above 1. It
    counts with its mean over the last sub-step h, which is what the trapezoidal rule applied.
    """
    torque = 0.0
    force = 0.0
    area = 0.0
    for i in range(points.shape[1]):
        torque -= points[3, i] * point[4, i]
        force += points[1, i] * point[3, i]
        area += points[1, i]
    stick = 0.0
    opened = 0.0
    creep = 0.0
    for i in range(points.shape[1]):
        p = point[3, i]
        s = (point[1, i] * point[1, i] + point[2, i] * point[2, i]) ** 0.5
        mu, _ = mu_at(law[4], law[5], law[6], s)
        if p <= OPEN * force / area:
            opened += points[1, i] / area
        elif law[7] * s < points[2, i] * mu * p:
            stick += points[1, i] / area
            creep = max(creep, s)
            if i < own.size and law[7] * points[1, i] * own[i] > 1.0:
                torque += 0.5 * h * points[3, i] * point[SLOPE, i]
    row[1] = torque
    row[2] = force
    row[3] = stick
    row[4] = 1.0 - stick - opened
    row[5] = opened
    row[12] = creep


@part_kernel
def save(modal: Modal, settings: Settings, work: Work, saved: Saved, k: int) -> None:
    """Append the accepted state of design k to its histories."""
    counts, x = work.counts[k], work.x[k]
    at = counts[SAVED]
    row = saved.history[k, at]
    fill(row, 0.0)
    row[0] = counts[STEP] * settings.h
    if modal.points.shape[2] > 0:
        h = work.real[k, SUBSTEP_OLD]
        contact_row(modal.points[k], modal.laws[k], work.point[k], modal.own, h, row)
    for i in range(4):
        row[6 + i] = work.real[k, W_LOAD + i]
    row[10] = stored_energy(modal, work, k)
    row[11] = modal_energy(x, modal.modes[k, W2])
    for m in range(modal.sensors.shape[1]):
        saved.sensed[k, at, 0, m] = dot(modal.sensors[k, m], x[Q])
        saved.sensed[k, at, 1, m] = dot(modal.sensors[k, m], x[V])
    if saved.q.shape[1] > 0:
        copy(x[Q], saved.q[k, at])
    counts[SAVED] += 1
