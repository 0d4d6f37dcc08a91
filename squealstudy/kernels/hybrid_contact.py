"""The contact iteration of a hybrid Newmark step, condensed to the contact directions.

With G the change of the velocities at the contact points a newton, forces r obey
r = f(y + G (r - r_guess)): a non-linear block Gauss-Seidel iteration, one point after the other,
each solved by a damped Newton in its three directions. G is symmetric and positive definite and
friction monotone, so that stiff regularisations of sticking need no mock-up or acceleration.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import hybrid_layout as at
from squealstudy.kernels import newmark_layout as its
from squealstudy.kernels.hybrid_point import BIG, imbalance, solve_point
from squealstudy.kernels.jit import fast_kernel

FIRST_SHARE = 0.5  # of the tolerance: imbalance below which a point is left alone in a sweep
NEXT_SHARE = 0.3  # the same after every sweep


@fast_kernel
def quadratic_form(G: np.ndarray, x: np.ndarray) -> float:
    """x^T G x for G (n, n); NaN stays NaN."""
    total = 0.0
    for i in range(x.size):
        if x[i] != 0.0:
            row = 0.0
            for j in range(x.size):
                row += G[i, j] * x[j]
            total += x[i] * row
    return total


@fast_kernel
def evaluate(
    points: np.ndarray,
    law: np.ndarray,
    half: float,
    x_base: np.ndarray,
    y: np.ndarray,
    r: np.ndarray,
    point: np.ndarray,
    F: np.ndarray,
) -> tuple[float, float]:
    """Imbalance F (3 nc,) of all points; squares of its friction part and of the bounds."""
    change2 = 0.0
    bounds2 = 0.0
    for i in range(points.shape[0]):
        a = 3 * i
        own = F[a : a + 3]
        imbalance(points[i], law, half, x_base[i], y[a : a + 3], r[a : a + 3], point[i, :6], own)
        change2 += own[1] * own[1] + own[2] * own[2]
        bound = (
            points[i, its.POINT_AREA]
            * points[i, its.POINT_FRICTION]
            * law[its.LAW_MU]
            * point[i, its.OUT_P]
        )
        bounds2 += bound * bound
    return change2, bounds2


@fast_kernel
def sweep(
    points: np.ndarray,
    law: np.ndarray,
    half: float,
    G: np.ndarray,
    x_base: np.ndarray,
    y: np.ndarray,
    r: np.ndarray,
    point: np.ndarray,
    scratch: np.ndarray,
    least: float,
    least_t: float,
) -> None:
    """One Gauss-Seidel sweep over the points whose squared imbalances exceed the two limits."""
    F, block = np.empty(3), np.empty((3, 3))
    for i in range(points.shape[0]):
        a = 3 * i
        imbalance(points[i], law, half, x_base[i], y[a : a + 3], r[a : a + 3], point[i, :6], F)
        e2 = 0.0
        for b in range(3):
            for c in range(3):
                block[b, c] = G[a + b, a + c]
                e2 += F[b] * block[b, c] * F[c]
        if e2 <= least and F[1] * F[1] + F[2] * F[2] <= least_t:
            continue
        solve_point(
            points[i],
            law,
            half,
            x_base[i],
            block,
            y[a : a + 3],
            r[a : a + 3],
            scratch,
            point[i, :6],
        )
        for b in range(3):
            change = scratch[0, b]
            r[a + b] += change
            row = G[a + b]
            for j in range(y.size):
                y[j] += row[j] * change


@fast_kernel
def contact_iteration(
    points: np.ndarray,
    law: np.ndarray,
    half: float,
    G: np.ndarray,
    floor2: float,
    x_base: np.ndarray,
    y: np.ndarray,
    r: np.ndarray,
    point: np.ndarray,
    scale2: float,
    tolerance: float,
    tolerance_t: float,
    max_iterations: int,
) -> tuple[int, int, float]:
    """Balance the forces r (3 nc,) with the velocities y (3 nc,), both changed in place.

    Accepted where the imbalance F is below `tolerance` of the contact and inertia forces (their
    square is `scale2`), in the metric of G, and its friction part below `tolerance_t` of the
    friction bounds: the criteria of the modal kernel. Returns the outcome, the number of
    evaluations of all points and the largest ratio of imbalances over a sweep.
    """
    nc = points.shape[0]
    scratch = np.empty((10, 3))
    F = np.empty(r.size)
    tol2, tol2_t = tolerance * tolerance, tolerance_t * tolerance_t
    share = FIRST_SHARE * FIRST_SHARE
    contraction = 0.0
    e2_old = 0.0
    for iteration in range(max_iterations):
        change2, bounds2 = evaluate(points, law, half, x_base, y, r, point, F)
        e2 = quadratic_form(G, F)
        if not (e2 < BIG and scale2 < BIG and change2 < BIG and bounds2 < BIG):
            return at.NOT_FINITE, iteration + 1, contraction
        limit, limit_t = tol2 * scale2 + floor2, tol2_t * bounds2
        if e2 <= limit and change2 <= limit_t:
            return at.ACCEPTED, iteration + 1, contraction
        if iteration > 0 and e2_old > floor2:
            contraction = max(contraction, (e2 / e2_old) ** 0.5)
        e2_old = e2
        sweep(
            points,
            law,
            half,
            G,
            x_base,
            y,
            r,
            point,
            scratch,
            share * limit / nc,
            share * limit_t / nc,
        )
        share *= NEXT_SHARE * NEXT_SHARE
    return at.NOT_CONVERGED, max_iterations, contraction
