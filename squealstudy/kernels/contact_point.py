"""Forces of one contact point: contact law, friction law, and what is relative to a reference.

Column layouts shared by the Newmark kernels (all f8, one row a contact point or a design point):

`points` (nc, 8), shared by all designs: the columns POINT_* below.
`laws` (nb, 9), one row a design point: the columns LAW_* below; codes are stored as floats.
`trial` (nc, 6), what one evaluation leaves: the columns OUT_* below.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.contact_laws import law_at
from squealstudy.kernels.friction_laws import friction_at
from squealstudy.kernels.jit import fast_kernel

# points: reference gap m, area m2, factor on friction (0 or 1), arm of the torque m, reference
# contact stiffness N/m, reference forces N
POINT_GAP, POINT_AREA, POINT_FRICTION, POINT_RADIUS = 0, 1, 2, 3
POINT_STIFFNESS, POINT_NORMAL, POINT_T1, POINT_T2 = 4, 5, 6, 7
# laws: contact code, a, b; friction code, mu_s, mu_d, v_mu m/s, k_t N s/m3; sliding velocity m/s
LAW_CONTACT, LAW_A, LAW_B = 0, 1, 2
LAW_FRICTION, LAW_MU_S, LAW_MU_D, LAW_V_MU, LAW_K_T, LAW_SPEED = 3, 4, 5, 6, 7, 8
# trial: change of gap m, sliding velocity m/s, pressure Pa, friction force N
OUT_X, OUT_W1, OUT_W2, OUT_P, OUT_T1, OUT_T2 = 0, 1, 2, 3, 4, 5


@fast_kernel
def point_force(
    point: np.ndarray, law: np.ndarray, x: float, v1: float, v2: float, out: np.ndarray
) -> tuple[float, float, float]:
    """Generalised forces (rn, r1, r2) [N] of one point, relative to the reference, for B^T r.

    Parameters
    ----------
    point : ndarray (8,), law : ndarray (9,)
    x, v1, v2 : float
        N q [m], T1 q' and T2 q' [m/s].
    out : ndarray (6,)
        Filled with the absolute state of the point.

    Notes
    -----
    rn contains + k_ref x: the tangent at the reference is inside the diagonal stiffness.
    """
    area, factor = point[1], point[2]
    w1 = law[8] + v1
    p, _ = law_at(int(law[0]), law[1], law[2], point[0] + x)
    t1, t2, _ = friction_at(
        int(law[3]), factor * law[4], factor * law[5], law[6], law[7], p, w1, v2
    )
    t1 *= area
    t2 *= area
    out[0], out[1], out[2], out[3], out[4], out[5] = x, w1, v2, p, t1, t2
    return area * p - point[5] + point[4] * x, t1 - point[6], t2 - point[7]


@fast_kernel
def potential(code: int, a: float, b: float, g: float) -> float:
    """Stored energy per area U(g) = integral of p from g to an open gap [J/m2]."""
    p, kappa = law_at(code, a, b, g)
    if code == 0:
        return p / b
    if kappa == 0.0:
        return 0.0
    return -p * g / (b + 1.0) if code == 2 else 0.5 * p * p / kappa
