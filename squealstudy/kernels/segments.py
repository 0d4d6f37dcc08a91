"""Segments: the parts of a slave facet that each master facet covers, and integrals over them.

The outline of a master facet is cut to the neighbourhood of the slave facet, brought into the
slave's local coordinates along the slave's normals, and clipped there by the reference square or
triangle, which is convex even where edges are curved. The segment is integrated as a fan of
triangles with signs: exact whatever its shape, and doubled or collinear corners do no harm.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.facets import MAX_FACET_NODES, across, along_line, foot, normal, place
from squealstudy.kernels.jit import exact_kernel, kernel

N_SHAPE_TERMS = 9  # 1, a, b, ab, a2, b2, a2 b, a b2, a2 b2; the first six span what triangles need
SEARCH_BOX_MARGIN = 0.25  # neighbourhood of a slave facet beyond its nodes, as a share of its width
STRAIGHT_EDGE_BULGE_RATIO = 1e-10  # of its length: an edge that bulges less is straight
MIN_REL_TRIANGLE_AREA = 1e-15  # of the reference square: smaller triangles of a fan are nothing
# corners and half planes (u, v, w), u a + v b + w >= 0, of the reference square and triangle
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
TRIANGLE = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
SQUARE_SIDES = np.array([[0.0, 1.0, 1.0], [-1.0, 0.0, 1.0], [0.0, -1.0, 1.0], [1.0, 0.0, 1.0]])
TRIANGLE_SIDES = np.array([[0.0, 1.0, 0.0], [-1.0, -1.0, 1.0], [1.0, 0.0, 0.0]])


@exact_kernel
def clip(corners: np.ndarray, n: int, height: np.ndarray, out: np.ndarray) -> int:
    """The part of a polygon, corners (n, d), where the linear height (n,) is not negative.

    Sutherland and Hodgman. Returns the number of corners written to `out`, or -1 where it is full.
    """
    m = 0
    for i in range(n):
        k = i + 1 if i + 1 < n else 0
        if m + 2 > len(out):
            return -1
        if height[i] >= 0:
            for j in range(corners.shape[1]):
                out[m, j] = corners[i, j]
            m += 1
        if (height[i] > 0 > height[k]) or (height[i] < 0 < height[k]):
            share = height[i] / (height[i] - height[k])
            for j in range(corners.shape[1]):
                out[m, j] = corners[i, j] + share * (corners[k, j] - corners[i, j])
            m += 1
    return m


@exact_kernel
def cut(corners: np.ndarray, n: int, height: np.ndarray, other: np.ndarray) -> int:
    """Clip a polygon (n, d) in place, see `clip`; returns n. Less than a triangle is not kept."""
    inside = True
    for c in range(n):
        inside &= height[c] >= 0
    if inside:
        return n
    n = clip(corners, n, height, other)
    for c in range(n if n >= 3 else 0):
        for j in range(corners.shape[1]):
            corners[c, j] = other[c, j]
    return n


@exact_kernel
def outline(
    kind: int, X: np.ndarray, pieces: int, size: float, N: np.ndarray, out: np.ndarray
) -> int:
    """Corners of a facet with chords on each curved edge, (n, 3); returns n.

    An edge has `pieces` of them, or as many a length of `size` [m] where it is longer.
    """
    sides = 3 if kind == 3 or kind == 6 else 4
    x, m = np.zeros((3, 3)), 0
    for i in range(sides):
        k = (i + 1) % sides
        parts = 1
        if kind > 4:
            bulge = length = 0.0
            for j in range(3):
                bulge += (X[sides + i, j] - 0.5 * (X[i, j] + X[k, j])) ** 2
                length += (X[k, j] - X[i, j]) ** 2
            if bulge > STRAIGHT_EDGE_BULGE_RATIO**2 * length:
                times = int(np.ceil(np.sqrt(length) / size))
                parts = min(pieces * max(times, 1), len(out) // 8)
        for part in range(parts):
            s = part / parts
            if part == 0:
                for j in range(3):
                    out[m, j] = X[i, j]
            else:
                corners = TRIANGLE if sides == 3 else SQUARE
                a = corners[i, 0] + s * (corners[k, 0] - corners[i, 0])
                b = corners[i, 1] + s * (corners[k, 1] - corners[i, 1])
                place(kind, X, a, b, N, x)
                for j in range(3):
                    out[m, j] = x[0, j]
            m += 1
    return m


@exact_kernel
def has_straight_sides(kind: int, X: np.ndarray, n: np.ndarray) -> bool:
    """Whether a facet lies in the plane of normal n (3,) with middles of sides halfway."""
    sides = 3 if kind == 3 or kind == 6 else 4
    for i in range(sides):
        k = (i + 1) % sides
        height = bulge = length = 0.0
        for j in range(3):
            height += n[j] * (X[k, j] - X[i, j])
            length += (X[k, j] - X[i, j]) ** 2
            if kind > 4:
                bulge += (X[sides + i, j] - 0.5 * (X[i, j] + X[k, j])) ** 2
        if max(height * height, bulge) > STRAIGHT_EDGE_BULGE_RATIO**2 * length:
            return False
    return True


@exact_kernel
def cross(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    """The vector product of a and b (3,)."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@exact_kernel
def rise(direction: np.ndarray, point: np.ndarray, base: np.ndarray) -> float:
    """How far a point (3,) lies from the base along a direction, times its length."""
    total = 0.0
    for j in range(3):
        total += direction[j] * (point[j] - base[j])
    return total


@exact_kernel
def near(
    kind: int,
    X: np.ndarray,
    corners: np.ndarray,
    n: int,
    N: np.ndarray,
    other: np.ndarray,
    height: np.ndarray,
) -> int:
    """Cut the polygon (n, 3) to the neighbourhood of the facet X, in place; returns n.

    Further off, the facet's local coordinates may turn back. A plane facet with straight sides is
    its own neighbourhood.
    """
    x, out, along, inward = np.zeros((3, 3)), np.zeros(3), np.zeros(3), np.zeros(3)
    three = kind == 3 or kind == 6
    sides = 3 if three else 4
    centre = 1 / 3 if three else 0.0
    place(kind, X, centre, centre, N, x)
    normal(x, out)
    straight = has_straight_sides(kind, X, out)
    for i in range(sides):
        k = (i + 1) % sides
        for j in range(3):
            along[j] = X[k, j] - X[i, j]
        cross(out, along, inward)
        low = high = 0.0  # of the nodes over the straight side
        for c in range(kind):
            h = rise(inward, X[c], X[i])
            low, high = min(low, h), max(high, h)
        if not straight:
            low -= SEARCH_BOX_MARGIN * (high - low)
        for c in range(n):
            height[c] = rise(inward, corners[c], X[i]) - low
        n = cut(corners, n, height, other)
        if n < 3:
            break
    return n


@exact_kernel
def diameter(kind: int, X: np.ndarray) -> float:
    """Greatest distance of a node from the first, m."""
    most = 0.0
    for i in range(1, kind):
        square = 0.0
        for j in range(3):
            square += (X[i, j] - X[0, j]) ** 2
        most = max(most, square)
    return np.sqrt(most)


@exact_kernel
def is_affine(kind: int, X: np.ndarray) -> bool:
    """Whether local coordinates are linear: a parallelogram or triangle with straight edges."""
    three = kind == 3 or kind == 6
    sides = 3 if three else 4
    for j in range(3):
        size = 0.0
        for i in range(sides):
            size = max(size, abs(X[i, j] - X[0, j]))
        size *= STRAIGHT_EDGE_BULGE_RATIO
        if not three and abs(X[0, j] - X[1, j] + X[2, j] - X[3, j]) > size:
            return False
        if kind > 4:
            for i in range(sides):
                middle = 0.5 * (X[i, j] + X[(i + 1) % sides, j])
                if abs(X[sides + i, j] - middle) > size:
                    return False
        if kind == 9 and abs(X[8, j] - 0.5 * (X[0, j] + X[2, j])) > size:
            return False
    return True


@exact_kernel
def local_polygon(
    kind: int,
    X: np.ndarray,
    corners: np.ndarray,
    n: int,
    longest: float,
    N: np.ndarray,
    x: np.ndarray,
    out: np.ndarray,
) -> int:
    """Local coordinates `out` on the facet X of a polygon (n, 3), -1 where they are not found.

    Edges longer than `longest` [m] are divided: their images are curved.
    """
    m = 0
    p = np.zeros(3)
    for i in range(n):
        k = i + 1 if i + 1 < n else 0
        length = 0.0
        for j in range(3):
            length += (corners[k, j] - corners[i, j]) ** 2
        parts = int(np.ceil(np.sqrt(length) / longest - 1e-9))
        for part in range(max(parts, 1)):
            if m == len(out):
                return -1
            s = part / parts if part else 0.0
            for j in range(3):
                p[j] = corners[i, j] + s * (corners[k, j] - corners[i, j])
            a, b, found = foot(kind, X, p, N, x)
            if not found:
                return -1
            out[m, 0], out[m, 1] = a, b
            m += 1
    return m


@exact_kernel
def within(three: bool, corners: np.ndarray, n: int, other: np.ndarray, height: np.ndarray) -> int:
    """Clip a polygon (n, 2) by the reference triangle or square, in place; returns n."""
    sides = TRIANGLE_SIDES if three else SQUARE_SIDES
    for side in sides:
        for c in range(n):
            height[c] = side[0] * corners[c, 0] + side[1] * corners[c, 1] + side[2]
        n = cut(corners, n, height, other)
        if n < 3:
            break
    return n


@exact_kernel
def signed_area(corners: np.ndarray, n: int) -> float:
    """Of a polygon (n, 2), positive where it turns counterclockwise."""
    total = 0.0
    for i in range(1, n - 1):
        total += (corners[i, 0] - corners[0, 0]) * (corners[i + 1, 1] - corners[0, 1]) - (
            corners[i + 1, 0] - corners[0, 0]
        ) * (corners[i, 1] - corners[0, 1])
    return 0.5 * total


@kernel
def integrate_segments(
    slave_kinds: np.ndarray,
    slave_nodes: np.ndarray,
    master_kinds: np.ndarray,
    master_nodes: np.ndarray,
    start: np.ndarray,
    candidates: np.ndarray,
    places: np.ndarray,
    weights: np.ndarray,
    pieces: int,
    search: float,
    area: np.ndarray,
    slave: np.ndarray,
    master: np.ndarray,
    gap: np.ndarray,
    normals: np.ndarray,
    left_out: np.ndarray,
) -> int:
    """Integrals of the terms 1, a, b, ... times shape functions over all segments.

    Parameters
    ----------
    slave_kinds, slave_nodes : ndarray (m,), (m, 9, 3)
        Slave facets; slave i is compared with candidates[start[i] : start[i + 1]].
    master_kinds, master_nodes : ndarray
        All master facets.
    places, weights : ndarray (q, 2), (q,)
        Quadrature on the reference triangle.
    pieces : int
        Chords on a curved edge.
    search : float
        Places further apart than this along the slave's normal are left out, m.
    area, slave, gap, normals : ndarray (m, 9), (m, 9, 9), (m, 9), (m, 9, 3)
        Results: integrals of the terms, of the terms times the slave's shape functions, the gap,
        the slave's normal.
    master : ndarray (len(candidates), 9, 9)
        Result: integrals of the terms times the master's shape functions.
    left_out : ndarray (m, 2)
        Result, areas [m2]: further apart than `search`; of masters whose normals do not oppose.

    Returns
    -------
    int
        -1, or a slave facet on which the places of a polygon are not found: it is folded.
    """
    room = 128 * max(pieces, 4)
    corners, other = np.zeros((room, 3)), np.zeros((room, 3))
    flat, flat_other, height = np.zeros((room, 2)), np.zeros((room, 2)), np.zeros(room)
    N, N_m, x, x_m = (
        np.zeros((3, MAX_FACET_NODES)),
        np.zeros((3, MAX_FACET_NODES)),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
    )
    n_s, terms = np.zeros(3), np.zeros(N_SHAPE_TERMS)
    for s in range(len(slave_kinds)):
        kind, X = slave_kinds[s], slave_nodes[s]
        three = kind == 3 or kind == 6
        size = diameter(kind, X)
        longest = np.inf if is_affine(kind, X) else size / pieces
        for c in range(start[s], start[s + 1]):
            m = candidates[c]
            n = outline(master_kinds[m], master_nodes[m], pieces, size, N, corners)
            n = near(kind, X, corners, n, N, other, height)
            if 0 <= n < 3:
                continue
            if n > 0:
                n = local_polygon(kind, X, corners, n, longest, N, x, flat)
            if n > 0:
                n = within(three, flat, n, flat_other, height)
            if n < 0:
                return s
            if n < 3:
                continue
            sign = -1.0 if signed_area(flat, n) < 0 else 1.0
            for i in range(1, n - 1):
                u0, u1 = flat[i, 0] - flat[0, 0], flat[i, 1] - flat[0, 1]
                v0, v1 = flat[i + 1, 0] - flat[0, 0], flat[i + 1, 1] - flat[0, 1]
                double = sign * (u0 * v1 - u1 * v0)
                if abs(double) < MIN_REL_TRIANGLE_AREA:
                    continue
                for q in range(len(weights)):
                    a = flat[0, 0] + places[q, 0] * u0 + places[q, 1] * v0
                    b = flat[0, 1] + places[q, 0] * u1 + places[q, 1] * v1
                    place(kind, X, a, b, N, x)
                    w = normal(x, n_s) * double * weights[q]
                    if sign > 0:
                        left_out[s, 1] += w
                        continue
                    g = _opposite(master_kinds[m], master_nodes[m], x[0], n_s, N_m, x_m)
                    if not abs(g) <= search:
                        left_out[s, 0] += w
                        continue
                    _terms(a, b, terms)
                    for t in range(N_SHAPE_TERMS):
                        f = w * terms[t]
                        area[s, t] += f
                        gap[s, t] += f * g
                        for j in range(3):
                            normals[s, t, j] += f * n_s[j]
                        for k in range(kind):
                            slave[s, t, k] += f * N[0, k]
                        for k in range(master_kinds[m]):
                            master[c, t, k] += f * N_m[0, k]
    return -1


@exact_kernel
def _opposite(
    kind: int, X: np.ndarray, p: np.ndarray, n: np.ndarray, N: np.ndarray, x: np.ndarray
) -> float:
    """Gap [m] from p along n to the facet X, whose functions are left in N; infinite for none."""
    t = np.zeros((2, 3))
    across(n, t)
    _, _, found = along_line(kind, X, p, t, N, x)
    if not found:
        return np.inf
    g = 0.0
    for j in range(3):
        g += (x[0, j] - p[j]) * n[j]
    return g


@exact_kernel
def _terms(a: float, b: float, out: np.ndarray) -> None:
    """1, a, b, ab, a2, b2, a2 b, a b2, a2 b2."""
    out[0], out[1], out[2], out[3] = 1.0, a, b, a * b
    out[4], out[5], out[6], out[7], out[8] = a * a, b * b, a * a * b, a * b * b, a * a * b * b
