"""Forces of the contact points: contact law, friction law, and what is relative to the base state.

Row layouts shared by the Newmark kernels (all f8, one column a contact point):

`points` (8, nc) of a design point: the rows POINT_* below.
`law` (9,) of a design point: the entries LAW_* below; codes are stored as floats.
`point` (N_POINT, nc), the state of a design's contact points: one evaluation leaves the rows OUT_*
and, for B^T r, the rows R_*.
"""

from __future__ import annotations

import math

import numpy as np

from squealstudy.kernels.contact_laws import law_at
from squealstudy.kernels.exponential import exponential
from squealstudy.kernels.friction_laws import mu_at, resistance
from squealstudy.kernels.jit import fast_kernel

# points: base gap m, area m2, factor on friction (0 or 1), arm of the torque m, contact stiffness
# N/m inside the diagonal stiffness, base forces N
POINT_GAP, POINT_AREA, POINT_FRICTION, POINT_RADIUS = 0, 1, 2, 3
POINT_STIFFNESS, POINT_NORMAL, POINT_T1, POINT_T2 = 4, 5, 6, 7
# law: contact code, a, b; friction code, mu_s, mu_d, v_mu m/s, k_t N s/m3; sliding velocity m/s
LAW_CONTACT, LAW_A, LAW_B = 0, 1, 2
LAW_FRICTION, LAW_MU_S, LAW_MU_D, LAW_V_MU, LAW_K_T, LAW_SPEED = 3, 4, 5, 6, 7, 8
# point: change of gap m, sliding velocity m/s, pressure Pa, friction force N; generalised forces N
OUT_X, OUT_W1, OUT_W2, OUT_P, OUT_T1, OUT_T2 = 0, 1, 2, 3, 4, 5
R_N, R_1, R_2 = 6, 7, 8


@fast_kernel
def pressures(
    law: np.ndarray, points: np.ndarray, point: np.ndarray, first: int, last: int
) -> None:
    """Contact pressure [Pa] of the points first to last - 1 into the row OUT_P of `point`."""
    code, a, b = int(law[0]), law[1], law[2]
    gap, x, p = points[POINT_GAP], point[OUT_X], point[OUT_P]
    if code == 0:
        for i in range(first, last):
            p[i] = a * exponential(-b * (gap[i] + x[i]))
    else:
        for i in range(first, last):
            p[i], _ = law_at(code, a, b, gap[i] + x[i])


@fast_kernel
def frictions(
    law: np.ndarray, points: np.ndarray, point: np.ndarray, first: int, last: int
) -> None:
    """Friction forces [N] of the points first to last - 1 into the rows OUT_T1 and OUT_T2.

    The commonest law has a loop of its own, without the others' exponentials.
    """
    code, mu_s, mu_d, v_mu, k_t = int(law[3]), law[4], law[5], law[6], law[7]
    area, factor = points[POINT_AREA], points[POINT_FRICTION]
    w1, w2, p = point[OUT_W1], point[OUT_W2], point[OUT_P]
    t1, t2 = point[OUT_T1], point[OUT_T2]
    if code == 0 and mu_s == mu_d:
        for i in range(first, last):
            s = math.sqrt(w1[i] * w1[i] + w2[i] * w2[i])
            f = area[i] * resistance(0, k_t, factor[i] * mu_d * p[i], s)
            t1[i], t2[i] = -f * w1[i], -f * w2[i]
    else:
        for i in range(first, last):
            s = math.sqrt(w1[i] * w1[i] + w2[i] * w2[i])
            mu, _ = mu_at(mu_s, mu_d, v_mu, s)
            f = area[i] * resistance(code, k_t, factor[i] * mu * p[i], s)
            t1[i], t2[i] = -f * w1[i], -f * w2[i]


@fast_kernel
def beyond_base(points: np.ndarray, point: np.ndarray, first: int, last: int) -> None:
    """Rows R_* of the points first to last - 1: forces less those of the base state."""
    for i in range(first, last):
        normal = points[POINT_AREA, i] * point[OUT_P, i] - points[POINT_NORMAL, i]
        point[R_N, i] = normal + points[POINT_STIFFNESS, i] * point[OUT_X, i]
        point[R_1, i] = point[OUT_T1, i] - points[POINT_T1, i]
        point[R_2, i] = point[OUT_T2, i] - points[POINT_T2, i]


@fast_kernel
def point_forces(
    points: np.ndarray, law: np.ndarray, point: np.ndarray, first: int, last: int
) -> None:
    """State and generalised forces of the points first to last - 1 of one design.

    Parameters
    ----------
    points : ndarray (8, nc), law : ndarray (9,)
    point : ndarray (N_POINT, nc)
        The rows OUT_X, OUT_W1 and OUT_W2 hold N q [m], T1 q' and T2 q' [m/s]; the velocities are
        overwritten with the absolute ones, the rows behind them and R_* are filled.

    Notes
    -----
    R_N contains + k_ref x: the tangent at the reference is inside the diagonal stiffness.
    """
    speed, w1 = law[8], point[OUT_W1]
    for i in range(first, last):
        w1[i] += speed
    pressures(law, points, point, first, last)
    frictions(law, points, point, first, last)
    beyond_base(points, point, first, last)


@fast_kernel
def potential(code: int, a: float, b: float, g: float) -> float:
    """Stored energy per area U(g) = integral of p from g to an open gap [J/m2]."""
    p, kappa = law_at(code, a, b, g)
    if code == 0:
        return p / b
    if kappa == 0.0:
        return 0.0
    return -p * g / (b + 1.0) if code == 2 else 0.5 * p * p / kappa
