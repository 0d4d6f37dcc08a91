"""Every rung on the same points: what it costs and how wrong it is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from squealstudy.linalg.companion import Eigenpairs, all_pairs, all_roots
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.modes.reanalysis.brake_problem import BrakeProblem
from squealstudy.modes.reanalysis.estimate import bounded, two_sided_error
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.polynomials import interpolation
from squealstudy.modes.reanalysis.problem import SweptProblem, in_band
from squealstudy.modes.reanalysis.ritz import ritz_roots
from squealstudy.modes.reanalysis.sweep_basis import SweepBasis, build_sweep_basis
from squealstudy.modes.rungs.perturbation import ANCHOR_BAND_FACTOR, make_anchor, perturbed_pairs
from squealstudy.modes.rungs.two_step import two_step_pairs
from squealstudy.modes.rungs.windows import DEGREE, FollowedPatch, Windows
from squealstudy.system.parametric import Weights

from .measure import Measured, timed

EDGE = 1.02  # roots found a little beyond the band are no spurious ones


@dataclass(frozen=True)
class Points:
    """Design points of the measurement: theta (n, d), weights, exact roots in the band."""

    theta: np.ndarray
    weights: Sequence[Weights]
    exact: Sequence[np.ndarray]


class Way(NamedTuple):
    """A rung that is set up: `at(i)` adds its times and errors at design point i to the row.

    All ways are measured at one point before the next, so that a machine whose speed changes
    changes all of them alike.
    """

    row: Measured
    at: Callable[[int], None]


def exact_points(problem: BrakeProblem, theta: np.ndarray, weights: Sequence[Weights]) -> Points:
    """The points with the roots that all rungs are held against."""
    matrices = (problem.system.matrices(w) for w in weights)
    return Points(theta, weights, [dense_roots(C, K, problem.band)[0] for _, C, K in matrices])


def dense(problem: BrakeProblem, points: Points) -> Way:
    """The exact rung: roots of the band with right vectors, which are the reference."""
    row = Measured("dense", size=f"{problem.system.n}")

    def at(i: int) -> None:
        (_, C, K), assembled = timed(lambda: problem.system.matrices(points.weights[i]))
        (lam, _), vectors = timed(lambda: dense_roots(C, K, problem.band))
        row.vectors.append(assembled + vectors)
        row.compare(points.exact[i], lam)

    return Way(row, at)


def geev(problem: BrakeProblem, points: Points) -> Way:
    """All roots by LAPACK's `geev`, without vectors: what a dense solver costs that is not ours."""
    row = Measured("geev, all values", size=f"{problem.system.n}")

    def at(i: int) -> None:
        (_, C, K), assembled = timed(lambda: problem.system.matrices(points.weights[i]))
        lam, values = timed(lambda: all_roots(C, K))
        row.values.append(assembled + values)
        row.compare(points.exact[i], lam[in_band(lam, problem.band, EDGE)])

    return Way(row, at)


def two_step(problem: SweptProblem, points: Points, factor: float) -> Way:
    """Real modes, then a small problem."""
    row, top = Measured(f"two_step {factor:g}x band"), factor * problem.band[1]

    def at(i: int) -> None:
        pairs, ms = timed(lambda: two_step_pairs(problem.system, points.weights[i], top))
        row.size = f"{len(pairs.lam) // 2}"
        _estimated(row, problem, points, i, pairs, ms)

    return Way(row, at)


def perturbation(problem: SweptProblem, points: Points, order: int) -> Way:
    """From the middle of the box."""
    anchor, setup = timed(lambda: make_anchor(problem, np.zeros(problem.dimension), 1e6))
    near = np.flatnonzero(in_band(anchor.pairs.lam, problem.band, ANCHOR_BAND_FACTOR))
    row = Measured(f"perturbation {order}", setup / 1e3, f"{len(anchor.pairs.lam)} modes")

    def at(i: int) -> None:
        (pairs, _), ms = timed(
            lambda: perturbed_pairs(problem.system, anchor, points.weights[i], order, near)
        )
        _estimated(row, problem, points, i, pairs, ms)

    return Way(row, at)


def sweep_basis(
    problem: SweptProblem, points: Points, tolerance: float, most: int
) -> tuple[SweepBasis, Way]:
    """One basis for the box."""
    basis, setup = timed(lambda: build_sweep_basis(problem, tolerance, most))
    size = f"{basis.V.shape[1]}, {len(basis.trained)} points"
    row = Measured(f"sweep_basis {tolerance:.0e}", setup / 1e3, size)

    def at(i: int) -> None:
        w = points.weights[i]
        (C, K), assembled = timed(lambda: basis.small.matrices([w]))
        _, values = timed(lambda: all_roots(C[0], K[0]))
        pairs, vectors = timed(lambda: all_pairs(C[0], K[0]))
        pairs = pairs.take(in_band(pairs.lam, problem.band, EDGE))
        full, expanded = timed(lambda: basis.expand(w, pairs))
        row.values.append(assembled + values)
        _estimated(row, problem, points, i, full, assembled + vectors + expanded)

    return basis, Way(row, at)


def _estimated(
    row: Measured,
    problem: SweptProblem,
    points: Points,
    i: int,
    pairs: Eigenpairs,
    vectors_ms: float,
) -> None:
    """Add what a rung found at a point, with the time that its error estimate takes besides."""
    pairs = pairs.take(in_band(pairs.lam, problem.band, EDGE))
    error, ms = timed(lambda: two_sided_error(problem, points.weights[i], pairs))
    row.vectors.append(vectors_ms)
    row.estimate.append(vectors_ms + ms)
    row.compare(points.exact[i], pairs.lam, bounded(error, pairs.lam))


def windows(problem: SweptProblem, basis: SweepBasis, points: Points, tolerance: float) -> Way:
    """Patches that cover the box: two-sided Ritz values, vectors, estimates of their errors.

    Points of a patch are solved together, as in a study, and share the time of that.
    """
    solver = Windows(problem, basis, tolerance)
    name = f"windows {solver.tolerance:.0e}"
    row, patches = _covered(solver, points, name, ritz_hold(solver, points.theta))
    serving = {i: (followed, rows) for followed, rows in patches for i in rows}
    for followed, rows in patches:
        for i, p in solver._points(followed, points.theta, np.array(rows)):
            row.compare(points.exact[i], p.lam, p.error)

    def at(i: int) -> None:
        if i in serving:
            followed, rows = serving[i]
            batch = [points.weights[k] for k in rows]
            where = followed.patch, solver.basis, points.theta[rows], batch
            _, ms = timed(lambda: ritz_roots(*where))
            row.estimate.append(ms / len(rows))

    return Way(row, at)


Holds = Callable[[FollowedPatch, list[int]], bool]


def ritz_hold(solver: Windows, theta: np.ndarray) -> Holds:
    """Whether the estimates of the points of a patch are within the tolerance."""
    return lambda followed, rows: all(
        solver.within_tolerance(p) for _, p in solver._points(followed, theta, np.array(rows))
    )


Cover = list[tuple[FollowedPatch, list[int]]]


def _covered(solver: Windows, points: Points, name: str, holds: Holds) -> tuple[Measured, Cover]:
    patches, ms = timed(lambda: cover(solver, points.theta, holds))
    missing = len(points.theta) - sum(len(rows) for _, rows in patches)
    name = f"{name}, {missing} left" if missing else name
    return Measured(name, ms / 1e3, f"{len(patches)} patches"), patches


def cover(
    solver: Windows,
    theta: np.ndarray,
    holds: Holds,
    deepest: int = 10,
) -> Cover:
    """Patches of the box with the points each serves, halved until they hold.

    Windows makes a patch only where enough points pay for it; a measurement wants the box covered.
    """
    d = theta.shape[1]
    grid = interpolation(DEGREE.get(d, 2), d)
    found: Cover = []
    pending = [(Box(-np.ones(d), np.ones(d)), list(range(len(theta))), 0)]
    while pending:
        box, rows, depth = pending.pop()
        if not rows:
            continue
        patch = solver._patch(box, grid)
        if isinstance(patch, FollowedPatch):
            if depth == deepest or holds(patch, rows):
                found.append((patch, rows))
                continue
            patch = patch.slope
        if depth == deepest:
            continue
        axis = int(np.argmax(patch))
        lower, upper = box.halves(axis)
        below = [i for i in rows if theta[i, axis] <= box.middle[axis]]
        above = [i for i in rows if theta[i, axis] > box.middle[axis]]
        pending += [(lower, below, depth + 1), (upper, above, depth + 1)]
    return found


def whole_study(
    problem: SweptProblem, basis: SweepBasis, theta: np.ndarray, tolerance: float
) -> tuple[float, dict[str, int]]:
    """Milliseconds a point of a study of these points, patches and working points counted."""
    solver, d = Windows(problem, basis, tolerance), theta.shape[1]
    points, ms = timed(lambda: list(solver.solve(Box(-np.ones(d), np.ones(d)), theta)))
    served: dict[str, int] = dict(solver.counts)
    for _, p in points:
        served[p.method] = served.get(p.method, 0) + 1
    return ms / len(theta), served
