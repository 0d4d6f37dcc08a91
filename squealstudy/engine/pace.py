"""How many design points a task has: as many as a worker solves in about two seconds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from squealstudy.engine.design_points import DesignPoints

FIRST = 16  # points of a task while nothing is known of their time
MOST = 4096  # of a chunk file, too
SECONDS = 2.0  # of a task
LEAST_SECONDS = 0.1  # a shorter one is not worth its way
TASKS_A_WORKER = 8  # of all that is left: workers end together


@dataclass
class Pace:
    """What points have taken so far.

    Attributes
    ----------
    seconds : float
        Of a point in the last finished task; 0 where none is.
    """

    seconds: float = 0.0

    def took(self, points: int, seconds: float) -> None:
        """Learn from a finished task."""
        self.seconds = max(seconds, 1e-9) / max(points, 1)

    def size(self, left: int, jobs: int) -> int:
        """Points of the next task, where so many are left for so many workers."""
        fair = math.ceil(left / (TASKS_A_WORKER * jobs))
        if not self.seconds:
            return max(1, min(FIRST, fair))
        least, most = (int(s / self.seconds) for s in (LEAST_SECONDS, SECONDS))
        return max(1, min(MOST, most, max(fair, least)))

    def parts(self, points: DesignPoints, jobs: int) -> Iterator[DesignPoints]:
        """Consecutive points of one structure each, as many at a time as `size` says then."""
        left = len(points)
        for _, rows in points.of_structures():
            start = 0
            while start < len(rows):
                size = min(self.size(left, jobs), len(rows) - start)
                yield points.at(rows[start : start + size])
                start, left = start + size, left - size
