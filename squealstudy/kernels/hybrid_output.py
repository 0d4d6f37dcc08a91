"""Energies and rows of the histories of a hybrid run."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import hybrid_layout as at
from squealstudy.kernels import newmark_layout as its
from squealstudy.kernels.hybrid_layout import Hybrid, State
from squealstudy.kernels.jit import kernel
from squealstudy.kernels.laws import mu_at, potential

OPEN = 0.01  # a point is open below this share of the mean pressure


@kernel
def contact_energy(model: Hybrid, state: State) -> float:
    """Contact potential from the reference state beyond the tangent that is in K, J."""
    law = model.law
    total = 0.0
    for i in range(model.points.shape[0]):
        point, gap = model.points[i], state.point[i, at.OLD_X]
        U = potential(law, point[its.POINT_GAP] + gap) - potential(law, point[its.POINT_GAP])
        total += point[its.POINT_AREA] * U + point[its.POINT_NORMAL] * gap
        total -= 0.5 * point[its.POINT_STIFFNESS] * gap * gap
    return total


@kernel
def history_row(model: Hybrid, state: State, row: np.ndarray) -> None:
    """Fill the columns newmark_layout.HISTORY of contact and work: row[1:10], row[12]."""
    torque = 0.0
    force = 0.0
    area = 0.0
    law = model.law
    for i in range(model.points.shape[0]):
        point, trial = model.points[i], state.point[i]
        torque -= point[its.POINT_RADIUS] * trial[its.OUT_T1]
        force += point[its.POINT_AREA] * trial[its.OUT_P]
        area += point[its.POINT_AREA]
    stick = 0.0
    opened = 0.0
    creep = 0.0
    for i in range(model.points.shape[0]):
        point, trial = model.points[i], state.point[i]
        p, share = trial[its.OUT_P], point[its.POINT_AREA] / area
        s = (trial[its.OUT_W1] * trial[its.OUT_W1] + trial[its.OUT_W2] * trial[its.OUT_W2]) ** 0.5
        mu, _, _ = mu_at(law, s, p)
        if p <= OPEN * force / area:
            opened += share
        elif law[its.LAW_SLOPE] * s < point[its.POINT_FRICTION] * mu * p:
            stick += share
            creep = max(creep, s)
    row[1], row[2] = torque, force
    row[3], row[4], row[5] = stick, 1.0 - stick - opened, opened
    row[12] = creep
    for i in range(4):
        row[6 + i] = state.work[i]
