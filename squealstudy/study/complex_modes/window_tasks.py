"""Design points in boxes of the chart, for methods over a sweep basis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from squealstudy.study.complex_modes.bases import BasisTask, split_boxes
from squealstudy.study.complex_modes.chart import chart_of
from squealstudy.study.complex_modes.window_worker import WindowTask
from squealstudy.study.design import Design
from squealstudy.study.plan import Plan
from squealstudy.study.tasks import PointTask

LEAST_BOX, MOST_BOX = 160, 1600  # design points: enough to pay for patches, few enough to lose
BOXES = 16


def basis_tasks(plan: Plan) -> list[BasisTask]:
    """One basis a structure, over the box of all its design points."""
    names = [s.name for s in plan.study.sweeps if not s.parameter.structural]
    designs: dict[str, list[Design]] = {}
    for task in plan.tasks:
        designs.setdefault(task.prepared_key, []).append(task.design)
    return [
        BasisTask(key, chart_of(found, names), plan.band_hz, plan.method.tolerance)
        for key, found in designs.items()
    ]


def window_tasks(plan: Plan, points: Sequence[PointTask]) -> list[WindowTask]:
    """Boxes of the whole design, with those of their points that are not solved yet.

    Outermost ones first: modes change most at the ends of sweeps, and what takes longest must not
    come last.
    The boxes depend on the design alone, so that a resumed study solves what it would have.
    """
    pending = {task.point_id for task in points}
    found = []
    for basis in basis_tasks(plan):
        own = [task for task in plan.tasks if task.prepared_key == basis.key]
        theta = basis.chart.theta([task.design.values for task in own])
        most = min(MOST_BOX, max(LEAST_BOX, len(own) // BOXES))
        for box, low, high in split_boxes(theta, most):
            rows = [int(i) for i in box if own[i].point_id in pending]
            if rows:
                chosen = tuple(own[i] for i in rows)
                found.append(WindowTask(basis, plan.method.name, chosen, theta[rows], low, high))
    return sorted(found, key=lambda task: -float(np.abs(task.low + task.high).sum()))
