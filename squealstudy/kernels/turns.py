"""Friction that turns between two samples of a period: what the cell between them gives to means.

Sampled friction is a staircase in the motion where a point that sticks passes from one bound to
the other within a sample: the share of such a cell is integrated instead, and given to its samples.

Between the samples a cubic (Catmull & Rom 1974) leads through them. About the time of least sliding
the integral goes by tau - tau_0 = eps sinh(xi), which makes w / |w| as smooth as tanh (Johnston &
Elliott 2005), in pieces that end where the point begins and ceases to stick, by Gauss's rule.
Derivatives are those at nodes that do not move with the motion.
"""

from __future__ import annotations

import math

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import entry_kernel, fast_kernel, room_kernel
from squealstudy.kernels.laws import contact_at
from squealstudy.kernels.newmark_forces import point_forces, tangents
from squealstudy.kernels.spring_points import coefficient_of, typical_mu

GAUSS_POINTS_AND_WEIGHTS = np.polynomial.legendre.leggauss(3)
NODES, WEIGHTS = 0.5 * (GAUSS_POINTS_AND_WEIGHTS[0] + 1.0), 0.5 * GAUSS_POINTS_AND_WEIGHTS[1]
# 1 - cosine of the turn of sliding within a cell: integrated from, to
TURN_MIN, TURN_FULL = 0.06, 0.2
MIN_SINH_WIDTH = 1e-3  # least eps
N_NEWTON_STEPS = 3  # Newton steps to the time of least sliding

Sums = tuple[np.ndarray, np.ndarray, np.ndarray]  # forces, their derivatives by y and by w


@entry_kernel
def resolve_turns(
    points: np.ndarray, law: np.ndarray, y: np.ndarray, w: np.ndarray, sums: Sums
) -> None:
    """Give forces at even samples of a whole period, and derivatives, the shares of their cells.

    Arguments are those of `harmonic_balance.sampled_forces`, which has filled the last three
    (`sums`).
    """
    f, by_y, by_w = sums
    S, nc = y.shape[0], points.shape[1]
    point, share, nodes = np.zeros((at.N_POINT, nc)), np.zeros(S), np.zeros((3 * len(NODES), 2))
    turned, slowest = _turned(points, w)
    for i in range(nc):
        if points[at.POINT_FRICTION, i] == 0.0:
            continue
        any_turn, fastest = False, _fastest_stick(points, law, y, i)
        # a cell's chord is no nearer to rest than its slower end times the cosine of its turn
        if not turned[i] and (1.0 - TURN_MIN) ** 2 * slowest[i] > fastest * fastest:
            continue
        for s in range(S):
            share[s] = _turning(points, law, y, w, s, (s + 1) % S, i, fastest)
            any_turn = any_turn or share[s] > 0.0
        if not any_turn:
            continue
        for s in range(S):
            # a cell's share in the sum is that of the cubic through four samples
            left = 1.0 + (share[s - 2] + share[(s + 1) % S]) / 24.0
            left -= 13.0 / 24.0 * (share[s - 1] + share[s])
            if left != 1.0:
                for c in range(3):
                    f[s, i, c] *= left
                    for k in range(3):
                        by_y[s, i, c, k] *= left
                        by_w[s, i, c, k] *= left
        for s in range(S):
            if share[s] > 0.0:
                for m in range(_nodes(points, law, y, w, s, i, nodes)):
                    tau, weight = nodes[m, 0], share[s] * nodes[m, 1]
                    _add(points, law, y, w, (s, i), (tau, weight), point, sums)


@room_kernel
def _turned(points: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether sliding turns by more than `TURN_MIN` in a cell; least squares of speeds."""
    S, nc = w.shape[:2]
    turned, slowest = np.zeros(nc, np.bool_), np.full(nc, np.inf)
    least = (1.0 - TURN_MIN) ** 2
    for i in range(nc):
        speed = points[at.POINT_SPEED, i]
        a1, a2 = w[S - 1, i, 1] + speed, w[S - 1, i, 2]
        a = a1 * a1 + a2 * a2
        for s in range(S):
            b1, b2 = w[s, i, 1] + speed, w[s, i, 2]
            b, inner = b1 * b1 + b2 * b2, a1 * b1 + a2 * b2
            turned[i] |= not (inner > 0.0 and inner * inner >= least * a * b)
            slowest[i] = min(slowest[i], b)
            a1, a2, a = b1, b2, b
    return turned, slowest


@fast_kernel
def _bound_speed(points: np.ndarray, law: np.ndarray, x: float, s: float, i: int) -> float:
    """Sliding speed at which friction reaches its bound, m/s."""
    p, _ = contact_at(law, points[at.POINT_GAP, i] + x)
    mu, _, _ = coefficient_of(law, points, i, s, p)
    return max(points[at.POINT_FRICTION, i] * mu * p, 0.0) / law[at.LAW_SLOPE]


@fast_kernel
def _fastest_stick(points: np.ndarray, law: np.ndarray, y: np.ndarray, i: int) -> float:
    """Speed that `_bound_speed` stays below in a period, m/s: where the contact is closest.

    Twice that with the friction of rest, for friction that rises from there.
    """
    closest = y[0, i, 0]
    for s in range(y.shape[0]):
        closest = min(closest, y[s, i, 0])
    p, _ = contact_at(law, points[at.POINT_GAP, i] + closest)
    mu, _, _ = coefficient_of(law, points, i, 0.0, p)
    mu = max(mu, typical_mu(law, points, i))
    return 2.0 * max(points[at.POINT_FRICTION, i] * mu * p, 0.0) / law[at.LAW_SLOPE]


@fast_kernel
def _turning(
    points: np.ndarray,
    law: np.ndarray,
    y: np.ndarray,
    w: np.ndarray,
    s: int,
    t: int,
    i: int,
    fastest: float,
) -> float:
    """How far the cell between samples s and t is integrated, 0 to 1.

    `fastest` is a sliding speed at which no point sticks.
    """
    a1, a2 = w[s, i, 1] + points[at.POINT_SPEED, i], w[s, i, 2]
    b1, b2 = w[t, i, 1] + points[at.POINT_SPEED, i], w[t, i, 2]
    a, b, inner = a1 * a1 + a2 * a2, b1 * b1 + b2 * b2, a1 * b1 + a2 * b2
    turn = 1.0 - inner / math.sqrt(a * b) if a * b > 0.0 else 2.0
    part = min(max((turn - TURN_MIN) / (TURN_FULL - TURN_MIN), 0.0), 1.0)
    if part < 1.0:
        e1, e2 = b1 - a1, b2 - a2
        e = e1 * e1 + e2 * e2
        tau = min(max((a - inner) / e, 0.0), 1.0) if e > 0.0 else 0.5
        d = math.sqrt((a1 + tau * e1) ** 2 + (a2 + tau * e2) ** 2)
        if d < fastest:
            x = y[s, i, 0] + tau * (y[t, i, 0] - y[s, i, 0])
            v = _bound_speed(points, law, x, d, i)
            if d < v < math.sqrt(max(a, b)):
                return 1.0
    return part * part * (3.0 - 2.0 * part)


@fast_kernel
def _cubic(tau: float) -> tuple[float, float, float, float]:
    """Weights of the samples s - 1 to s + 2 at a share tau of the cell behind s."""
    t2, t3 = tau * tau, tau * tau * tau
    return (
        0.5 * (2.0 * t2 - tau - t3),
        0.5 * (2.0 - 5.0 * t2 + 3.0 * t3),
        0.5 * (tau + 4.0 * t2 - 3.0 * t3),
        0.5 * (t3 - t2),
    )


@fast_kernel
def _slope(tau: float) -> tuple[float, float, float, float]:
    """Their derivatives."""
    t2 = tau * tau
    return (
        0.5 * (4.0 * tau - 1.0 - 3.0 * t2),
        0.5 * (9.0 * t2 - 10.0 * tau),
        0.5 * (1.0 + 8.0 * tau - 9.0 * t2),
        0.5 * (3.0 * t2 - 2.0 * tau),
    )


@fast_kernel
def _mixed(z: np.ndarray, s: int, i: int, c: int, h: tuple[float, float, float, float]) -> float:
    """Samples s - 1 to s + 2 with weights."""
    S = z.shape[0]
    value: float = h[0] * z[s - 1, i, c] + h[1] * z[s, i, c]
    value += h[2] * z[(s + 1) % S, i, c] + h[3] * z[(s + 2) % S, i, c]
    return value


@fast_kernel
def _nodes(
    points: np.ndarray,
    law: np.ndarray,
    y: np.ndarray,
    w: np.ndarray,
    s: int,
    i: int,
    nodes: np.ndarray,
) -> int:
    """Nodes tau and weights, rows of `nodes`, of the integral over the cell behind s; how many."""
    speed = points[at.POINT_SPEED, i]
    S = w.shape[0]
    t = (s + 1) % S
    a1, a2 = w[s, i, 1] + speed, w[s, i, 2]
    g1, g2 = w[t, i, 1] - w[s, i, 1], w[t, i, 2] - w[s, i, 2]
    e = g1 * g1 + g2 * g2
    tau = -(a1 * g1 + a2 * g2) / e if e > 0.0 else 0.5
    for _ in range(N_NEWTON_STEPS):
        tau = min(max(tau, 0.0), 1.0)
        h, dh = _cubic(tau), _slope(tau)
        a1, a2 = _mixed(w, s, i, 1, h) + speed, _mixed(w, s, i, 2, h)
        g1, g2 = _mixed(w, s, i, 1, dh), _mixed(w, s, i, 2, dh)
        e = g1 * g1 + g2 * g2
        centre = tau - (a1 * g1 + a2 * g2) / e if e > 0.0 else 0.5
        tau, last = centre, tau
    # a straight way through the place at `last`
    rate = max(math.sqrt(e), 1e-300)
    d = abs(a1 * g2 - a2 * g1) / rate
    x = _mixed(y, s, i, 0, _cubic(last))
    v = _bound_speed(points, law, x, math.sqrt(a1 * a1 + a2 * a2), i)
    delta = min(math.sqrt(max(v * v - d * d, 0.0)) / rate, 1e3)
    eps = min(max(max(d, v) / rate, MIN_SINH_WIDTH), 1.0)
    tau = centre
    count = 0
    for piece in range(3):
        low = 0.0 if piece == 0 else tau + (delta if piece == 2 else -delta)
        high = 1.0 if piece == 2 else tau + (delta if piece == 1 else -delta)
        low, high = min(max(low, 0.0), 1.0), min(max(high, 0.0), 1.0)
        if high <= low:
            continue
        begin, end = math.asinh((low - tau) / eps), math.asinh((high - tau) / eps)
        total = 0.0
        for m in range(len(NODES)):
            xi = begin + NODES[m] * (end - begin)
            nodes[count + m, 0] = tau + eps * math.sinh(xi)
            nodes[count + m, 1] = WEIGHTS[m] * math.cosh(xi)
            total += nodes[count + m, 1]
        for m in range(len(NODES)):  # a constant is integrated exactly
            nodes[count + m, 1] *= (high - low) / total
        count += len(NODES)
    return count


@fast_kernel
def _add(
    points: np.ndarray,
    law: np.ndarray,
    y: np.ndarray,
    w: np.ndarray,
    place: tuple[int, int],
    node: tuple[float, float],
    point: np.ndarray,
    sums: Sums,
) -> None:
    """Forces at a node of a cell and point, and their derivatives, to the samples about it."""
    (s, i), (tau, weight) = place, node
    S, h = w.shape[0], _cubic(tau)
    point[at.OUT_X, i] = _mixed(y, s, i, 0, h)
    point[at.OUT_W1, i], point[at.OUT_W2, i] = _mixed(w, s, i, 1, h), _mixed(w, s, i, 2, h)
    point_forces(points, law, point, i, i + 1)
    kn, k1, k2, d11, d12, d22 = tangents(law, points, point, i)
    f, by_y, by_w = sums
    for k in range(4):
        r, share = (s - 1 + k) % S, weight * h[k]
        for c in range(3):
            f[r, i, c] += share * point[at.R_N + c, i]
        by_y[r, i, 0, 0] += share * kn
        by_y[r, i, 1, 0] += share * k1
        by_y[r, i, 2, 0] += share * k2
        by_w[r, i, 1, 1] += share * d11
        by_w[r, i, 2, 2] += share * d22
        by_w[r, i, 1, 2] += share * d12
        by_w[r, i, 2, 1] += share * d12
