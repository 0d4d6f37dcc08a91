"""A kind for million.py: complex modes of one point of each task, copied to the others.

What is left of a run's time is that of planning, naming, handing out, storing and tables.
"""

from __future__ import annotations

from dataclasses import replace

from squealstudy.engine.workers import Solved
from squealstudy.kinds.complex_modes.kind import ComplexModes
from squealstudy.kinds.complex_modes.solve_tasks import SolveTask
from squealstudy.study.kinds import register_kind


class CopiedModes(ComplexModes):
    """Complex modes, most of which are copies."""

    name = "copied_modes"
    description = "complex modes of few points, copied to others"

    def solve(self, task: SolveTask) -> Solved:
        """Rows of the points of a task."""
        (row,) = super().solve(replace(task, points=task.points[:1])).rows
        names = task.points.ids.astype(str).tolist()
        return Solved([{**row, "point_id": name} for name in names])


register_kind(CopiedModes())
