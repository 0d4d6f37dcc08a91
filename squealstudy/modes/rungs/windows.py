"""Patches over the design points of a box, halved where the error estimate needs it.

A patch that cannot follow its modes, or whose estimates exceed the tolerance, is halved along the
direction in which modes mix most. Where too few points are left for a patch to save time, they are
solved in the sweep basis, and where that is not accurate enough, in the full problem.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from squealstudy.errors import ConvergenceError
from squealstudy.modes.answer import PointAnswer
from squealstudy.modes.problem import Point, Problem
from squealstudy.modes.reanalysis.estimate import (
    EstimatedRoots,
    Outcome,
    bounded,
    two_sided_error,
)
from squealstudy.modes.reanalysis.patch import (
    Box,
    NodeModes,
    Patch,
    make_patch,
    mixing_by_direction,
)
from squealstudy.modes.reanalysis.polynomials import Interpolation, interpolation
from squealstudy.modes.reanalysis.problem import Linearisation, in_band, lightly_damped
from squealstudy.modes.reanalysis.ritz import RitzRoots, ritz_roots
from squealstudy.modes.reanalysis.sweep_basis import BASIS_BAND_FACTOR
from squealstudy.modes.rung import Offer, Scope
from squealstudy.modes.rungs.sweep_basis import InBasis, OverABasis
from squealstudy.system.parametric import Weights

DEGREE = {1: 5, 2: 4}  # degree of interpolation by number of parameters; beyond two it is 2
MIN_POINTS_PER_NODE = 1.5  # with fewer design points a patch costs more than it saves
POINTS_PER_TEST = 32  # points that are solved together, and tested
MAX_EXCEEDING_SHARE = 0.1  # a patch is halved if more of its points are beyond the tolerance
MAX_BISECTIONS = 14

# design points of one structure from which on windows take less time than exact solutions of all,
# by the number of parameters that vary (one process makes a basis, all processes solve points).
# studies/benchmarks/method_costs.py measures these and the constants below
MIN_POINTS_FOR_WINDOWS = {1: 60, 2: 500, 3: 1500}
# time of a point over that of an exact one: (POINTS_OF_EXACT_COST / points) ** COST_EXPONENT.
# Measured: 0.23 at 60 points over one varied parameter, 0.89 and 0.64 at 300 and 500 over two
POINTS_OF_EXACT_COST, COST_EXPONENT = {1: 2.5, 2: 230.0}, 0.46

Solution = tuple[int, Outcome]  # row of a design point, and its roots or the error


class WindowsRung(OverABasis):
    """Blocks of modes interpolated in patches of the box, estimated against the sweep basis."""

    name = "windows"
    description = "modes interpolated over patches of the design, in a sweep basis"
    shares_work = True

    def solve(self, problem: Problem, points: Sequence[Point], box: Box) -> Iterator[PointAnswer]:
        """Ritz pairs of the points of each patch, one patch after the other."""
        windows = Windows(problem.swept, problem.basis, problem.tolerance)
        for row, outcome in windows.solve(box, problem.theta(points)):
            yield row, problem.modes(outcome)

    def relative_cost(self, points: int, varied: int) -> float:
        """Time of a point over that of an exact one, which falls with the points in a patch."""
        return float(
            min(
                1.0,
                (POINTS_OF_EXACT_COST.get(varied, POINTS_OF_EXACT_COST[2]) / max(points, 1))
                ** COST_EXPONENT,
            )
        )

    def offer(self, scope: Scope) -> Offer:
        """Offered over up to three parameters, from MIN_POINTS_FOR_WINDOWS points on."""
        if scope.varied not in MIN_POINTS_FOR_WINDOWS:
            return Offer(False, "")
        if scope.points < MIN_POINTS_FOR_WINDOWS[scope.varied]:
            return Offer(
                False, f"{scope.points:,} points a structure are too few to gain from a basis"
            )
        return Offer(True, f"{scope.points:,} points a structure gain from a basis and patches")


@dataclass(frozen=True)
class Windows(InBasis):
    """Solves design points of a box by patches over a sweep basis.

    Attributes
    ----------
    counts : Counter
        Numbers of ``patches`` that were made, and of ``nodes`` that were solved for them.
    """

    counts: Counter[str] = field(default_factory=Counter)

    def solve(self, box: Box, theta: np.ndarray) -> Iterator[Solution]:
        """Roots of all design points theta (n, d) in a box by their rows, in any order."""
        yield from self._divide(box, theta, np.arange(len(theta)), 0)

    def _divide(
        self, box: Box, theta: np.ndarray, rows: np.ndarray, depth: int
    ) -> Iterator[Solution]:
        """Solve points by a patch of the box; halve the box for points that the patch leaves."""
        if not len(rows):
            return
        grid = interpolation(DEGREE.get(theta.shape[1], 2), theta.shape[1])
        if len(rows) < MIN_POINTS_PER_NODE * len(grid.nodes) or depth > MAX_BISECTIONS:
            for row in rows:
                yield int(row), self.alone(theta[row])
            return
        tried = _shrunk_to_points(box, theta[rows])
        patch = self._patch(tried, grid)
        if isinstance(patch, FollowedPatch):
            rows = yield from self._solve_in_patch(patch, theta, rows)
            if not len(rows):
                return
            slope = patch.slope
        else:
            slope = patch
        axis = int(np.argmax(np.where(tried.high > tried.low, slope, -np.inf)))
        for half in _halves(tried, axis, theta[rows]):
            yield from self._divide(half[0], theta, rows[half[1]], depth + 1)

    def _solve_in_patch(
        self, patch: FollowedPatch, theta: np.ndarray, rows: np.ndarray
    ) -> Generator[Solution, None, np.ndarray]:
        """Yield solutions of points in a patch; return the rows that are left for smaller patches.

        A few points spread over the patch are tested first. If too many of them exceed the
        tolerance all rows are returned. If too many of the others do, those not yet solved are.
        """
        node_cost = 2 * len(patch.patch.grid.nodes)  # points that cost as much as both halves
        spread = np.arange(len(rows)) % max(len(rows) // POINTS_PER_TEST, 1) == 0
        test_rows, other_rows = rows[spread], rows[~spread]
        test_solutions = list(self._points(patch, theta, test_rows))
        exceeding = sum(not self.within_tolerance(outcome) for _, outcome in test_solutions)
        if exceeding > max(min(MAX_EXCEEDING_SHARE * len(test_solutions), node_cost), 1):
            return rows
        yield from (self._within_tolerance_or_alone(*solved, theta) for solved in test_solutions)
        allowed = max(min(MAX_EXCEEDING_SHARE * len(rows), node_cost), 1)
        for start in range(0, len(other_rows), POINTS_PER_TEST):
            for row, outcome in self._points(
                patch, theta, other_rows[start : start + POINTS_PER_TEST]
            ):
                exceeding += not self.within_tolerance(outcome)
                yield self._within_tolerance_or_alone(row, outcome, theta)
            if exceeding > allowed:
                return other_rows[start + POINTS_PER_TEST :]
        return rows[:0]

    def _within_tolerance_or_alone(self, row: int, outcome: Outcome, theta: np.ndarray) -> Solution:
        """The solution of a point: that of the patch, or without it if its error is too large."""
        return row, outcome if self.within_tolerance(outcome) else self.alone(theta[row])

    def _patch(self, box: Box, grid: Interpolation) -> FollowedPatch | np.ndarray:
        """A patch over a box; where its modes cannot be followed, their mixing by direction."""
        spread = np.ones(len(box.low)) * (box.high > box.low)
        local = self.problem.local_field(box, grid)
        theta = np.vstack([box.middle, box.place(grid.nodes)])
        samples = self.problem.samples(theta, local)
        if not all(isinstance(s, Linearisation) for s in samples):
            return spread
        weights = [s.weights for s in samples if isinstance(s, Linearisation)]
        self.counts["nodes"] += len(weights)
        C = self.basis.small.matrices(weights)[0]
        pairs = [self.basis.pairs(w) for w in weights]
        middle, *nodes = (NodeModes(p, c) for p, c in zip(pairs, C, strict=True))
        patch = make_patch(box, grid, middle, nodes, self.problem.band)
        if isinstance(patch, np.ndarray):
            return patch
        self.counts["patches"] += 1
        floor = self._floor(patch, weights[1:], nodes)
        slope = mixing_by_direction(grid, patch.mixings)
        return FollowedPatch(patch=patch, starts=local, floor=floor, slope=slope)

    def _floor(self, patch: Patch, weights: list[Weights], nodes: list[NodeModes]) -> np.ndarray:
        """Largest errors (2, m) of the sweep basis at nodes, of lightly damped and of all modes.

        Errors are divided by the condition |x| |y| of the root. Near a coalescence both grow alike,
        so that the quotient holds at other points, too. A block may have roots far from the band,
        for which the basis was not made: they count only in a block without others.
        """
        worst = np.zeros((3, patch.m))
        for number, (w, node) in enumerate(zip(weights, nodes, strict=True)):
            chosen = np.concatenate([b.at_nodes[number] for b in patch.blocks])
            pairs = node.pairs.take(chosen)
            error = two_sided_error(self.problem, w, self.basis.expand(w, pairs))
            error = bounded(error, pairs.lam) / conditions(pairs.X, pairs.Y)
            near_band = in_band(pairs.lam, self.problem.band, BASIS_BAND_FACTOR)
            all_pairs = np.ones(len(error), dtype=bool)
            errors_by_class = np.where(
                [lightly_damped(pairs.lam), near_band, all_pairs], error, 0.0
            )
            for start, k in patch.slices:
                block_columns = slice(start, start + k)
                worst[:, block_columns] = np.maximum(
                    worst[:, block_columns], errors_by_class[:, block_columns].max(axis=1)[:, None]
                )
        return np.array([worst[0], np.where(worst[1] > 0, worst[1], worst[2])])

    def _points(
        self, patch: FollowedPatch, theta: np.ndarray, rows: np.ndarray
    ) -> Iterator[Solution]:
        """Solve points in a patch; a point without a working point yields its error."""
        for start in range(0, len(rows), POINTS_PER_TEST):
            some_rows = rows[start : start + POINTS_PER_TEST]
            samples = self.problem.samples(theta[some_rows], patch.starts)
            linearised = []
            for row, sample in zip(some_rows, samples, strict=True):
                if isinstance(sample, ConvergenceError):
                    yield int(row), sample
                else:
                    linearised.append((int(row), sample))
            if not linearised:
                continue
            linearised_rows = np.array([row for row, _ in linearised])
            weights = [sample.weights for _, sample in linearised]
            roots = ritz_roots(patch.patch, self.basis, theta[linearised_rows], weights)
            for k, (row, sample) in enumerate(linearised):
                yield row, self._estimated_roots(sample, roots, k, patch.floor)

    def _estimated_roots(
        self, linearisation: Linearisation, roots: RitzRoots, k: int, floor: np.ndarray
    ) -> EstimatedRoots:
        """Roots of a point in a patch with error estimates, and those that may be in the band."""
        lam, band = roots.lam[k], self.problem.band
        real = (np.abs(lam.imag) < 1e-9 * np.abs(lam)) & ~lightly_damped(lam)
        lam = np.where(real, lam.real, lam)
        of_basis = np.where(lightly_damped(lam), floor[0], floor[1]) * conditions(
            roots.X[k], roots.Y[k]
        )
        root_error = bounded(roots.error[k], lam) + self.basis.interpolated * np.abs(lam)
        inside = in_band(lam, band, 1.0)
        order_inside = np.flatnonzero(inside)
        order_inside = order_inside[np.argsort(np.abs(lam[order_inside]))]
        # far from the band the basis has roots that the model lacks: there its error does not count
        doubtful = ~inside & _may_be_inside(lam, root_error, band, self.tolerance)
        may_be_in_band = (np.abs(lam) + root_error >= band[0]) & (
            np.abs(lam) - root_error <= band[1]
        )
        doubtful |= may_be_in_band & ~lightly_damped(lam) & _may_be_real(lam, root_error)
        return EstimatedRoots(
            at=linearisation,
            lam=lam[order_inside],
            X=roots.X[k][:, order_inside],
            error=(root_error + of_basis)[order_inside],
            residual=roots.residual[k][order_inside],
            method=WindowsRung.name,
            full=False,
            complete=not doubtful.any(),
        )


class FollowedPatch(NamedTuple):
    """A patch with starts of working points, `_floor` of the basis, and mixing by direction."""

    patch: Patch
    starts: object
    floor: np.ndarray
    slope: np.ndarray


def conditions(X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Condition |x| |y| (m,) of each root, with y^H Q'(lam) x = 1: its shift per change of Q."""
    product: np.ndarray = np.linalg.norm(X, axis=0) * np.linalg.norm(Y, axis=0)
    return product


def _may_be_inside(
    lam: np.ndarray, error: np.ndarray, band: tuple[float, float], tolerance: float
) -> np.ndarray:
    """Mask of roots whose error exceeds the tolerance and that may be in the band, also if NaN."""
    size = np.abs(lam)
    outside = (size + error < band[0]) | (size - error > band[1]) | (lam.imag + error < 0)
    return ~(outside | (error <= tolerance * size))


def _may_be_real(lam: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Mask of complex roots that may be real within their error: not half of a pair then."""
    return (lam.imag != 0) & ~(np.abs(lam.imag) > error)


def _shrunk_to_points(box: Box, theta: np.ndarray) -> Box:
    """The box shrunk to its design points."""
    return Box(np.maximum(box.low, theta.min(axis=0)), np.minimum(box.high, theta.max(axis=0)))


def _halves(box: Box, axis: int, theta: np.ndarray) -> list[tuple[Box, np.ndarray]]:
    """The two halves of a box and the points in each; points on the cut go to the lower half."""
    lower, upper = box.halves(axis)
    below = theta[:, axis] <= box.middle[axis]
    return [(lower, below), (upper, ~below)]


RUNG = WindowsRung()
