"""Checks how much the gyroscopic terms of a disc matter that a study leaves out.

The check solves a few design points with these terms, by the exact method on the reduced model.
They are spread over the points at which a mode is nearest to neutral stability.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.engine.cache import is_prepared, prepared_any, prepared_model
from squealstudy.engine.plan import Plan
from squealstudy.engine.workers import Workers
from squealstudy.kinds.complex_modes.outside_band import spread
from squealstudy.kinds.complex_modes.rows import ModeColumns
from squealstudy.mechanics.failures import FAILURES
from squealstudy.models.operating import GYROSCOPIC
from squealstudy.modes.turning_effect import TurningEffect, turning_effect
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.study.design import DesignPoint

N_CHECKED_POINTS = 5  # number of points; each takes as long as one exact solution
# share of design points, nearest to neutral stability, among which the checked ones are chosen
NEAR_NEUTRAL_SHARE = 0.2


@dataclass(frozen=True)
class TurningTask:
    """A design point without gyroscopic terms, with its roots `lam` (m,) in the band [rad/s].

    A mode whose damping ratio has a modulus below `neutral` counts as neither growing nor decaying.
    """

    point: DesignPoint
    lam: np.ndarray
    band_hz: tuple[float, float]
    neutral: float


def turning_facts(plan: Plan, columns: ModeColumns, workers: Workers) -> dict[str, Any] | None:
    """Facts for the manifest; None where no disc turns, the terms are swept, or no check succeeds.

    `looked` is the number of checked points. `decided_points` counts those at which the terms
    decide whether a mode grows, and `decided_growth` is the largest change of its growth rate, 1/s.
    """
    if GYROSCOPIC.name in {sweep.name for sweep in plan.study.sweeps} or not _turns(plan):
        return None
    neutral = plan.study.definition.modes.stability_tolerance
    tasks = [
        TurningTask(plan.tasks[row], columns.lam[columns.point == row], plan.band_hz, neutral)
        for row in _nearest_neutral(plan, columns)
    ]
    answers = workers.each(effect_of_turning, tasks, "gyroscopic terms")
    effects = [effect for effect in answers if effect is not None]
    if not effects:
        return None
    return {
        "looked": len(effects),
        "decided_points": sum(effect.decided > 0 for effect in effects),
        "decided_growth": max(effect.decided_growth for effect in effects),
    }


def _turns(plan: Plan) -> bool:
    """Whether the model has a turning disc whose gyroscopic terms are known."""
    if plan.stacked:
        return False
    built = (prepared_any(key) for key in plan.structures if is_prepared(key))
    prepared = next(built, None)
    return isinstance(prepared, PreparedModel) and prepared.model.turning is not None


def effect_of_turning(task: TurningTask) -> TurningEffect | None:
    """Effect of the terms at a point; None where the point has the terms or cannot be solved."""
    state = task.point.state()
    if state.operating.gyroscopic:
        return None
    prepared = prepared_model(task.point.structure)
    try:
        return turning_effect(prepared, state, task.lam, task.band_hz, task.neutral)
    except FAILURES:
        return None


def _nearest_neutral(plan: Plan, columns: ModeColumns) -> list[int]:
    """Rows of the design points to check."""
    distance = np.full(len(columns.counts), np.inf)
    size = np.abs(columns.lam)
    np.minimum.at(
        distance, columns.point, np.abs(columns.lam.real) / np.where(size > 0, size, np.inf)
    )
    order = np.argsort(distance, kind="stable")
    n_near = max(N_CHECKED_POINTS, round(NEAR_NEUTRAL_SHARE * len(distance)))
    rows = order[:n_near][np.isfinite(distance[order[:n_near]])]
    if not len(rows):
        return []
    return spread(plan.coordinates[rows], -distance[rows], N_CHECKED_POINTS, rows)
