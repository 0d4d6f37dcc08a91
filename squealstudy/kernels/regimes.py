"""What each contact point does - slip, stick, be open - and where that changes within a sub-step.

Forces have corners there. A rule of fixed steps errs at each by the step, and where slip ends the
friction found depends on where in the step that was: the sub-step is halved until the corner lies
in a short one (newmark_step.iterate).
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import hot_kernel
from squealstudy.kernels.laws import mu_at, package_mu_at
from squealstudy.kernels.spring_points import other_regimes, regime


@hot_kernel
def find_regimes(points: np.ndarray, law: np.ndarray, point: np.ndarray, nc: int) -> None:
    """Row OUT_REGIME of the first nc evaluated points; a point without friction never sticks.

    Curves from outside have a loop of their own: a call by an address would slow the other.
    """
    w1, w2, p = point[at.OUT_W1], point[at.OUT_W2], point[at.OUT_P]
    factor, found = points[at.POINT_FRICTION], point[at.OUT_REGIME]
    if law[at.LAW_CURVE] == at.OUTSIDE:
        for i in range(nc):
            s = (w1[i] * w1[i] + w2[i] * w2[i]) ** 0.5
            mu, _, _ = mu_at(law, s, p[i])
            found[i] = regime(law, factor[i], mu, p[i], s)
        other_regimes(points, law, point, nc)
        return
    for i in range(nc):
        s = (w1[i] * w1[i] + w2[i] * w2[i]) ** 0.5
        mu, _, _ = package_mu_at(law, s, p[i])
        found[i] = regime(law, factor[i], mu, p[i], s)
    other_regimes(points, law, point, nc)


@hot_kernel
def meets_corner(points: np.ndarray, point: np.ndarray, nc: int) -> bool:
    """Whether one of nc points changes its regime in the evaluated sub-step, or its direction.

    One that slips back passes through zero sliding, however short it may stick there.
    """
    for i in range(nc):
        if point[at.OUT_REGIME, i] != point[at.REGIME, i]:
            return True
        if point[at.OUT_REGIME, i] == at.SLIPS and points[at.POINT_FRICTION, i] > 0.0:
            along = point[at.OLD_W1, i] * point[at.OUT_W1, i]
            if along + point[at.OLD_W2, i] * point[at.OUT_W2, i] < 0.0:
                return True
    return False
