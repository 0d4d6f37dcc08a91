"""Tasks of design points for workers, and their solution: a row for each point.

A task is a box of neighbouring points, or a chunk of them for rungs that need no box.
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

# design points of a box: enough to pay for patches, few enough to lose when a run is stopped
LEAST_BOX, MOST_BOX = 160, 1600
BOXES = 16  # boxes of a structure, within these limits
KEEP_GAPS_LIMIT = 5000  # design points up to which working points are kept for other studies


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
        Keep new working points in the cache for other studies.
    """

    structure: SweptStructure
    rung: str
    points: DesignPoints
    box: Box
    keep_gaps: bool


def solve_tasks(plan: Plan, points: DesignPoints, workers: Workers) -> Iterator[SolveTask]:
    """Tasks of points that are to be solved, those in boxes first.

    Where the study's rung needs a sweep basis that a structure does not have, the exact rung solves
    its points.
    """
    served = {s.key: (s, rung_of(plan, s)) for s in swept_structures(plan)}
    exact = [key for key, (_, name) in served.items() if rung_named(name).exact]
    is_single = np.isin(points.structures, exact)[points.structure_index]
    keep = len(plan.tasks) <= KEEP_GAPS_LIMIT
    if not is_single.all():
        for structure, rows, box in boxes(plan, points.at(np.flatnonzero(~is_single))):
            yield SolveTask(
                structure=structure,
                rung=plan.method.name,
                points=plan.tasks.at(rows),
                box=box,
                keep_gaps=False,
            )
    for part in workers.pace.parts(points.at(np.flatnonzero(is_single)), workers.jobs):
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
    needs, method = plan.method.rung.over_a_basis, plan.method
    return method.exact if needs and not structure.has_basis else method.name


def whole_box(structure: SweptStructure) -> Box:
    """The box of all design points of a structure."""
    ends = np.ones(structure.chart.dimension)
    return Box(-ends, ends)


def boxes(plan: Plan, points: DesignPoints) -> list[tuple[SweptStructure, np.ndarray, Box]]:
    """Boxes of the design that hold asked-for points, each with the plan's rows of these points.

    The outermost boxes come first: modes change most at the ends of sweeps, and what takes longest
    must not come last. Boxes depend on the whole design alone, not on the points asked for: a
    resumed study has the same ones.
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
        for part, box in split_boxes(theta, min(MOST_BOX, max(LEAST_BOX, len(rows) // BOXES))):
            chosen = rows[part][is_asked[rows[part]]]
            if len(chosen):
                box_list.append((structure, chosen, box))
    return sorted(box_list, key=lambda item: -float(np.abs(item[2].low + item[2].high).sum()))


def split_boxes(theta: np.ndarray, max_points: int) -> list[tuple[np.ndarray, Box]]:
    """Rows and box of parts of the points theta (n, d), each with at most `max_points`.

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
    """Yield each point's index, its modes or the error, and why its rung left it over, or "".

    The order is any. Points that an approximate rung leaves over are solved exactly.
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
            i: f"left over by {rung.name}: {own_reason or why}"
            for i, own_reason in remaining.items()
        }
        rung = rung_named(problem.swept.exact)
    for i, left_over in remaining.items():
        try:
            ((_, modes),) = rung.solve(problem, [task.points[i]], task.box)
        except FAILURES as error:
            yield i, error, left_over
        else:
            yield i, modes, left_over
