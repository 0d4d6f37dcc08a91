"""The dense eigenproblem in all component-mode coordinates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from squealstudy.modes.answer import PointAnswer
from squealstudy.modes.problem import Point, Problem
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.rung import Rung, Scope


class Dense(Rung):
    """Exact in the reduced model; in a minimal model, whose basis is complete, exact altogether."""

    name = "dense"
    description = "dense eigenproblem of the component-mode model"
    exact = True

    def refusal(self, scope: Scope) -> str:
        """A family of matrices is never reduced."""
        if scope.reduced:
            return ""
        return (
            "a family of matrices has no component-mode coordinates for dense: expected full, "
            "sweep_basis or windows"
        )

    def solve(self, problem: Problem, points: Sequence[Point], box: Box) -> Iterator[PointAnswer]:
        """All pairs of each point in the band, one point after the other."""
        return ((i, problem.exact(point)) for i, point in enumerate(points))


RUNG = Dense()
