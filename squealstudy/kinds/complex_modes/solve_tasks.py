"""Divides the design points of a study into tasks for workers, and solves a task.

A task is a box of neighbouring points, or any part of them for rungs that need no box.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.engine.cache import NewGaps, known_gap
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import failed_row
from squealstudy.engine.workers import Solved, Workers
from squealstudy.errors import ConvergenceError, ExtensionError
from squealstudy.kinds.complex_modes.problems import SweptStructure, problem_of, swept_structures
from squealstudy.kinds.complex_modes.rows import SCHEMA, solved_row
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.modes.point import PointModes
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.rung import answers, beyond_tolerance
from squealstudy.modes.rungs import rung_named

# design points of a box: enough to pay for patches; few enough, as a stopped run loses unfinished
# boxes
MIN_BOX_POINTS, MAX_BOX_POINTS = 160, 1600
BOXES_PER_STRUCTURE = 16  # number of boxes of a structure, unless these limits forbid it
KEEP_GAPS_LIMIT = 5000  # working points of larger studies are not stored for other studies


@dataclass(frozen=True, eq=False)
class SolveTask:
    """Design points of one structure for a worker to solve together.

    Attributes
    ----------
    structure : SweptStructure
        Structure of the points.
    rung : str
        Name of the rung that solves them.
    points : DesignPoints
        The points.
    box : Box
        Part of the structure's box that holds the points.
    keep_gaps : bool
        Whether new working points are stored in the cache for other studies.
    """

    structure: SweptStructure
    rung: str
    points: DesignPoints
    box: Box
    keep_gaps: bool


def solve_tasks(plan: Plan, points: DesignPoints, workers: Workers) -> Iterator[SolveTask]:
    """Tasks that solve the given points; tasks with boxes come first.

    Where the study's rung needs a sweep basis that a structure does not have, the exact rung solves
    its points.
    """
    served = {s.key: (s, rung_of(plan, s)) for s in swept_structures(plan)}
    exact = [key for key, (_, name) in served.items() if rung_named(name).exact]
    needs_no_box = np.isin(points.structures, exact)[points.structure_index]
    keep = len(plan.tasks) <= KEEP_GAPS_LIMIT
    if not needs_no_box.all():
        for structure, rows, box in boxes(plan, points.at(np.flatnonzero(~needs_no_box))):
            yield SolveTask(
                structure=structure,
                rung=plan.method.name,
                points=plan.tasks.at(rows),
                box=box,
                keep_gaps=False,
            )
    for part in workers.pace.parts(points.at(np.flatnonzero(needs_no_box)), workers.jobs):
        structure, name = served[part.structures[part.structure_index[0]]]
        yield SolveTask(
            structure=structure,
            rung=name,
            points=part,
            box=whole_box(structure),
            keep_gaps=keep,
        )


def rung_of(plan: Plan, structure: SweptStructure) -> str:
    """Name of the rung for a structure: the exact one where a sweep basis is needed but missing."""
    needs_basis, method = plan.method.rung.over_a_basis, plan.method
    return method.exact if needs_basis and not structure.has_basis else method.name


def whole_box(structure: SweptStructure) -> Box:
    """The box of all design points of a structure."""
    ends = np.ones(structure.chart.dimension)
    return Box(-ends, ends)


def boxes(plan: Plan, points: DesignPoints) -> list[tuple[SweptStructure, np.ndarray, Box]]:
    """Boxes that hold some of the given points, each with the rows of these points in the plan.

    The outermost boxes come first: modes change most at the ends of sweeps, and the longest task
    must not come last. Boxes depend on the whole design alone, not on the given points: a
    resumed study has the same boxes.
    """
    is_asked = np.isin(plan.tasks.ids, points.ids)
    rows_of_structure = dict(plan.tasks.of_structures())
    box_list = []
    for structure in swept_structures(plan):
        rows = rows_of_structure[structure.key]
        if not is_asked[rows].any():
            continue
        values = [plan.tasks.column(name)[rows] for name in structure.chart.names]
        theta = structure.chart.theta(np.array(values).reshape(-1, len(rows)).T)
        for part, box in split_boxes(
            theta, min(MAX_BOX_POINTS, max(MIN_BOX_POINTS, len(rows) // BOXES_PER_STRUCTURE))
        ):
            chosen = rows[part][is_asked[rows[part]]]
            if len(chosen):
                box_list.append((structure, chosen, box))
    return sorted(box_list, key=lambda item: -float(np.abs(item[2].low + item[2].high).sum()))


def split_boxes(theta: np.ndarray, max_points: int) -> list[tuple[np.ndarray, Box]]:
    """Divide points theta (n, d) into boxes of at most `max_points`: rows and box of each.

    A part that has more is cut across its longest side, at the median of its points. Only points
    that all coincide stay together.
    """
    box_list: list[tuple[np.ndarray, Box]] = []
    pending: Sequence[np.ndarray] = [np.arange(len(theta))]
    while pending:
        rows, *rest = pending
        low, high = theta[rows].min(axis=0), theta[rows].max(axis=0)
        axis = int(np.argmax(high - low)) if theta.shape[1] else 0
        if len(rows) <= max_points or not (high > low).any():
            box_list.append((rows, Box(low, high)))
            pending = rest
            continue
        cut = np.median(theta[rows, axis])
        cut = cut if cut < high[axis] else (low[axis] + high[axis]) / 2
        below = theta[rows, axis] <= cut
        pending = [rows[below], rows[~below], *rest]
    return box_list


def solve_points(task: SolveTask) -> Solved:
    """Solve the points of a task; with `keep_gaps` new working points are kept in the cache."""
    last = time.perf_counter()
    rows: list[dict[str, Any]] = []
    new_gaps = NewGaps()
    key = task.structure.key
    looked_up = task.points if task.keep_gaps else ()
    cached_ids = {p.point_id for p in looked_up if known_gap(key, p) is not None}
    for i, outcome, left_over in _solved(task):
        point, now = task.points[i], time.perf_counter()
        if isinstance(outcome, PointModes):
            rows.append(solved_row(point.point_id, now - last, outcome, left_over))
            sliding = outcome.working_point
            if task.keep_gaps and sliding is not None and point.point_id not in cached_ids:
                new_gaps.add(key, point, sliding.gap)
        else:
            rows.append(failed_row(SCHEMA, point.point_id, *reason(outcome), now - last))
        last = now
    new_gaps.save()
    return Solved(rows, known=len(cached_ids))


def _solved(task: SolveTask) -> Iterator[tuple[int, PointModes | Exception, str]]:
    """Solve the points of a task in any order; yield index, modes or error, and a remark.

    Points that an approximate rung does not solve are solved exactly. The remark tells why the rung
    did not solve the point; it is empty otherwise.
    """
    rung = rung_named(task.rung)
    problem = problem_of(task.structure, rung)
    remaining = dict.fromkeys(range(len(task.points)), "")
    if not rung.exact:
        why = "not yielded"
        try:
            for i, outcome in answers(rung, problem, task.points, task.box):
                if isinstance(outcome, PointModes):
                    remaining[i] = beyond_tolerance(rung, problem, outcome)
                if isinstance(outcome, ConvergenceError) or not remaining[i]:
                    del remaining[i]
                    yield i, outcome, ""
        except ExtensionError:
            raise
        except FAILURES as error:
            why = ": ".join(part for part in reason(error) if part)
        remaining = {
            i: f"left over by {rung.name}: {reason_of_point or why}"
            for i, reason_of_point in remaining.items()
        }
        rung = rung_named(problem.swept.exact)
    for i, left_over in remaining.items():
        try:
            ((_, modes),) = rung.solve(problem, [task.points[i]], task.box)
        except FAILURES as error:
            yield i, error, left_over
        else:
            yield i, modes, left_over
