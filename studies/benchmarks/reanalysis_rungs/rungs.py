"""Every rung on the same points: what it costs and how wrong it is."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.linalg.companion import all_pairs, all_roots
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.modes.reanalysis.brake_problem import BrakeProblem
from squealstudy.modes.reanalysis.estimate import bounded, two_sided_error
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.polynomials import interpolation
from squealstudy.modes.reanalysis.problem import SweptProblem, in_band
from squealstudy.modes.reanalysis.ritz import ritz_roots
from squealstudy.modes.reanalysis.sweep_basis import SweepBasis, build_sweep_basis
from squealstudy.modes.rungs.perturbation import MARGIN, make_anchor, perturbed_pairs
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


def dense(
    problem: BrakeProblem, theta: np.ndarray, weights: Sequence[Weights]
) -> tuple[Points, Measured]:
    """The exact rung: roots alone, and with right vectors, which are the reference."""
    row, exact = Measured("dense", size=f"{problem.system.n}"), []
    for w in weights:
        (_, C, K), assembled = timed(lambda w=w: problem.system.matrices(w))
        _, values = timed(lambda C=C, K=K: all_roots(C, K))
        (lam, _), vectors = timed(lambda C=C, K=K: dense_roots(C, K, problem.band))
        row.values.append(assembled + values)
        row.vectors.append(assembled + vectors)
        exact.append(lam)
        row.compare(lam, lam)
    return Points(theta, weights, exact), row


def two_step(problem: SweptProblem, points: Points, factor: float) -> Measured:
    """Real modes, then a small problem."""
    row, top = Measured(f"two_step {factor:g}x band"), factor * problem.band[1]
    for w, exact in zip(points.weights, points.exact, strict=True):
        pairs, vectors = timed(lambda w=w: two_step_pairs(problem.system, w, top))
        row.size = f"{len(pairs.lam) // 2}"
        _estimated(row, problem, w, exact, pairs, (None, vectors))
    return row


def perturbation(problem: SweptProblem, points: Points, order: int) -> Measured:
    """From the middle of the box."""
    anchor, setup = timed(lambda: make_anchor(problem, np.zeros(problem.dimension), 1e6))
    near = np.flatnonzero(in_band(anchor.pairs.lam, problem.band, MARGIN))
    row = Measured(f"perturbation {order}", setup / 1e3, f"{len(anchor.pairs.lam)} modes")
    for w, exact in zip(points.weights, points.exact, strict=True):
        pairs, ms = timed(lambda w=w: perturbed_pairs(problem.system, anchor, w, order, near))
        _estimated(row, problem, w, exact, pairs, (None, ms))
    return row


def sweep_basis(
    problem: SweptProblem, points: Points, tolerance: float, most: int
) -> tuple[SweepBasis, Measured]:
    """One basis for the box."""
    basis = build_sweep_basis(problem, tolerance, most)
    size = f"{basis.V.shape[1]}, {len(basis.trained)} points"
    row = Measured(f"sweep_basis {tolerance:.0e}", basis.seconds, size)
    for w, exact in zip(points.weights, points.exact, strict=True):
        (C, K), assembled = timed(lambda w=w: basis.small.matrices([w]))
        _, values = timed(lambda C=C, K=K: all_roots(C[0], K[0]))
        pairs, vectors = timed(lambda C=C, K=K: all_pairs(C[0], K[0]))
        pairs = pairs.take(in_band(pairs.lam, problem.band, EDGE))
        full, expanded = timed(lambda w=w, p=pairs: basis.expand(w, p))
        times = (assembled + values, assembled + vectors + expanded)
        _estimated(row, problem, w, exact, full, times)
    return basis, row


def _estimated(row, problem, weights, exact, pairs, times) -> None:
    values, vectors = times
    pairs = pairs.take(in_band(pairs.lam, problem.band, EDGE))
    error, ms = timed(lambda: two_sided_error(problem, weights, pairs))
    if values is not None:
        row.values.append(values)
    row.vectors.append(vectors)
    row.estimate.append(vectors + ms)
    row.compare(exact, pairs.lam, bounded(error, pairs.lam))


def windows(problem: SweptProblem, basis: SweepBasis, points: Points, tolerance: float) -> Measured:
    """Patches that cover the box: two-sided Ritz values, vectors, estimates of their errors."""
    solver = Windows(problem, basis, tolerance)
    name = f"windows {solver.tolerance:.0e}"
    row, patches = _covered(solver, points, name, ritz_hold(solver, points.theta))
    for followed, rows in patches:
        batch = [points.weights[i] for i in rows]
        where = followed.patch, solver.basis, points.theta[rows], batch
        ritz_roots(*where)
        _, ms = timed(lambda where=where: ritz_roots(*where))
        row.estimate += [ms / len(rows)] * len(rows)
        for i, p in solver._points(followed, points.theta, np.array(rows)):
            row.compare(points.exact[i], p.lam, p.error)
    return row


Holds = Callable[[FollowedPatch, list[int]], bool]


def ritz_hold(solver: Windows, theta: np.ndarray) -> Holds:
    """Whether the estimates of the points of a patch are within the tolerance."""
    return lambda followed, rows: all(
        solver.within_tolerance(p) for _, p in solver._points(followed, theta, np.array(rows))
    )


Cover = list[tuple[FollowedPatch, list[int]]]


def _covered(solver: Windows, points: Points, name: str, holds: Holds) -> tuple[Measured, Cover]:
    started = time.perf_counter()
    patches = cover(solver, points.theta, holds)
    setup = time.perf_counter() - started
    missing = len(points.theta) - sum(len(rows) for _, rows in patches)
    name = f"{name}, {missing} left" if missing else name
    return Measured(name, setup, f"{len(patches)} patches"), patches


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
