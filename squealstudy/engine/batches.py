"""Studies of small models whose design points are solved in batches, structures and all."""

from __future__ import annotations

from collections.abc import Iterator

from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.mechanics.failures import FAILURES
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.models.parameter import nothing_vanishes
from squealstudy.modes.point import DENSE
from squealstudy.stacked.modes import MOST_COORDINATES, POINTS_PER_BLOCK

# tasks of a batch for each worker, at least MIN_BATCH_POINTS points each
BATCH_TASKS_PER_WORKER = 4
MIN_BATCH_POINTS = POINTS_PER_BLOCK // BATCH_TASKS_PER_WORKER


def stacks(plan: Plan) -> bool:
    """Whether a plan is of a small model that is solved exactly, and so in batches."""
    model = plan.study.model
    if has_mesh(plan.study) or isinstance(model, FamilyDefinition) or plan.method.name != DENSE:
        return False
    if model.vanishing is not nothing_vanishes:
        return False
    try:
        assembly = plan.first.assembly()
    except FAILURES:  # which the way point by point tells
        return False
    plain = all(c.correspondence is None for c in assembly.components)
    return plain and assembly.n_dof <= MOST_COORDINATES


def batch_parts(points: DesignPoints, jobs: int) -> Iterator[DesignPoints]:
    """Consecutive points, BLOCK at a time, or fewer where workers would have none."""
    size = min(POINTS_PER_BLOCK, max(MIN_BATCH_POINTS, -(-len(points) // max(jobs, 1))))
    for start in range(0, len(points), size):
        yield points.at(slice(start, start + size))
