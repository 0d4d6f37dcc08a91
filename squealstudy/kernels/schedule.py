"""Runs whose sliding speed or brake pressure changes: both are imposed at each sub-step.

The loop is one of its own: a branch in `newmark_batch` made steps of few degrees of freedom longer,
whether it was taken or not.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, lean_entry_kernel
from squealstudy.kernels.newmark_batch import goes_on
from squealstudy.kernels.newmark_forces import pass_one
from squealstudy.kernels.newmark_layout import (
    ModalArrays,
    SavedArrays,
    ScheduleArrays,
    StepSettings,
    WorkArrays,
)
from squealstudy.kernels.newmark_step import advance
from squealstudy.kernels.newmark_vector import dot


@fast_kernel
def between(times: np.ndarray, values: np.ndarray, time: float) -> float:
    """Straight line between points (m,), constant before the first and behind the last."""
    low, high = 0, times.size - 1
    if time <= times[low]:
        return values[low]
    if time >= times[high]:
        return values[high]
    while high - low > 1:
        middle = (low + high) // 2
        if times[middle] <= time:
            low = middle
        else:
            high = middle
    share = (time - times[low]) / (times[high] - times[low])
    return values[low] + share * (values[high] - values[low])


@fast_kernel
def slide_at(points: np.ndarray, speeds: np.ndarray, ratio: float) -> None:
    """Sliding speeds of points (N_POINT_ROWS, ..): that share of their own (nc,)."""
    for i in range(speeds.size):
        points[at.POINT_SPEED, i] = ratio * speeds[i]


@fast_kernel
def turn_at(G: np.ndarray, staying: np.ndarray, following: np.ndarray, ratio: float) -> None:
    """Gyroscopic terms G (n, n) at that share of the points' own speed."""
    for i in range(G.shape[0]):
        for j in range(G.shape[0]):
            G[i, j] = staying[i, j] + np.float32(ratio) * following[i, j]


@fast_kernel
def press_by(loads: np.ndarray, rise: float, load: np.ndarray) -> None:
    """The load (n,) where the pressure has risen by that share; `loads` (2, n or 0)."""
    for j in range(loads.shape[1]):
        load[j] = loads[at.STAYING, j] + rise * loads[at.PRESSING, j]


@fast_kernel
def pressed(loads: np.ndarray, q: np.ndarray) -> float:
    """Work [J] of the load of the brake pressure up to displacements q; `loads` (2, n or 0)."""
    total = 0.0
    for j in range(loads.shape[1]):
        total += loads[at.PRESSING, j] * q[j]
    return total


@lean_entry_kernel
def newmark_scheduled(
    B: np.ndarray,
    modal: ModalArrays,
    settings: StepSettings,
    work: WorkArrays,
    saved: SavedArrays,
    schedule: ScheduleArrays,
) -> None:
    """As `newmark_batch` of designs with schedules, each to its end or pause before the next.

    Forces are those of speed and pressure at the end of a sub-step. A step that is accepted counts
    the works of the design point's own speed and of the pressure at its end: what they lack of
    those of the mean speed and pressure is added here.
    """
    whole, times = 1 << settings.levels, schedule.times
    for k in range(work.counts.shape[0]):
        counts, real, x, point = work.counts[k], work.real[k], work.x[k], work.point[k]
        points, loads, base_speeds = modal.points[k], schedule.loads[k], schedule.speeds[k]
        turning = modal.turning_of[k]
        speeds = schedule.ratios[k, at.SPEED_RATIO]
        pressures = schedule.ratios[k, at.PRESSURE_RATIO]
        friction = point[at.OLD_T1][: base_speeds.size]
        steady_power = dot(base_speeds, points[at.POINT_T1][: base_speeds.size])
        while goes_on(counts):
            step, position, h = counts[at.STEP], counts[at.POSITION], real[at.SUBSTEP]
            start = settings.h * (step + position / whole)
            speed, rise = between(times, speeds, start + h), between(times, pressures, start + h)
            slide_at(points, base_speeds, speed)
            if turning >= 0:
                staying, following = schedule.turning[turning], schedule.following[turning]
                turn_at(modal.turning[turning], staying, following, speed)
            press_by(loads, rise - 1.0, modal.modes[k, at.LOAD])
            pass_one(B, modal, work, k)
            slide_at(points, base_speeds, 1.0)
            pushed, drag = pressed(loads, x[at.Q]), dot(base_speeds, friction)
            rows = counts[at.SAVED]
            advance(B, modal, settings, work, saved, k)
            if counts[at.STEP] == step and counts[at.POSITION] == position:
                continue
            faster = 0.5 * (between(times, speeds, start) + speed) - 1.0
            less = 0.5 * (between(times, pressures, start) - rise)
            load = h * faster * steady_power + less * (pressed(loads, x[at.Q]) - pushed)
            belt = -0.5 * h * faster * (drag + dot(base_speeds, friction))
            real[at.W_LOAD] += load
            real[at.W_BELT] += belt
            if counts[at.SAVED] > rows:  # the step that was accepted is a row already
                row = saved.history[k, rows]
                row[at.WORK] += load
                row[at.WORK + 1] += belt
