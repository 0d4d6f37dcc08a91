"""Chooses the design points that are also solved at full order, to check the method."""

from __future__ import annotations

import numpy as np

from squealstudy.engine.plan import Plan
from squealstudy.study.sampling import farthest_points


def checked_points(plan: Plan) -> list[int]:
    """Indices of the design points to solve at full order too: reference points, then the audit.

    The audit draws a share of all points at random, always the same of a number of points.
    """
    section = plan.study.definition.modes
    chosen = reference_choice(plan, section.reference_points)
    count = int(np.ceil(section.audit * len(plan.tasks)))
    if not count:  # a permutation of millions of points takes a second
        return chosen
    drawn = np.random.default_rng(0).permutation(len(plan.tasks))[:count]
    return list(dict.fromkeys([*chosen, *(int(i) for i in drawn)]))


def reference_choice(plan: Plan, count: int) -> list[int]:
    """Indices of `count` reference points.

    The first is the upper corner of the swept box (highest friction, pressure and so on), where a
    reduced model is expected to be least accurate. Each other one is the farthest from those
    before it.
    """
    return farthest_points(plan.coordinates, count)
