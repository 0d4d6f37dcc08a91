"""Contact forces and their tangents at the samples of a period, by the laws of runs in time."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import entry_kernel, fast_kernel
from squealstudy.kernels.newmark_forces import point_forces, tangents
from squealstudy.kernels.newmark_output import contact_row
from squealstudy.kernels.regimes import find_regimes


@entry_kernel
def sampled_forces(
    points: np.ndarray,
    law: np.ndarray,
    y: np.ndarray,
    w: np.ndarray,
    f: np.ndarray,
    by_y: np.ndarray,
    by_w: np.ndarray,
) -> None:
    """Forces beyond those of the base state, R_N, R_1 and R_2, with their derivatives.

    Parameters
    ----------
    points : ndarray (N_POINT_ROWS, nc)
    law : ndarray (N_LAW,)
    y, w : ndarray (S, nc, 3)
        Changes of gap and sliding [m], and their velocities [m/s].
    f : ndarray (S, nc, 3)
        N.
    by_y, by_w : ndarray (S, nc, 3, 3)
        N/m, N s/m.
    """
    nc = points.shape[1]
    point = np.zeros((at.N_POINT, nc))
    for s in range(y.shape[0]):
        _take(y, w, point, s)
        point_forces(points, law, point, 0, nc)
        for i in range(nc):
            for c in range(3):
                f[s, i, c] = point[at.R_N + c, i]
            kn, k1, k2, d11, d12, d22 = tangents(law, points, point, i)
            by_y[s, i, 0, 0], by_y[s, i, 1, 0], by_y[s, i, 2, 0] = kn, k1, k2
            by_w[s, i, 1, 1], by_w[s, i, 2, 2] = d11, d22
            by_w[s, i, 1, 2] = by_w[s, i, 2, 1] = d12


@entry_kernel
def sampled_rows(
    points: np.ndarray,
    law: np.ndarray,
    y: np.ndarray,
    w: np.ndarray,
    rows: np.ndarray,
    powers: np.ndarray,
) -> None:
    """Rows of histories (S, len(HISTORY)), of which those of `contact_row` are filled.

    And powers (S, 3) [W]: of friction, dissipated; of the belt; of the loads that balance the base.
    """
    nc = points.shape[1]
    point, own = np.zeros((at.N_POINT, nc)), np.zeros(0)
    for s in range(y.shape[0]):
        _take(y, w, point, s)
        point_forces(points, law, point, 0, nc)
        find_regimes(points, law, point, nc)
        contact_row(points, law, point, nc, own, 0.0, rows[s])
        for i in range(nc):
            w1, w2, speed = point[at.OUT_W1, i], point[at.OUT_W2, i], points[at.POINT_SPEED, i]
            t1, t2 = point[at.OUT_T1, i], point[at.OUT_T2, i]
            powers[s, 0] -= w1 * t1 + w2 * t2
            powers[s, 1] -= speed * t1
            powers[s, 2] -= points[at.POINT_T1, i] * (w1 - speed) + points[at.POINT_T2, i] * w2


@fast_kernel
def _take(y: np.ndarray, w: np.ndarray, point: np.ndarray, s: int) -> None:
    for i in range(point.shape[1]):
        point[at.OUT_X, i] = y[s, i, 0]
        point[at.OUT_W1, i], point[at.OUT_W2, i] = w[s, i, 1], w[s, i, 2]
