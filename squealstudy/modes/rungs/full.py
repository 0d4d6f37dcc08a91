"""The unreduced model: sparse shift-and-invert Arnoldi iterations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from squealstudy.modes.answer import PointAnswer
from squealstudy.modes.problem import Point, Problem
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.rung import Rung

COST = 60.0  # time of a point of the full-order model over that of a reduced brake, roughly


class Full(Rung):
    """Exact, and the reference of all others."""

    name = "full"
    description = "sparse eigenproblem of the unreduced model"
    exact = True
    unreduced = True

    def relative_cost(self, points: int, varied: int) -> float:
        """Cost of a brake's point; a family of matrices has nothing cheaper to compare with."""
        return COST

    def solve(self, problem: Problem, points: Sequence[Point], box: Box) -> Iterator[PointAnswer]:
        """Unreduced pairs of each point in the band, one point after the other."""
        return ((i, problem.full_order(point)) for i, point in enumerate(points))


RUNG = Full()
