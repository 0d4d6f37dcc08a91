"""What each contact point does - slip, stick, be open - and where that changes within a sub-step.

Forces have corners there. A rule of fixed steps errs at each by the step, and where slip ends the
friction found depends on where in the step that was: the sub-step is halved until the corner lies
in a short one (newmark_step.iterate).
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.laws import mu_at
from squealstudy.kernels.newmark_layout import ModalArrays, StepSettings, WorkArrays


@fast_kernel
def regime(points: np.ndarray, law: np.ndarray, point: np.ndarray, i: int) -> int:
    """Of the evaluated point i: SLIPS, STICKS below the corner of its friction, or IS_OPEN."""
    p, factor = point[at.OUT_P, i], points[at.POINT_FRICTION, i]
    if p <= 0.0:
        return at.IS_OPEN
    if factor == 0.0:
        return at.SLIPS
    w1, w2 = point[at.OUT_W1, i], point[at.OUT_W2, i]
    s = (w1 * w1 + w2 * w2) ** 0.5
    mu, _, _ = mu_at(law, s, p)
    return at.STICKS if law[at.LAW_SLOPE] * s < factor * mu * p else at.SLIPS


@fast_kernel
def keep_regimes(modal: ModalArrays, settings: StepSettings, work: WorkArrays, k: int) -> None:
    """Those of the evaluated state of design k become those of the accepted one."""
    if settings.corner_halvings == 0:
        return
    points, law, point = modal.points[k], modal.laws[k], work.point[k]
    for i in range(points.shape[1]):
        point[at.REGIME, i] = regime(points, law, point, i)


@fast_kernel
def meets_corner(modal: ModalArrays, work: WorkArrays, k: int) -> bool:
    """Whether a point of design k changes its regime in the evaluated sub-step, or its direction.

    One that slips back passes through zero sliding, however short it may stick there.
    """
    points, law, point = modal.points[k], modal.laws[k], work.point[k]
    for i in range(points.shape[1]):
        now = regime(points, law, point, i)
        if now != point[at.REGIME, i]:
            return True
        along = point[at.OLD_W1, i] * point[at.OUT_W1, i]
        if now == at.SLIPS and along + point[at.OLD_W2, i] * point[at.OUT_W2, i] < 0.0:
            return points[at.POINT_FRICTION, i] > 0.0
    return False
