"""Facets of meshes: shape functions, points on them, and points projected onto them.

A facet is a kind, which is its number of nodes (3, 4, 6, 8 or 9), and its nodes (9, 3) [m], of
which the first `kind` count: corners first, then the middles of the edges, then the centre, the
order of VTK and Abaqus. Local coordinates (a, b) are 0 <= a, b, a + b <= 1 on triangles and -1 to 1
on quadrilaterals.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.jit import exact_kernel, kernel

MAX_FACET_NODES = 9  # nodes of a facet
MAX_NEWTON_STEPS = 30
LOCAL_TOLERANCE = 1e-10  # last step in local coordinates, above round-off far from the origin
LOCAL_DIVERGENCE_LIMIT = 1e3  # local coordinates that nothing asks for
HOMOTOPY_STEPS = 16  # steps from the centre of a distorted facet
EDGE_ROUND_OFF = 1e-9  # of local coordinates: round-off on an edge is not outside
EDGE_OVERHANG = 0.01  # of local coordinates: where a point beside a facet is still on it
CURVED_RADIUS_FACTOR = 1.2  # a curved facet lies within this times the radius of its nodes


@exact_kernel
def shape(kind: int, a: float, b: float, N: np.ndarray) -> None:
    """Shape functions and their slopes by a and b at (a, b), into N (3, 9)."""
    if kind == 3 or kind == 6:
        _triangle(kind, 1.0 - a - b, a, b, N)
    elif kind == 9:
        _lagrange(a, b, N)
    else:
        _serendipity(kind, a, b, N)


@exact_kernel
def _triangle(kind: int, c: float, a: float, b: float, N: np.ndarray) -> None:
    """Triangles, with c = 1 - a - b."""
    if kind == 3:
        N[0, 0], N[1, 0], N[2, 0] = c, -1.0, -1.0
        N[0, 1], N[1, 1], N[2, 1] = a, 1.0, 0.0
        N[0, 2], N[1, 2], N[2, 2] = b, 0.0, 1.0
        return
    N[0, 0], N[1, 0], N[2, 0] = c * (2 * c - 1), 1 - 4 * c, 1 - 4 * c
    N[0, 1], N[1, 1], N[2, 1] = a * (2 * a - 1), 4 * a - 1, 0.0
    N[0, 2], N[1, 2], N[2, 2] = b * (2 * b - 1), 0.0, 4 * b - 1
    N[0, 3], N[1, 3], N[2, 3] = 4 * c * a, 4 * (c - a), -4 * a
    N[0, 4], N[1, 4], N[2, 4] = 4 * a * b, 4 * b, 4 * a
    N[0, 5], N[1, 5], N[2, 5] = 4 * b * c, -4 * b, 4 * (c - b)


CORNERS = np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]])


@exact_kernel
def _serendipity(kind: int, a: float, b: float, N: np.ndarray) -> None:
    """Quadrilaterals of 4 and 8 nodes."""
    for i in range(4):
        s, t = CORNERS[0, i], CORNERS[1, i]
        p, q = 1 + s * a, 1 + t * b
        if kind == 4:
            N[0, i], N[1, i], N[2, i] = 0.25 * p * q, 0.25 * s * q, 0.25 * t * p
        else:
            N[0, i] = 0.25 * p * q * (s * a + t * b - 1)
            N[1, i] = 0.25 * s * q * (2 * s * a + t * b)
            N[2, i] = 0.25 * t * p * (s * a + 2 * t * b)
    if kind == 4:
        return
    for i, t in ((4, -1.0), (6, 1.0)):
        q = 1 + t * b
        N[0, i], N[1, i], N[2, i] = 0.5 * (1 - a * a) * q, -a * q, 0.5 * t * (1 - a * a)
    for i, s in ((5, 1.0), (7, -1.0)):
        p = 1 + s * a
        N[0, i], N[1, i], N[2, i] = 0.5 * (1 - b * b) * p, 0.5 * s * (1 - b * b), -b * p


# place of each node of a quadrilateral on the lines -1, 0, 1 of a and b
NODE_LATTICE = np.array([[0, 2, 2, 0, 1, 2, 1, 0, 1], [0, 0, 2, 2, 0, 1, 2, 1, 1]])


@exact_kernel
def _line(i: int, a: float) -> tuple[float, float]:
    """Quadratic function of the node -1, 0 or 1 of a line, and its slope."""
    if i == 0:
        return 0.5 * a * (a - 1), a - 0.5
    if i == 1:
        return 1 - a * a, -2 * a
    return 0.5 * a * (a + 1), a + 0.5


@exact_kernel
def _lagrange(a: float, b: float, N: np.ndarray) -> None:
    """Quadrilateral of 9 nodes."""
    for i in range(9):
        p, dp = _line(NODE_LATTICE[0, i], a)
        q, dq = _line(NODE_LATTICE[1, i], b)
        N[0, i], N[1, i], N[2, i] = p * q, dp * q, p * dq


@exact_kernel
def place(kind: int, X: np.ndarray, a: float, b: float, N: np.ndarray, x: np.ndarray) -> None:
    """Position and tangents x (3, 3) [m] at (a, b) of the facet X, and `shape` into N."""
    shape(kind, a, b, N)
    for k in range(3):
        for j in range(3):
            total = 0.0
            for i in range(kind):
                total += N[k, i] * X[i, j]
            x[k, j] = total


@exact_kernel
def normal(x: np.ndarray, n: np.ndarray) -> float:
    """Unit normal n (3,) of tangents x[1] and x[2] by the right hand; returns area per da db."""
    n[0] = x[1, 1] * x[2, 2] - x[1, 2] * x[2, 1]
    n[1] = x[1, 2] * x[2, 0] - x[1, 0] * x[2, 2]
    n[2] = x[1, 0] * x[2, 1] - x[1, 1] * x[2, 0]
    area = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    for j in range(3):
        n[j] /= area
    return area


@exact_kernel
def across(n: np.ndarray, t: np.ndarray) -> None:
    """Two unit vectors t (2, 3) square to the unit vector n and to each other."""
    k = 0
    for j in range(1, 3):
        if abs(n[j]) < abs(n[k]):
            k = j
    size = np.sqrt(1 - n[k] * n[k])
    for j in range(3):
        t[0, j] = ((1.0 if j == k else 0.0) - n[k] * n[j]) / size
    t[1, 0] = n[1] * t[0, 2] - n[2] * t[0, 1]
    t[1, 1] = n[2] * t[0, 0] - n[0] * t[0, 2]
    t[1, 2] = n[0] * t[0, 1] - n[1] * t[0, 0]


@exact_kernel
def outside(kind: int, a: float, b: float) -> float:
    """How far (a, b) lies outside the facet, in local coordinates; negative inside."""
    if kind == 3 or kind == 6:
        return max(-a, -b, a + b - 1)
    return max(abs(a), abs(b)) - 1


@exact_kernel
def _settle(
    kind: int,
    X: np.ndarray,
    p: np.ndarray,
    t: np.ndarray,
    follow: bool,
    start: tuple[float, float],
    N: np.ndarray,
    x: np.ndarray,
) -> tuple[float, float, bool]:
    """(a, b, found) where the offset of p (3,) from the facet has no part along t (2, 3).

    With `follow`, t are the facet's tangents at the place, which is Gauss-Newton: the distance over
    the radius of curvature is what is left of the error after each step.
    """
    a, b = start
    for _ in range(MAX_NEWTON_STEPS):
        place(kind, X, a, b, N, x)
        if follow:
            for j in range(3):
                t[0, j], t[1, j] = x[1, j], x[2, j]
        r0 = r1 = j00 = j01 = j10 = j11 = 0.0
        for j in range(3):
            d = p[j] - x[0, j]
            r0 += t[0, j] * d
            r1 += t[1, j] * d
            j00 += t[0, j] * x[1, j]
            j01 += t[0, j] * x[2, j]
            j10 += t[1, j] * x[1, j]
            j11 += t[1, j] * x[2, j]
        det = j00 * j11 - j01 * j10
        da = (j11 * r0 - j01 * r1) / det
        db = (j00 * r1 - j10 * r0) / det
        a += da
        b += db
        if not abs(a) + abs(b) < LOCAL_DIVERGENCE_LIMIT:
            return a, b, False
        if abs(da) + abs(db) < LOCAL_TOLERANCE:
            place(kind, X, a, b, N, x)
            return a, b, True
    return a, b, False


@exact_kernel
def _approach(
    kind: int,
    X: np.ndarray,
    p: np.ndarray,
    t: np.ndarray,
    follow: bool,
    N: np.ndarray,
    x: np.ndarray,
) -> tuple[float, float, bool]:
    """`_settle` from the centre; of distorted facets by steps of p from there, while they settle.

    What is found then may be short of p, outside the facet: local coordinates turn back there.
    """
    centre = 1 / 3 if kind == 3 or kind == 6 else 0.0
    a, b, found = _settle(kind, X, p, t, follow, (centre, centre), N, x)
    if found:
        return a, b, True
    place(kind, X, centre, centre, N, x)
    c, q = np.zeros(3), np.zeros(3)
    for j in range(3):
        c[j] = x[0, j]
    a = b = centre
    for k in range(1, HOMOTOPY_STEPS + 1):
        for j in range(3):
            q[j] = c[j] + k / HOMOTOPY_STEPS * (p[j] - c[j])
        a_next, b_next, found = _settle(kind, X, q, t, follow, (a, b), N, x)
        if not found:
            break
        a, b = a_next, b_next
    place(kind, X, a, b, N, x)
    return a, b, found or outside(kind, a, b) > 0


@exact_kernel
def along_line(
    kind: int, X: np.ndarray, p: np.ndarray, t: np.ndarray, N: np.ndarray, x: np.ndarray
) -> tuple[float, float, bool]:
    """Where the line through p (3,) square to t (2, 3) meets the facet X: (a, b, found).

    The facet goes on beyond its edges. N and x are what `place` leaves there.
    """
    return _approach(kind, X, p, t, False, N, x)


@exact_kernel
def foot(
    kind: int, X: np.ndarray, p: np.ndarray, N: np.ndarray, x: np.ndarray
) -> tuple[float, float, bool]:
    """Foot on the facet X of the normal through p (3,): (a, b, found); N and x as above."""
    return _approach(kind, X, p, np.zeros((2, 3)), True, N, x)


@kernel
def shapes(kind: int, points: np.ndarray, N: np.ndarray) -> None:
    """Shape functions and slopes into N (n, 3, 9) at local coordinates points (n, 2)."""
    for i in range(len(points)):
        shape(kind, points[i, 0], points[i, 1], N[i])


@kernel
def project(
    points: np.ndarray,
    normals: np.ndarray,
    group: np.ndarray,
    start: np.ndarray,
    candidates: np.ndarray,
    kinds: np.ndarray,
    nodes: np.ndarray,
    centres: np.ndarray,
    radii: np.ndarray,
    search: float,
    facet: np.ndarray,
    same_way: np.ndarray,
    gap: np.ndarray,
    values: np.ndarray,
) -> None:
    """The nearest opposed facet along the normal of each point.

    Parameters
    ----------
    points, normals : ndarray (n, 3)
        Points [m] and the outward unit normals there.
    group : ndarray (n,) of int
        Point i looks among the facets candidates[start[group[i]] : start[group[i] + 1]].
    kinds, nodes, centres, radii : ndarray (m,), (m, 9, 3), (m, 3), (m,)
        The facets; all nodes of one lie within its radius of its centre [m].
    search : float
        Facets further than this to either side are not seen, m.
    facet : ndarray (n,) of int
        Result: number of the facet, -1 for none.
    same_way : ndarray (n,) of bool
        Result: a facet was met whose normal does not oppose the point's.
    gap : ndarray (n,)
        Result: distance along the normal, m; negative where the facet lies behind the point.
    values : ndarray (n, 9)
        Result: shape functions of the facet at the place.
    """
    N, x, n, t = np.zeros((3, MAX_FACET_NODES)), np.zeros((3, 3)), np.zeros(3), np.zeros((2, 3))
    for i in range(len(points)):
        facet[i] = -1
        same_way[i] = False
        gap[i] = np.inf
        across(normals[i], t)
        for m in candidates[start[group[i]] : start[group[i] + 1]]:
            off = height = 0.0
            for j in range(3):
                d = centres[m, j] - points[i, j]
                off += d * d
                height += d * normals[i, j]
            far = CURVED_RADIUS_FACTOR * radii[m]
            if off - height * height > far * far or abs(height) > search + far:
                continue
            a, b, found = along_line(kinds[m], nodes[m], points[i], t, N, x)
            if not found or outside(kinds[m], a, b) > EDGE_ROUND_OFF:
                continue
            g = facing = 0.0
            normal(x, n)
            for j in range(3):
                g += (x[0, j] - points[i, j]) * normals[i, j]
                facing += n[j] * normals[i, j]
            if abs(g) > search:
                continue
            if facing >= 0:
                same_way[i] = True
            elif abs(g) < abs(gap[i]):
                facet[i] = m
                gap[i] = g
                for k in range(MAX_FACET_NODES):
                    values[i, k] = N[0, k] if k < kinds[m] else 0.0


@kernel
def feet(
    points: np.ndarray,
    start: np.ndarray,
    candidates: np.ndarray,
    kinds: np.ndarray,
    nodes: np.ndarray,
    search: float,
    facet: np.ndarray,
    distance: np.ndarray,
    values: np.ndarray,
) -> None:
    """The nearest facet on which each point has a foot, at most EDGE_OVERHANG beyond its edges.

    Parameters
    ----------
    points : ndarray (n, 3)
        m.
    start, candidates : ndarray of int
        Point i looks among the facets candidates[start[i] : start[i + 1]].
    kinds, nodes : ndarray (m,), (m, 9, 3)
        The facets.
    search : float
        Greatest distance, m.
    facet : ndarray (n,) of int
        Result: number of the facet, -1 for none.
    distance : ndarray (n,)
        Result: of the foot, m.
    values : ndarray (n, 9)
        Result: shape functions of the facet at the foot.
    """
    N, x = np.zeros((3, MAX_FACET_NODES)), np.zeros((3, 3))
    for i in range(len(points)):
        facet[i] = -1
        distance[i] = np.inf
        best = np.inf
        for m in candidates[start[i] : start[i + 1]]:
            a, b, found = foot(kinds[m], nodes[m], points[i], N, x)
            beyond = max(outside(kinds[m], a, b), 0.0)
            if not found or beyond > EDGE_OVERHANG:
                continue
            off = 0.0
            for j in range(3):
                off += (x[0, j] - points[i, j]) ** 2
            off = np.sqrt(off)
            if off > search or off + beyond * search >= best:  # of two, that which it lies on
                continue
            best = off + beyond * search
            facet[i] = m
            distance[i] = off
            for k in range(MAX_FACET_NODES):
                values[i, k] = N[0, k] if k < kinds[m] else 0.0
