"""Runs whose sliding speed or brake pressure changes: both are imposed at each sub-step.

They have a loop of their own: a branch in `newmark_batch` would slow down all steps of few degrees
of freedom.
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
def interpolated(times: np.ndarray, values: np.ndarray, time: float) -> float:
    """Value at a time by straight lines between points (m,), constant before and after them."""
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
def set_sliding_speeds(points: np.ndarray, speeds: np.ndarray, speed_ratio: float) -> None:
    """Set the sliding speeds of points (N_POINT_ROWS, ..) to a ratio of their base speeds (nc,)."""
    for i in range(speeds.size):
        points[at.POINT_SPEED, i] = speed_ratio * speeds[i]


@fast_kernel
def set_gyroscopic_terms(
    G: np.ndarray, fixed_terms: np.ndarray, terms_by_speed: np.ndarray, speed_ratio: float
) -> None:
    """Set gyroscopic terms G (n, n) to those at a ratio of the base speed."""
    for i in range(G.shape[0]):
        for j in range(G.shape[0]):
            G[i, j] = fixed_terms[i, j] + np.float32(speed_ratio) * terms_by_speed[i, j]


@fast_kernel
def set_load(loads: np.ndarray, rise: float, load: np.ndarray) -> None:
    """Set the load (n,) to that at a relative rise of the pressure; `loads` (2, n or 0)."""
    for j in range(loads.shape[1]):
        load[j] = loads[at.STAYING, j] + rise * loads[at.PRESSING, j]


@fast_kernel
def work_of_pressure(loads: np.ndarray, q: np.ndarray) -> float:
    """Work [J] of the load by brake pressure at displacements q; `loads` (2, n or 0)."""
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

    Forces are those of speed and pressure at the end of a sub-step. `advance` counts works at the
    base speed and at the pressure of the end: the difference to those at the mean speed and the
    mean pressure of the sub-step is added here.
    """
    sub_steps_per_step, times = 1 << settings.levels, schedule.times
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
            start = settings.h * (step + position / sub_steps_per_step)
            speed_ratio, pressure_ratio = (
                interpolated(times, speeds, start + h),
                interpolated(times, pressures, start + h),
            )
            set_sliding_speeds(points, base_speeds, speed_ratio)
            if turning >= 0:
                fixed_terms, terms_by_speed = (
                    schedule.turning[turning],
                    schedule.terms_by_speed[turning],
                )
                set_gyroscopic_terms(
                    modal.turning[turning], fixed_terms, terms_by_speed, speed_ratio
                )
            set_load(loads, pressure_ratio - 1.0, modal.modes[k, at.LOAD])
            pass_one(B, modal, work, k)
            set_sliding_speeds(points, base_speeds, 1.0)
            pressure_work, friction_power = (
                work_of_pressure(loads, x[at.Q]),
                dot(base_speeds, friction),
            )
            n_saved = counts[at.SAVED]
            advance(B, modal, settings, work, saved, k)
            if counts[at.STEP] == step and counts[at.POSITION] == position:
                continue
            mean_speed_excess = 0.5 * (interpolated(times, speeds, start) + speed_ratio) - 1.0
            mean_pressure_excess = 0.5 * (interpolated(times, pressures, start) - pressure_ratio)
            load_work = h * mean_speed_excess * steady_power + mean_pressure_excess * (
                work_of_pressure(loads, x[at.Q]) - pressure_work
            )
            belt_work = -0.5 * h * mean_speed_excess * (friction_power + dot(base_speeds, friction))
            real[at.W_LOAD] += load_work
            real[at.W_BELT] += belt_work
            if counts[at.SAVED] > n_saved:  # `advance` has saved a row of this step
                row = saved.history[k, n_saved]
                row[at.WORK] += load_work
                row[at.WORK + 1] += belt_work
