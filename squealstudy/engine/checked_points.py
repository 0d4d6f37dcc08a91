"""The design points of a study that are also solved at full order."""

from __future__ import annotations

import numpy as np

from squealstudy.engine.plan import Plan
from squealstudy.study.sampling import farthest_points


def checked_points(plan: Plan) -> list[int]:
    """Indices of the design points solved at full order too: the chosen ones, then the audit's.

    The audit draws its share of all points at random; which they are depends on their number alone.
    """
    section = plan.study.definition.modes
    chosen = reference_choice(plan, section.reference_points)
    count = int(np.ceil(section.audit * len(plan.tasks)))
    if not count:  # a permutation of millions of points takes a second
        return chosen
    drawn = np.random.default_rng(0).permutation(len(plan.tasks))[:count]
    return list(dict.fromkeys([*chosen, *(int(i) for i in drawn)]))


def reference_choice(plan: Plan, count: int) -> list[int]:
    """Indices of the design points to check by the full-order model.

    The upper corner of the swept box first (most friction, pressure, change), where a reduced
    model has most to lose; then the points farthest from all chosen.
    """
    return farthest_points(plan.coordinates, count)
