"""Decides which studies are solved in batches, and cuts their design points into parts."""

from __future__ import annotations

from collections.abc import Iterator

from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.mechanics.failures import FAILURES
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.models.parameter import nothing_vanishes
from squealstudy.modes.point import DENSE
from squealstudy.stacked.modes import MOST_COORDINATES, POINTS_PER_BLOCK

MIN_BATCH_POINTS = POINTS_PER_BLOCK // 4  # least design points of a task, if there are as many


def stacks(plan: Plan) -> bool:
    """Whether a plan is solved in batches: exactly, and with a small model without a mesh."""
    model = plan.study.model
    if has_mesh(plan.study) or isinstance(model, FamilyDefinition) or plan.method.name != DENSE:
        return False
    if model.vanishing is not nothing_vanishes:
        return False
    try:
        assembly = plan.first.assembly()
    except FAILURES:  # solved point by point, each failure becomes a row
        return False
    plain = all(c.correspondence is None for c in assembly.components)
    return plain and assembly.n_dof <= MOST_COORDINATES


def batch_parts(points: DesignPoints, jobs: int) -> Iterator[DesignPoints]:
    """Consecutive points, one part for each of `jobs` workers, within limits of size.

    A part has at least MIN_BATCH_POINTS points, except the last, and at most POINTS_PER_BLOCK.
    """
    size = min(POINTS_PER_BLOCK, max(MIN_BATCH_POINTS, -(-len(points) // max(jobs, 1))))
    for start in range(0, len(points), size):
        yield points.at(slice(start, start + size))
