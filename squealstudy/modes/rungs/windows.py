"""Patches over the design points of a box: placed where the error estimate asks for them.

A patch that cannot follow its modes, or whose estimate exceeds the tolerance, is halved along the
direction in which modes mix most; where too few points are left to pay for one, they are solved in
the sweep basis, and where that is not good enough, in the full problem.
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

DEGREE = {1: 5, 2: 4}  # of the interpolation; in more dimensions 2
PAYS = 1.5  # design points a node for a patch to pay
POINTS_PER_TEST = 32
MOST_EXCEEDING = 0.1  # share of points beyond the tolerance from which on a patch is halved
MAX_BISECTIONS = 14  # halvings

# design points of one structure from which on windows take less time than dense points, by the
# number of parameters that vary; a basis is made by one process, points are solved by all.
# studies/benchmarks/method_costs.py measures these and what follows
PAYS_FROM = {1: 60, 2: 500, 3: 1500}
# seconds of a point over those of an exact one, where many share a patch: (ALONE / points) ** FALLS
# by the number of parameters that vary: .23 at 60 points over one; .89 and .64 at 300 and 500 over
# two; .13 at 20,000 is of an earlier state, whose exact points were dearer
ALONE, FALLS = {1: 2.5, 2: 230.0}, 0.46

Solution = tuple[int, Outcome]  # row of a design point, and its roots or why it has none


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
        """It falls with the number of points that share a patch."""
        return float(min(1.0, (ALONE.get(varied, ALONE[2]) / max(points, 1)) ** FALLS))

    def offer(self, scope: Scope) -> Offer:
        """From some number of points on, over few parameters."""
        if scope.varied not in PAYS_FROM:
            return Offer(False, "")
        if scope.points < PAYS_FROM[scope.varied]:
            return Offer(False, f"{scope.points} points a structure do not pay for a basis")
        return Offer(True, f"{scope.points} points a structure pay for a basis and patches")


@dataclass(frozen=True)
class Windows(InBasis):
    """Solves design points of a box by patches over a sweep basis.

    Attributes
    ----------
    counts : Counter
        Patches made, and nodes solved for them.
    """

    counts: Counter[str] = field(default_factory=Counter)

    def solve(self, box: Box, theta: np.ndarray) -> Iterator[Solution]:
        """Roots of all design points theta (n, d) in a box by their rows, in any order."""
        yield from self._divide(box, theta, np.arange(len(theta)), 0)

    def _divide(
        self, box: Box, theta: np.ndarray, rows: np.ndarray, depth: int
    ) -> Iterator[Solution]:
        if not len(rows):
            return
        grid = interpolation(DEGREE.get(theta.shape[1], 2), theta.shape[1])
        if len(rows) < PAYS * len(grid.nodes) or depth > MAX_BISECTIONS:
            for row in rows:
                yield int(row), self.alone(theta[row])
            return
        tried = _shrunk_to_points(box, theta[rows])
        patch = self._patch(tried, grid)
        if isinstance(patch, FollowedPatch):
            rows = yield from self._served(patch, theta, rows)
            if not len(rows):
                return
            slope = patch.slope
        else:
            slope = patch
        axis = int(np.argmax(np.where(tried.high > tried.low, slope, -np.inf)))
        for half in _halves(tried, axis, theta[rows]):
            yield from self._divide(half[0], theta, rows[half[1]], depth + 1)

    def _served(
        self, patch: FollowedPatch, theta: np.ndarray, rows: np.ndarray
    ) -> Generator[Solution, None, np.ndarray]:
        """Points of a patch one after another; returned are those that it is not to serve.

        All of them where too many of a few points that fill it exceed the tolerance, those that are
        left where too many others do.
        """
        most = 2 * len(patch.patch.grid.nodes)  # those of both halves cost about as much
        spread = np.arange(len(rows)) % max(len(rows) // POINTS_PER_TEST, 1) == 0
        looked_at, others = rows[spread], rows[~spread]
        first = list(self._points(patch, theta, looked_at))
        exceeding = sum(not self.within_tolerance(outcome) for _, outcome in first)
        if exceeding > max(min(MOST_EXCEEDING * len(first), most), 1):
            return rows
        yield from (self._mended(*solved, theta) for solved in first)
        allowed = max(min(MOST_EXCEEDING * len(rows), most), 1)
        for start in range(0, len(others), POINTS_PER_TEST):
            for row, outcome in self._points(patch, theta, others[start : start + POINTS_PER_TEST]):
                exceeding += not self.within_tolerance(outcome)
                yield self._mended(row, outcome, theta)
            if exceeding > allowed:
                return others[start + POINTS_PER_TEST :]
        return rows[:0]

    def _mended(self, row: int, found: Outcome, theta: np.ndarray) -> Solution:
        """A point of a patch, solved by itself where it exceeds the tolerance."""
        return row, found if self.within_tolerance(found) else self.alone(theta[row])

    def _patch(self, box: Box, grid: Interpolation) -> FollowedPatch | np.ndarray:
        """A patch over a box, or how much its modes mix along each direction."""
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
        """Errors of the sweep basis for light and for all modes of each block, worst of the nodes.

        (2, m), each per condition of the root, |x| |y|: near coalescence, where single errors
        diverge, they do so by the condition there. A block may hold roots that the basis was not
        made for, far from the band: those count only where it has no others.
        """
        worst = np.zeros((3, patch.m))
        for number, (w, node) in enumerate(zip(weights, nodes, strict=True)):
            chosen = np.concatenate([b.at_nodes[number] for b in patch.blocks])
            pairs = node.pairs.take(chosen)
            error = two_sided_error(self.problem, w, self.basis.expand(w, pairs))
            error = bounded(error, pairs.lam) / conditions(pairs.X, pairs.Y)
            meant = in_band(pairs.lam, self.problem.band, BASIS_BAND_FACTOR)
            every = np.ones(len(error), dtype=bool)
            kinds = np.where([lightly_damped(pairs.lam), meant, every], error, 0.0)
            for start, k in patch.slices:
                block_columns = slice(start, start + k)
                worst[:, block_columns] = np.maximum(
                    worst[:, block_columns], kinds[:, block_columns].max(axis=1)[:, None]
                )
        return np.array([worst[0], np.where(worst[1] > 0, worst[1], worst[2])])

    def _points(
        self, patch: FollowedPatch, theta: np.ndarray, rows: np.ndarray
    ) -> Iterator[Solution]:
        for start in range(0, len(rows), POINTS_PER_TEST):
            part = rows[start : start + POINTS_PER_TEST]
            samples = self.problem.samples(theta[part], patch.starts)
            linearised = []
            for row, at in zip(part, samples, strict=True):
                if isinstance(at, ConvergenceError):
                    yield int(row), at
                else:
                    linearised.append((int(row), at))
            if not linearised:
                continue
            there = np.array([row for row, _ in linearised])
            weights = [at.weights for _, at in linearised]
            roots = ritz_roots(patch.patch, self.basis, theta[there], weights)
            for k, (row, at) in enumerate(linearised):
                yield row, self._one(at, roots, k, patch.floor)

    def _one(
        self, at: Linearisation, roots: RitzRoots, k: int, floor: np.ndarray
    ) -> EstimatedRoots:
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
        # far from the band the roots of the basis are artefacts: its own error is no doubt of them
        doubtful = ~inside & _may_be_inside(lam, root_error, band, self.tolerance)
        near = (np.abs(lam) + root_error >= band[0]) & (np.abs(lam) - root_error <= band[1])
        doubtful |= near & ~lightly_damped(lam) & _may_be_real(lam, root_error)
        return EstimatedRoots(
            at=at,
            lam=lam[order_inside],
            X=roots.X[k][:, order_inside],
            error=(root_error + of_basis)[order_inside],
            residual=roots.residual[k][order_inside],
            method=WindowsRung.name,
            full=False,
            complete=not doubtful.any(),
        )


class FollowedPatch(NamedTuple):
    """A patch with the starts of its working points, the errors of its basis, its mixing."""

    patch: Patch
    starts: object
    floor: np.ndarray
    slope: np.ndarray


def conditions(X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """|x| |y| of each pair (m,) with y^H Q'(lam) x = 1: what its root makes of a perturbation."""
    product: np.ndarray = np.linalg.norm(X, axis=0) * np.linalg.norm(Y, axis=0)
    return product


def _may_be_inside(
    lam: np.ndarray, error: np.ndarray, band: tuple[float, float], tolerance: float
) -> np.ndarray:
    """Roots that are off by more than the tolerance and may then lie in the band; NaN may."""
    size = np.abs(lam)
    outside = (size + error < band[0]) | (size - error > band[1]) | (lam.imag + error < 0)
    return ~(outside | (error <= tolerance * size))


def _may_be_real(lam: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Complex roots that may be one of two real ones: none may be taken for a conjugate."""
    return (lam.imag != 0) & ~(np.abs(lam.imag) > error)


def _shrunk_to_points(box: Box, theta: np.ndarray) -> Box:
    """The box shrunk to its design points."""
    return Box(np.maximum(box.low, theta.min(axis=0)), np.minimum(box.high, theta.max(axis=0)))


def _halves(box: Box, axis: int, theta: np.ndarray) -> list[tuple[Box, np.ndarray]]:
    """Both halves and which points each holds; points on the cut go to the lower half."""
    lower, upper = box.halves(axis)
    below = theta[:, axis] <= box.middle[axis]
    return [(lower, below), (upper, ~below)]


RUNG = WindowsRung()
