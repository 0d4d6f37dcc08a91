"""The contact iteration of a hybrid Newmark step, condensed to the contact directions.

With G the change of the velocities at the contact points a newton, forces r obey
r = f(y + G (r - r_guess)): a non-linear block Gauss-Seidel iteration, one point after the other,
each solved by a damped Newton in its three directions. G is symmetric and positive definite and
friction monotone, so that stiff regularisations of sticking need no mock-up or acceleration.

The arithmetic of a point's forces is written apart from that of the modal kernel, which the hybrid
representation judges. Column layouts are those of hybrid_layout.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as its
from squealstudy.kernels.hybrid_layout import Contact, Limits
from squealstudy.kernels.jit import exact_kernel, fast_kernel, room_kernel
from squealstudy.kernels.laws import contact_at, friction_at, friction_tangent

FIRST_SHARE = 0.5  # of the tolerance: imbalance below which a point is left alone in a sweep
NEXT_SHARE = 0.3  # the same after every sweep
MAX_FINITE_SQUARE = 1e290  # squares at or beyond it, and NaN, are not finite
LOCAL_ITERATIONS = 20
LOCAL_TOLERANCE = 1e-4  # of the imbalance before
FORCE_ROUND_OFF = 1e-14  # of the forces
MIN_NEWTON_FACTOR = 1e-3  # damped Newton step


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
def friction_bound2(points: np.ndarray, law: np.ndarray, trial: np.ndarray, i: int) -> float:
    """Square of the friction bound of point i at the typical large coefficient, N^2."""
    own = points[i]
    bound = own[its.POINT_AREA] * own[its.POINT_FRICTION] * law[its.LAW_MU] * trial[i, its.OUT_P]
    return bound * bound


@fast_kernel
def evaluate(contact: Contact, F: np.ndarray) -> tuple[float, float]:
    """Imbalance F (3 nc,) of all points; squares of its friction part and of the bounds."""
    change2 = 0.0
    bounds2 = 0.0
    for i in range(contact.points.shape[0]):
        a = 3 * i
        own = F[a : a + 3]
        imbalance(contact, i, contact.y[a : a + 3], contact.r[a : a + 3], own)
        change2 += own[1] * own[1] + own[2] * own[2]
        bounds2 += friction_bound2(contact.points, contact.law, contact.trial, i)
    return change2, bounds2


@room_kernel
def sweep(
    contact: Contact, G: np.ndarray, scratch: np.ndarray, least: float, least_t: float
) -> None:
    """One Gauss-Seidel sweep over the points whose squared imbalances exceed the two limits."""
    F, block, y, r = np.empty(3), np.empty((3, 3)), contact.y, contact.r
    for i in range(contact.points.shape[0]):
        a = 3 * i
        imbalance(contact, i, y[a : a + 3], r[a : a + 3], F)
        e2 = 0.0
        for b in range(3):
            for c in range(3):
                block[b, c] = G[a + b, a + c]
                e2 += F[b] * block[b, c] * F[c]
        if e2 <= least and F[1] * F[1] + F[2] * F[2] <= least_t:
            continue
        solve_point(contact, i, block, scratch)
        for b in range(3):
            change = scratch[0, b]
            r[a + b] += change
            row = G[a + b]
            for j in range(y.size):
                y[j] += row[j] * change


@room_kernel
def contact_iteration(
    contact: Contact, G: np.ndarray, floor2: float, scale2: float, limits: Limits
) -> tuple[int, int, float]:
    """Balance the forces r (3 nc,) with the velocities y (3 nc,), both changed in place.

    Accepted where the imbalance F is below the tolerance of the contact and inertia forces (their
    square is `scale2`), in the metric of G, and its friction part below that of the friction
    bounds: the criteria of the modal kernel. Returns the outcome, the number of evaluations of all
    points and the largest ratio of imbalances over a sweep.
    """
    nc = contact.points.shape[0]
    scratch = np.empty((10, 3))
    F = np.empty(contact.r.size)
    limit = limits.tolerance * limits.tolerance * scale2 + floor2
    share = FIRST_SHARE * FIRST_SHARE
    contraction = 0.0
    e2_old = 0.0
    for iteration in range(limits.max_iterations):
        change2, bounds2 = evaluate(contact, F)
        e2 = quadratic_form(G, F)
        if not (
            e2 < MAX_FINITE_SQUARE
            and scale2 < MAX_FINITE_SQUARE
            and change2 < MAX_FINITE_SQUARE
            and bounds2 < MAX_FINITE_SQUARE
        ):
            return its.NOT_FINITE, iteration + 1, contraction
        limit_t = limits.tolerance_t * limits.tolerance_t * bounds2
        if e2 <= limit and change2 <= limit_t:
            return its.DONE, iteration + 1, contraction
        if iteration > 0 and e2_old > floor2:
            contraction = max(contraction, (e2 / e2_old) ** 0.5)
        e2_old = e2
        sweep(contact, G, scratch, share * limit / nc, share * limit_t / nc)
        share *= NEXT_SHARE * NEXT_SHARE
    return its.NOT_CONVERGED, limits.max_iterations, contraction


@exact_kernel
def imbalance(contact: Contact, i: int, y: np.ndarray, r: np.ndarray, F: np.ndarray) -> float:
    """F = f(y) - r of point i, its square; y, r and F (3,).

    Its row of `trial` gets the absolute state: columns newmark_layout.OUT_*. The normal force
    contains + k_ref x: the tangent at the reference is inside K.
    """
    point, law, trial = contact.points[i], contact.law, contact.trial[i]
    x, w1, w2 = contact.x_base[i] + contact.half * y[0], point[its.POINT_SPEED] + y[1], y[2]
    area = point[its.POINT_AREA]
    p, _ = contact_at(law, point[its.POINT_GAP] + x)
    t1, t2, _ = friction_at(law, point[its.POINT_FRICTION], p, w1, w2)
    t1 *= area
    t2 *= area
    trial[its.OUT_X], trial[its.OUT_W1], trial[its.OUT_W2] = x, w1, w2
    trial[its.OUT_P], trial[its.OUT_T1], trial[its.OUT_T2] = p, t1, t2
    # r comes off last: friction near lift-off is far below the round-off of the base's
    F[0] = area * p - point[its.POINT_NORMAL] + point[its.POINT_STIFFNESS] * x - r[0]
    F[1] = t1 - point[its.POINT_T1] - r[1]
    F[2] = t2 - point[its.POINT_T2] - r[2]
    return F[0] * F[0] + F[1] * F[1] + F[2] * F[2]


@fast_kernel
def tangent(contact: Contact, i: int, D: np.ndarray) -> None:
    """Derivative D (3, 3) of a point's forces by its velocities, at its evaluated state."""
    point, law, trial, half = contact.points[i], contact.law, contact.trial[i], contact.half
    area = point[its.POINT_AREA]
    _, kappa = contact_at(law, point[its.POINT_GAP] + trial[its.OUT_X])
    d11, d12, d22, f1, f2 = friction_tangent(
        law, point[its.POINT_FRICTION], trial[its.OUT_P], trial[its.OUT_W1], trial[its.OUT_W2]
    )
    D[0, 0] = half * (point[its.POINT_STIFFNESS] - area * kappa)
    D[0, 1] = D[0, 2] = 0.0
    D[1, 0] = -area * half * kappa * f1
    D[2, 0] = -area * half * kappa * f2
    D[1, 1], D[1, 2] = area * d11, area * d12
    D[2, 1], D[2, 2] = area * d12, area * d22


@fast_kernel
def solve3(A: np.ndarray, b: np.ndarray, x: np.ndarray) -> None:
    """X = A^-1 b for (3, 3), by cofactors; a singular A gives inf or NaN."""
    c0 = A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1]
    c1 = A[1, 2] * A[2, 0] - A[1, 0] * A[2, 2]
    c2 = A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0]
    det = A[0, 0] * c0 + A[0, 1] * c1 + A[0, 2] * c2
    d0 = A[0, 2] * A[2, 1] - A[0, 1] * A[2, 2]
    d1 = A[0, 0] * A[2, 2] - A[0, 2] * A[2, 0]
    d2 = A[0, 1] * A[2, 0] - A[0, 0] * A[2, 1]
    e0 = A[0, 1] * A[1, 2] - A[0, 2] * A[1, 1]
    e1 = A[0, 2] * A[1, 0] - A[0, 0] * A[1, 2]
    e2 = A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
    x[0] = (c0 * b[0] + d0 * b[1] + e0 * b[2]) / det
    x[1] = (c1 * b[0] + d1 * b[1] + e1 * b[2]) / det
    x[2] = (c2 * b[0] + d2 * b[1] + e2 * b[2]) / det


@room_kernel
def solve_point(contact: Contact, i: int, G: np.ndarray, scratch: np.ndarray) -> None:
    """Change of one point's forces, row 0 of `scratch` (10, 3), that balances it.

    G (3, 3) is its own block.
    """
    y0, r0 = contact.y[3 * i : 3 * i + 3], contact.r[3 * i : 3 * i + 3]
    change, y, r, F = scratch[0], scratch[1], scratch[2], scratch[3]
    D, A = scratch[4:7], scratch[7:10]
    change[:] = 0.0
    y[0], y[1], y[2] = y0[0], y0[1], y0[2]
    r[0], r[1], r[2] = r0[0], r0[1], r0[2]
    F2 = imbalance(contact, i, y, r, F)
    step = np.empty(3)
    normal = contact.trial[i, its.OUT_P] * contact.points[i, its.POINT_AREA]
    enough = (
        LOCAL_TOLERANCE * LOCAL_TOLERANCE * F2 + FORCE_ROUND_OFF * FORCE_ROUND_OFF * normal * normal
    )
    for _ in range(LOCAL_ITERATIONS):
        if not (enough < F2 < MAX_FINITE_SQUARE):
            return
        tangent(contact, i, D)
        for a in range(3):
            for b in range(3):
                A[a, b] = -(D[a, 0] * G[0, b] + D[a, 1] * G[1, b] + D[a, 2] * G[2, b])
            A[a, a] += 1.0
        solve3(A, F, step)
        length = 1.0
        before = F2
        while True:
            for a in range(3):
                r[a] = r0[a] + change[a] + length * step[a]
            for a in range(3):
                y[a] = y0[a]
                for b in range(3):
                    y[a] += G[a, b] * (r[b] - r0[b])
            F2 = imbalance(contact, i, y, r, F)
            if before > F2 or length < MIN_NEWTON_FACTOR:
                break
            length *= 0.5
        for a in range(3):
            change[a] += length * step[a]
