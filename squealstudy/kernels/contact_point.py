"""Forces of the contact points: contact law, friction law, less those of the base state.

`points` (8, nc) of a design point: the rows POINT_* of newmark_layout.
`law` (N_LAW,) of a design point: `laws.law_row`.
`point` (N_POINT, nc), the state of a design's contact points: one evaluation leaves the rows OUT_*
and, for B^T r, the rows R_*.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.laws import contact_at, friction_tangent, frictions, pressures


@fast_kernel
def slide(points: np.ndarray, law: np.ndarray, point: np.ndarray, first: int, last: int) -> None:
    """Friction forces and what is beyond the base state, from the pressures in row OUT_P."""
    area, factor = points[at.POINT_AREA], points[at.POINT_FRICTION]
    w1, w2, p = point[at.OUT_W1], point[at.OUT_W2], point[at.OUT_P]
    frictions(law, area, factor, w1, w2, p, point[at.OUT_T1], point[at.OUT_T2], first, last)
    beyond_base(points, point, first, last)


@fast_kernel
def begin_points(law: np.ndarray, point: np.ndarray, first: int, last: int) -> None:
    """Absolute sliding velocities from those of the motion."""
    speed, w1 = law[at.LAW_SPEED], point[at.OUT_W1]
    for i in range(first, last):
        w1[i] += speed


@fast_kernel
def beyond_base(points: np.ndarray, point: np.ndarray, first: int, last: int) -> None:
    """Rows R_* of the points first to last - 1: forces less those of the base state."""
    for i in range(first, last):
        normal = points[at.POINT_AREA, i] * point[at.OUT_P, i] - points[at.POINT_NORMAL, i]
        point[at.R_N, i] = normal + points[at.POINT_STIFFNESS, i] * point[at.OUT_X, i]
        point[at.R_1, i] = point[at.OUT_T1, i] - points[at.POINT_T1, i]
        point[at.R_2, i] = point[at.OUT_T2, i] - points[at.POINT_T2, i]


@fast_kernel
def point_forces(
    points: np.ndarray, law: np.ndarray, point: np.ndarray, first: int, last: int
) -> None:
    """State and generalised forces of the points first to last - 1 of one design.

    Parameters
    ----------
    points : ndarray (8, nc), law : ndarray (N_LAW,)
    point : ndarray (N_POINT, nc)
        The rows OUT_X, OUT_W1 and OUT_W2 hold N q [m], T1 q' and T2 q' [m/s]; the velocities are
        overwritten with the absolute ones, the rows behind them and R_* are filled.

    Notes
    -----
    R_N contains + k_ref x: the tangent at the reference is inside the diagonal stiffness.
    """
    begin_points(law, point, first, last)
    pressures(law, points[at.POINT_GAP], point[at.OUT_X], point[at.OUT_P], first, last)
    slide(points, law, point, first, last)


@fast_kernel
def tangents(
    law: np.ndarray, points: np.ndarray, point: np.ndarray, i: int
) -> tuple[float, float, float, float, float, float]:
    """Derivatives of the forces R_* of the evaluated point i.

    dr_n/dx, dt1/dx, dt2/dx [N/m], dt1/dw1, dt1/dw2 = dt2/dw1, dt2/dw2 [N s/m].
    """
    area = points[at.POINT_AREA, i]
    p, kappa = contact_at(law, points[at.POINT_GAP, i] + point[at.OUT_X, i])
    w1, w2 = point[at.OUT_W1, i], point[at.OUT_W2, i]
    d11, d12, d22, s1, s2 = friction_tangent(law, points[at.POINT_FRICTION, i], p, w1, w2)
    kn, push = points[at.POINT_STIFFNESS, i] - area * kappa, -area * kappa
    return kn, push * s1, push * s2, area * d11, area * d12, area * d22
