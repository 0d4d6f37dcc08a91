"""What workers do for tracking: pair lines of design points, refine doubtful steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from squealstudy.errors import SquealstudyError
from squealstudy.kinds.complex_modes.alignment import KEPT
from squealstudy.kinds.complex_modes.between import Between
from squealstudy.kinds.complex_modes.columns import ShapeFile
from squealstudy.modes.tracking.labels import pair_points
from squealstudy.modes.tracking.pairing import Pairing
from squealstudy.modes.tracking.refinement import Modes, Refinement

Pairings = dict[int, Pairing]


@dataclass(frozen=True)
class PairTask:
    """Groups of points for a worker to pair with their parents."""

    groups: list[list[int]]
    parents: Mapping[int, int]
    step: Mapping[int, float]
    lams: Mapping[int, np.ndarray]
    shapes: ShapeFile
    known: Pairings


@dataclass(frozen=True)
class RefineTask:
    """A doubtful step for a worker to refine.

    Attributes
    ----------
    point : int
        At the end of the step.
    start, end : Between
        Around both its points.
    a, b : Modes
        Of both, as they were solved.
    expected : ndarray or None
        As of `pair_modes`.
    direct : Pairing
        What is to be refined.
    """

    point: int
    start: Between
    end: Between
    a: Modes
    b: Modes
    expected: np.ndarray | None
    direct: Pairing


def pair_task(task: PairTask) -> Pairings:
    """Pair the groups of a task."""

    @lru_cache(maxsize=KEPT)
    def shapes(point: int) -> np.ndarray:
        return task.shapes.read(point)[: len(task.lams[point])]  # without overdamped roots

    def pair(a: int, b: int) -> tuple[np.ndarray, np.ndarray]:
        return shapes(a), shapes(b)

    found: Pairings = {}
    for group in task.groups:
        found |= pair_points(group, task.parents, task.step, task.lams, pair, task.known)
    return found


def refine_task(task: RefineTask) -> tuple[int, Pairing, int]:
    """Point, pairing with its parent, and number of intermediate points solved."""
    solve, a, b = task.start.solve, task.a, task.b
    foreign = np.zeros(len(b.lam), dtype=bool)
    if task.start.structure.key != task.end.structure.key:
        try:
            way = task.start.way_to(task.end)
        except SquealstudyError:
            return task.point, task.direct, 0
        solve, a, b, foreign = way.solve, way.at_a(a), way.at_b(b), way.foreign(b)
    refinement = Refinement(solve)
    pairing = refinement.pair(a, b, task.start.x, task.end.x, task.expected)
    doubtful = np.zeros(len(a.lam), dtype=bool)
    paired = pairing.partner >= 0
    doubtful[paired] = foreign[pairing.partner[paired]]
    pairing = pairing._replace(ambiguous=pairing.ambiguous | doubtful)
    return task.point, pairing, refinement.points
