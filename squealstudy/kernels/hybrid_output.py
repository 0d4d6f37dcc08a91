"""Energies and rows of the histories of a hybrid run."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.contact_point import potential
from squealstudy.kernels.friction_laws import mu_at
from squealstudy.kernels.hybrid_layout import OLD_X, Hybrid, State
from squealstudy.kernels.jit import kernel

OPEN = 0.01  # a point is open below this share of the mean pressure


@kernel
def contact_energy(model: Hybrid, state: State) -> float:
    """Contact potential from the reference state beyond the tangent that is in K, J."""
    law = model.law
    code = int(law[0])
    total = 0.0
    for i in range(model.points.shape[0]):
        point, gap = model.points[i], state.point[i, OLD_X]
        U = potential(code, law[1], law[2], point[0] + gap)
        U -= potential(code, law[1], law[2], point[0])
        total += point[1] * U + point[5] * gap - 0.5 * point[4] * gap * gap
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
        torque -= point[3] * trial[4]
        force += point[1] * trial[3]
        area += point[1]
    stick = 0.0
    opened = 0.0
    creep = 0.0
    for i in range(model.points.shape[0]):
        point, trial = model.points[i], state.point[i]
        s = (trial[1] * trial[1] + trial[2] * trial[2]) ** 0.5
        mu, _ = mu_at(law[4], law[5], law[6], s)
        if trial[3] <= OPEN * force / area:
            opened += point[1] / area
        elif law[7] * s < point[2] * mu * trial[3]:
            stick += point[1] / area
            creep = max(creep, s)
    row[1], row[2] = torque, force
    row[3], row[4], row[5] = stick, 1.0 - stick - opened, opened
    row[12] = creep
    for i in range(4):
        row[6 + i] = state.work[i]
