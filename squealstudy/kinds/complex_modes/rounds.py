"""Designs that grow while they run: each round of points follows from the finished ones."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from squealstudy.engine.plan import Plan
from squealstudy.kinds.complex_modes.boundary import BoundaryGrid, refine
from squealstudy.kinds.complex_modes.counts import read_roots
from squealstudy.study.definition import Study
from squealstudy.study.design_rules import BOUNDARY
from squealstudy.study.sampling import count_points


def grows(study: Study) -> bool:
    """Whether the design points of a study depend on its results."""
    return study.definition.design.type == BOUNDARY


def grown(plan: Plan, directory: Path) -> Plan:
    """The plan with all points that the finished ones of `directory` ask for.

    The plan itself where the design does not grow, where some of its points are not finished, or
    where no more are needed. What is added depends on the rows of the plan's points alone.
    """
    while grows(plan.study):
        grid = BoundaryGrid.of(plan.study)
        ids = [t.point_id for t in plan.tasks]
        tolerance, largest = plan.method.tolerance, plan.method.largest_error
        finished = read_roots(directory, ids, tolerance=tolerance, largest_error=largest)
        if len(finished) < len(plan.tasks):
            break
        roots = {
            grid.node(point): finished[task.point_id]
            for point, task in zip(plan.swept, plan.tasks, strict=True)
        }
        tolerance = plan.study.definition.modes.stability_tolerance
        nodes = refine(grid, roots, tolerance).nodes
        if len(nodes) == len(plan.tasks):
            break
        plan = Plan(plan.study, [grid.values(node) for node in nodes], plan.enriched)
    return plan


def most_points(study: Study) -> int:
    """Number of design points that a study may come to."""
    if not grows(study):
        return count_points(study)
    return math.prod(BoundaryGrid.of(study).shape)


def map_facts(plan: Plan) -> dict[str, Any] | None:
    """For the manifest: the virtual grid of a boundary design, and how much of it was solved."""
    if not grows(plan.study):
        return None
    grid = BoundaryGrid.of(plan.study)
    nodes = math.prod(grid.shape)
    return {
        "axes": dict(zip(grid.names, map(list, grid.axes), strict=True)),
        "levels": grid.levels,
        "points_solved": len(plan.tasks),
        "full_grid_points": nodes,
        "fraction": len(plan.tasks) / nodes,
    }
