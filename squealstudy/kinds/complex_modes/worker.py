"""What a worker process does: solve design points of a structure by a rung, a row each."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from typing import Any

from squealstudy.engine.keys import chunk_id
from squealstudy.engine.rows import FAILURES, reason
from squealstudy.engine.tasks import Solved
from squealstudy.engine.working_points import NewGaps, known_gap
from squealstudy.kinds.complex_modes.problems import problem_of
from squealstudy.kinds.complex_modes.rows import failed_row, solved_row
from squealstudy.kinds.complex_modes.solve_tasks import SolveTask
from squealstudy.modes.point import PointModes
from squealstudy.modes.rungs import rung_named


def solve_points(task: SolveTask) -> Solved:
    """Solve the points of a task; new working points are kept in the cache."""
    last = time.perf_counter()
    rows: list[dict[str, Any]] = []
    new_gaps = NewGaps()
    key = task.structure.key
    looked_up = task.points if task.keep_gaps else ()
    known = {p.point_id for p in looked_up if known_gap(key, p) is not None}
    for i, found in _solved(task):
        point, now = task.points[i], time.perf_counter()
        if isinstance(found, PointModes):
            rows.append(solved_row(point.point_id, now - last, found))
            if task.keep_gaps and point.point_id not in known:
                new_gaps.add(key, point, found.working_point.gap)
        else:
            rows.append(failed_row(point.point_id, now - last, *reason(found)))
        last = now
    new_gaps.save(chunk_id(p.point_id for p in task.points))
    return Solved(rows, known=len(known))


def _solved(task: SolveTask) -> Iterator[tuple[int, PointModes | Exception]]:
    """Modes of each point, in any order, or why it has none.

    Points that a failure of an approximate rung leaves over are solved exactly.
    """
    rung = rung_named(task.rung)
    problem = problem_of(task.structure, rung)
    left = dict.fromkeys(range(len(task.points)))
    if not rung.exact:
        with contextlib.suppress(*FAILURES):
            for i, found in rung.solve(problem, task.points, task.box):
                del left[i]
                yield i, found
        rung = rung_named(problem.swept.exact)
    for i in left:
        try:
            ((_, modes),) = rung.solve(problem, [task.points[i]], task.box)
        except FAILURES as error:
            yield i, error
        else:
            yield i, modes
