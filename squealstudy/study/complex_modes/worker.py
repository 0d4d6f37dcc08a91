"""What a worker process does: solve a chunk of design points and write its file."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.study.complex_modes.full_rung import FullRung
from squealstudy.study.complex_modes.rows import failed_row, solved_row
from squealstudy.study.complex_modes.solve import solve_design
from squealstudy.study.family_cache import prepared_any
from squealstudy.study.keys import chunk_id
from squealstudy.study.rows import FAILURES, reason
from squealstudy.study.tasks import PointTask, Solved
from squealstudy.study.working_points import NewGaps, known_gap


@dataclass(frozen=True)
class ChunkTask:
    """Design points that one worker solves and writes together."""

    band_hz: tuple[float, float]
    points: tuple[PointTask, ...]
    keep_gaps: bool
    full: FullRung | None = None


def solve_chunk(task: ChunkTask) -> Solved:
    """Solve the points of a chunk; new working points are kept in the cache."""
    rows: list[dict[str, Any]] = []
    new_gaps = NewGaps()
    known = 0
    for point in task.points:
        gap = known_gap(point.prepared_key, point.design)
        known += gap is not None
        row, found = solve_alone(point, task, gap)
        rows.append(row)
        if gap is None and found is not None and task.keep_gaps:
            new_gaps.add(point.prepared_key, point.design, found)
    new_gaps.save(chunk_id(p.point_id for p in task.points))
    return Solved(rows, known=known)


def solve_alone(
    point: PointTask, task: ChunkTask, known: np.ndarray | None
) -> tuple[dict[str, Any], np.ndarray | None]:
    """Row of one point, whatever becomes of it, and the gaps of its working point."""
    started = time.perf_counter()
    try:
        if task.full is not None:
            modes = task.full.solve(point, task.band_hz)
        else:
            prepared = prepared_any(point.prepared_key)
            modes = solve_design(prepared, point.design, task.band_hz, known)
    except FAILURES as error:
        wall = time.perf_counter() - started
        return failed_row(point.point_id, wall, *reason(error)), None
    wall = time.perf_counter() - started
    return solved_row(point.point_id, wall, modes), modes.working_point.gap
