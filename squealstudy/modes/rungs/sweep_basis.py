"""One projection for all design points of a structure, on modes at adaptively chosen ones.

A point whose estimate exceeds the tolerance is solved in the full problem.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import Eigenpairs
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.modes.answer import PointAnswer
from squealstudy.modes.problem import Point, Problem
from squealstudy.modes.reanalysis.estimate import (
    EstimatedRoots,
    Outcome,
    bounded,
    inside,
    residuals,
    solve_alone,
)
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.problem import Linearisation, SweptProblem, lightly_damped
from squealstudy.modes.reanalysis.sweep_basis import SweepBasis
from squealstudy.modes.rung import Offer, Rung, Scope
from squealstudy.modes.tracking.refinement import Modes
from squealstudy.system.parametric import Weights

BASIS_SOLVES = 60  # cost of a sweep basis in exact solves: 23 over one parameter, 75 over two
# with so many parameters there would be too many patches; a basis saves time from so many points on
MANY_PARAMETERS, PAYS_FROM = 4, 600
COST = 0.55  # time of a point over that of an exact point, roughly


class OverABasis(Rung):
    """Common parts of rungs over a sweep basis."""

    over_a_basis = True

    def refusal(self, scope: Scope) -> str:
        """Damping of single modes needs the real modes of each point."""
        if not scope.single:
            return ""
        return (
            f"{self.name} has no damping of single modes of the assembly ({scope.single} is not "
            "that of all modes)"
        )

    @property
    def setup_solves(self) -> int:
        """Exact solves that the basis is made of, about."""
        return BASIS_SOLVES

    def modes_at(self, problem: Problem, point: Point, box: Box) -> Modes:
        """In the basis alone, without an estimate."""
        sample = problem.swept.samples(problem.theta([point]))[0]
        if isinstance(sample, ConvergenceError):
            raise sample
        C, K = problem.basis.small.matrices([sample.weights])
        lam, X = dense_roots(C[0], K[0], problem.swept.band)
        oscillating = lam.imag > 0
        return Modes(lam[oscillating], problem.basis_reader.shapes(X[:, oscillating]))


class SweepBasisRung(OverABasis):
    """All pairs of the projected problem at every point."""

    name = "sweep_basis"
    description = "dense eigenproblem projected on a basis of the whole sweep"

    def solve(self, problem: Problem, points: Sequence[Point], box: Box) -> Iterator[PointAnswer]:
        """Pairs of each point projected on the basis, one point after the other."""
        solver = InBasis(problem.swept, problem.basis, problem.tolerance)
        for i, theta in enumerate(problem.theta(points)):
            yield i, problem.modes(solver.alone(theta))

    def relative_cost(self, points: int, varied: int) -> float:
        """Cost of a small dense problem and its estimate."""
        return COST

    def offer(self, scope: Scope) -> Offer:
        """Serves ``auto`` studies of many parameters, over which no patch interpolates."""
        if scope.varied < MANY_PARAMETERS:
            return Offer(False, "")
        if scope.damped:
            why = f"{scope.damped} is not interpolated over {scope.varied} parameters"
            return Offer(False, why)
        if scope.points < PAYS_FROM:
            return Offer(
                False, f"{scope.points:,} points a structure are too few to gain from a basis"
            )
        return Offer(True, f"{scope.points:,} points a structure gain from a basis")


@dataclass(frozen=True)
class InBasis:
    """Solves design points in a sweep basis.

    Attributes
    ----------
    problem : SweptProblem
    basis : SweepBasis
    tolerance : float
        Largest error of light roots relative to their modulus.
    """

    problem: SweptProblem
    basis: SweepBasis
    tolerance: float

    def within_tolerance(self, outcome: Outcome) -> bool:
        """Whether the light roots of a point are within the tolerance; failed points are."""
        if isinstance(outcome, ConvergenceError):
            return True
        if not outcome.complete:
            return False
        judged = lightly_damped(outcome.lam)
        error = outcome.error[judged] / np.abs(outcome.lam[judged])
        return bool((error <= self.tolerance).all())

    def alone(self, theta: np.ndarray) -> Outcome:
        """One design point in the sweep basis, in the full problem where that is not enough."""

        def solve(weights: Weights) -> Eigenpairs:
            pairs = inside(self.basis.pairs(weights), self.problem.band)
            return self.basis.expand(weights, pairs)

        outcome = solve_alone(self.problem, theta, SweepBasisRung.name, solve)
        if isinstance(outcome, ConvergenceError):
            return outcome
        error = outcome.error + self.basis.interpolated * np.abs(outcome.lam)
        outcome = outcome._replace(error=error)
        return outcome if self.within_tolerance(outcome) else self.exact(theta, outcome.at)

    def exact(self, theta: np.ndarray, at: Linearisation) -> EstimatedRoots:
        """One design point in the full problem."""
        weights, pairs = self.problem.pairs(theta, 1.0)
        pairs = inside(pairs, self.problem.band)
        residual, root_shift = residuals(self.problem, weights, pairs)
        return EstimatedRoots(
            at=at,
            lam=pairs.lam,
            X=pairs.X,
            error=bounded(root_shift, pairs.lam),
            residual=residual,
            method=self.problem.exact,
        )


RUNG = SweepBasisRung()
