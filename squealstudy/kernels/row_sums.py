"""Sums over every accepted sub-step between two saved rows: levels do not depend on the rows.

Trapezoidal over sub-steps of any length. Torque and its square are summed less the torque of the
row before, so that small fluctuations about a large mean keep their digits.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, hot_kernel


@hot_kernel
def add_row(sums: np.ndarray, row: np.ndarray, h: float) -> None:
    """Add a sub-step h that ends with a row of histories; its columns of contact and energy."""
    torque, stick, opened, energy = (
        row[at.TORQUE],
        row[at.STICK],
        row[at.OPEN],
        row[at.MODAL_ENERGY],
    )
    old, new = sums[at.NOW_TORQUE] - sums[at.ROW_TORQUE], torque - sums[at.ROW_TORQUE]
    sums[at.SUM_TIME] += h
    sums[at.SUM_TORQUE] += 0.5 * h * (old + new)
    sums[at.SUM_SQUARE] += 0.5 * h * (old * old + new * new)
    sums[at.SUM_STICK] += 0.5 * h * (sums[at.NOW_STICK] + stick)
    sums[at.SUM_OPEN] += 0.5 * h * (sums[at.NOW_OPEN] + opened)
    sums[at.SUM_ENERGY] += h * energy  # as the squares of all modes are: shares sum to one
    sums[at.LEAST_TORQUE] = min(sums[at.LEAST_TORQUE], torque)
    sums[at.MOST_TORQUE] = max(sums[at.MOST_TORQUE], torque)
    sums[at.MOST_STICK] = max(sums[at.MOST_STICK], stick)
    sums[at.MOST_OPEN] = max(sums[at.MOST_OPEN], opened)
    sums[at.MOST_CREEP] = max(sums[at.MOST_CREEP], row[at.CREEP])
    take_now(sums, row)


@fast_kernel
def take_now(sums: np.ndarray, row: np.ndarray) -> None:
    """Keep the end of a sub-step: the next one begins there."""
    sums[at.NOW_TORQUE], sums[at.NOW_STICK] = row[at.TORQUE], row[at.STICK]
    sums[at.NOW_OPEN] = row[at.OPEN]


@fast_kernel
def clear_sums(sums: np.ndarray) -> None:
    """Begin anew at a saved row. Its own values are the end of the sub-step before, not counted."""
    for c in range(at.LEAST_TORQUE):
        sums[c] = 0.0
    sums[at.LEAST_TORQUE], sums[at.MOST_TORQUE] = np.inf, -np.inf
    sums[at.MOST_STICK] = sums[at.MOST_OPEN] = sums[at.MOST_CREEP] = 0.0
    sums[at.ROW_TORQUE] = sums[at.NOW_TORQUE]


@fast_kernel
def close_row(sums: np.ndarray, row: np.ndarray) -> None:
    """Columns of a saved row from the sums since the one before, which begin anew.

    NaN where nothing was summed; of the row of the start its own values.
    """
    time = sums[at.SUM_TIME]
    if time > 0.0:
        rest = sums[at.SUM_TORQUE] / time
        row[at.TORQUE_MEAN] = sums[at.ROW_TORQUE] + rest
        row[at.TORQUE_VARIANCE] = max(sums[at.SUM_SQUARE] / time - rest * rest, 0.0)
        row[at.TORQUE_MIN], row[at.TORQUE_MAX] = sums[at.LEAST_TORQUE], sums[at.MOST_TORQUE]
        row[at.STICK_MEAN], row[at.STICK_MAX] = sums[at.SUM_STICK] / time, sums[at.MOST_STICK]
        row[at.OPEN_MEAN], row[at.OPEN_MAX] = sums[at.SUM_OPEN] / time, sums[at.MOST_OPEN]
        row[at.CREEP_MAX] = sums[at.MOST_CREEP]
        row[at.ENERGY_MEAN] = sums[at.SUM_ENERGY] / time
    elif row[at.TIME] > 0.0:
        for c in range(at.TORQUE_MEAN, row.size):
            row[c] = np.nan
    else:
        row[at.TORQUE_MEAN] = row[at.TORQUE_MIN] = row[at.TORQUE_MAX] = row[at.TORQUE]
        row[at.STICK_MEAN] = row[at.STICK_MAX] = row[at.STICK]
        row[at.OPEN_MEAN] = row[at.OPEN_MAX] = row[at.OPEN]
        row[at.CREEP_MAX], row[at.ENERGY_MEAN] = row[at.CREEP], row[at.MODAL_ENERGY]
    clear_sums(sums)


@fast_kernel
def close_squares(x: np.ndarray, sensors: np.ndarray, time: float, squares: np.ndarray) -> None:
    """Means of q^2 and v^2 (2, modes) since the row before, of modes that the first sensors see."""
    for m in range(squares.shape[1]):
        squares[0, m], squares[1, m] = np.nan, np.nan
        if time > 0.0:
            qq = 0.0
            vv = 0.0
            for j in range(x.shape[1]):
                qq += sensors[m, j] * sensors[m, j] * x[at.SUM_QQ, j]
                vv += sensors[m, j] * sensors[m, j] * x[at.SUM_VV, j]
            squares[0, m], squares[1, m] = qq / time, vv / time
    for j in range(x.shape[1]):
        x[at.SUM_QQ, j] = x[at.SUM_VV, j] = 0.0
