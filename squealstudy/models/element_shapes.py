"""Solid elements: nodes in the order of Abaqus, CalculiX and VTK, shape functions, faces.

Shape functions are those of scikit-fem where it has them, in another order of the nodes. Reference
coordinates are those of scikit-fem: the unit cube, the unit tetrahedron and the unit wedge. The
reference pyramid is the part of the unit cube with x and y up to 1 - z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

Faces = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Shape:
    """An element: its nodes, corners first, and its faces.

    Attributes
    ----------
    name : str
        tet4, tet10, pyramid5, pyramid13, wedge6, wedge15, hex8 or hex20.
    places : ndarray (k, 3)
        Reference coordinates of the nodes.
    faces : tuple of tuple of int
        Nodes of each face, S1 first: corners counterclockwise as seen from outside, then the
        middle nodes of the sides corner 1 to 2, 2 to 3, ..., last to 1.
    """

    name: str
    places: np.ndarray
    faces: Faces

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return len(self.places)

    def is_corner(self, node: int) -> bool:
        """Whether a node is a corner, not the middle of an edge."""
        return bool((self.places[node] % 1 == 0).all())

    @property
    def edges(self) -> set[tuple[int, int]]:
        """Pairs of corners with an edge between them, the smaller number first."""
        corner_pairs = set()
        for face in self.faces:
            corners = [i for i in face if self.is_corner(i)]
            ends = zip(corners, [*corners[1:], corners[0]], strict=True)
            corner_pairs |= {(min(a, b), max(a, b)) for a, b in ends}
        return corner_pairs

    @cached_property
    def ends(self) -> dict[int, tuple[int, int]]:
        """The two corners of each middle node's edge."""
        return {
            int(k): (a, b)
            for a, b in sorted(self.edges)
            for k in np.flatnonzero(
                np.isclose(self.places, self.places[[a, b]].mean(axis=0)).all(axis=1)
            )
        }

    def functions(self, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Shape functions (q, k) and derivatives (q, k, 3) at reference coordinates X (q, 3)."""
        if self.name in OWN_SHAPES:
            return OWN_SHAPES[self.name](X)
        element, order = _of_library(self.name)
        values = [element.lbasis(X.T, i) for i in order]
        N = np.column_stack([np.broadcast_to(v, len(X)) for v, _ in values])
        dN = np.stack(
            [np.stack([np.broadcast_to(c, len(X)) for c in d], axis=1) for _, d in values], axis=1
        )
        return N, dN


@cache
def _of_library(name: str) -> tuple[Any, tuple[int, ...]]:
    """The element of scikit-fem, and which of its functions belongs to each of our nodes."""
    from skfem import element as library  # heavy: only what assembles needs it

    kinds = {
        "tet4": library.ElementTetP1,
        "tet10": library.ElementTetP2,
        "wedge6": library.ElementWedge1,
        "hex8": library.ElementHex1,
        "hex20": library.ElementHexS2,
    }
    element = kinds[name]()
    distances = np.abs(SHAPES[name].places[:, None] - element.doflocs[None]).max(axis=2)
    order = distances.argmin(axis=1)
    assert distances.min(axis=1).max() == 0.0
    assert len(set(order)) == len(order)
    return element, tuple(int(i) for i in order)


def _wedge15(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Serendipity functions of the 15-node wedge, and their slopes.

    With area coordinates L and z from -1 to 1: corners L (2 L - 1) (1 -+ z) / 2 - L (1 - z^2) / 2,
    middles of the triangles 2 L_i L_j (1 -+ z), of the upright edges L (1 - z^2). Zienkiewicz,
    Taylor, Zhu, The Finite Element Method (7th ed., 2013), section 6.3.
    """
    x, y, z = X[:, 0], X[:, 1], 2 * X[:, 2] - 1
    L = np.stack([1 - x - y, x, y])
    dL = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    N, dN = np.empty((len(X), 15)), np.empty((len(X), 15, 3))
    for side, sign in enumerate((-1.0, 1.0)):
        h = 1 + sign * z
        for i in range(3):
            corner, middle, j = 3 * side + i, 6 + 3 * side + i, (i + 1) % 3
            N[:, corner] = 0.5 * L[i] * ((2 * L[i] - 1) * h - (1 - z**2))
            slope = 0.5 * ((4 * L[i] - 1) * h - (1 - z**2))
            dN[:, corner, :2] = slope[:, None] * dL[i]
            dN[:, corner, 2] = L[i] * ((2 * L[i] - 1) * sign + 2 * z)
            N[:, middle] = 2 * L[i] * L[j] * h
            dN[:, middle, :2] = 2 * h[:, None] * (L[j][:, None] * dL[i] + L[i][:, None] * dL[j])
            dN[:, middle, 2] = 4 * L[i] * L[j] * sign
    for i in range(3):
        N[:, 12 + i] = L[i] * (1 - z**2)
        dN[:, 12 + i, :2] = (1 - z**2)[:, None] * dL[i]
        dN[:, 12 + i, 2] = -4 * L[i] * z
    return N, dN


NEAR_APEX = 1e-30  # least 1 - z, so that x / (1 - z) is defined at the apex


def _pyramid5(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions of the 5-node pyramid and derivatives: a brick with a top of one point.

    With w = 1 - z, those of the base are w times the bilinear functions of x / w and y / w, that of
    the apex is z.
    """
    w = np.maximum(1 - X[:, 2], NEAR_APEX)
    x, y = np.clip(X[:, 0] / w, 0, 1), np.clip(X[:, 1] / w, 0, 1)
    N, dN = np.zeros((len(X), 5)), np.zeros((len(X), 5, 3))
    for node, (i, j) in enumerate(_SQUARE):
        P, dP = _bilinear(x, y, i, j)
        N[:, node] = w * P
        dN[:, node] = dP
    N[:, 4], dN[:, 4, 2] = X[:, 2], 1.0
    return N, dN


_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))


def _bilinear(x: np.ndarray, y: np.ndarray, i: int, j: int) -> tuple[np.ndarray, np.ndarray]:
    """Bilinear function P of a corner at x / w, y / w, and the derivatives (q, 3) of w P."""
    f, df = (x, 1.0) if i else (1 - x, -1.0)
    g, dg = (y, 1.0) if j else (1 - y, -1.0)
    P = f * g
    along = -P + x * df * g + y * f * dg  # d(w P)/dz = -P + (x P_x + y P_y)
    return P, np.stack([df * g, f * dg, along], axis=1)


def _pyramid13(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Functions of the 13-node pyramid, and their slopes (Bedrosian 1992, IJNME 35).

    With w, P_i of `_pyramid5` and the base's coordinates from -w to w, r and s: corners
    w P_i (r_i r + s_i s - 1), middles of the base 4 w P times the other factor along the side, of
    the upright edges 4 z w P_i, the apex z (2 z - 1).
    """
    N5, d5 = _pyramid5(X)
    z = X[:, 2]
    w = np.maximum(1 - z, NEAR_APEX)
    x, y = np.clip(X[:, 0] / w, 0, 1), np.clip(X[:, 1] / w, 0, 1)
    N, dN = np.zeros((len(X), 13)), np.zeros((len(X), 13, 3))
    r, s = 2 * X[:, 0] - w, 2 * X[:, 1] - w
    for node, (i, j) in enumerate(_SQUARE):
        a, b = 2 * i - 1, 2 * j - 1
        factor = a * r + b * s - 1
        N[:, node] = N5[:, node] * factor
        slope = np.array([2 * a, 2 * b, a + b])  # of the factor
        dN[:, node] = d5[:, node] * factor[:, None] + N5[:, node, None] * slope
        up = 9 + node
        N[:, up] = 4 * z * N5[:, node]
        dN[:, up] = 4 * z[:, None] * d5[:, node]
        dN[:, up, 2] += 4 * N5[:, node]
    for side, (along, other, far) in enumerate(((x, y, 0), (y, x, 1), (x, y, 1), (y, x, 0))):
        g, dg = (other, 1.0) if far else (1 - other, -1.0)
        bubble, slope = along * (1 - along), 1 - 2 * along  # 4 w^2 t (1 - t) g
        by_along, by_other = 4 * w * slope * g, 4 * w * bubble * dg
        middle, first = 5 + side, 0 if along is x else 1
        N[:, middle] = 4 * w**2 * bubble * g
        dN[:, middle, first], dN[:, middle, 1 - first] = by_along, by_other
        dN[:, middle, 2] = along * by_along + other * by_other - 8 * w * bubble * g
    N[:, 4], dN[:, 4, 2] = z * (2 * z - 1), 4 * z - 1
    return N, dN


# shape functions that scikit-fem does not have
OWN_SHAPES = {
    "pyramid5": _pyramid5,
    "pyramid13": _pyramid13,
    "wedge15": _wedge15,
}


def _node_places(corners: list[tuple[int, int, int]], edges: list[tuple[int, int]]) -> np.ndarray:
    """Corners, then the middles of edges between them."""
    c = np.array(corners, dtype=float)
    return np.vstack([c, *((c[i] + c[j])[None] / 2 for i, j in edges)])


def _faces(corners: list[tuple[int, ...]], n: int, edges: list[tuple[int, int]]) -> Faces:
    """Nodes of the faces: their corners, then middle nodes, which are numbered from n by edge."""
    middle = {frozenset(edge): n + k for k, edge in enumerate(edges)}
    return tuple(
        (
            *face,
            *(middle[frozenset((a, b))] for a, b in zip(face, (*face[1:], face[0]), strict=True)),
        )
        if edges
        else face
        for face in corners
    )


_TET = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
_TET_EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
_TET_FACES: list[tuple[int, ...]] = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
_PYRAMID = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)]
_PYRAMID_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)]
_PYRAMID_FACES: list[tuple[int, ...]] = [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
_WEDGE = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)]
_WEDGE_EDGES = [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)]
_WEDGE_FACES = [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)]
_HEX = [
    (0, 0, 0),
    (1, 0, 0),
    (1, 1, 0),
    (0, 1, 0),
    (0, 0, 1),
    (1, 0, 1),
    (1, 1, 1),
    (0, 1, 1),
]
_HEX_EDGES = [
    *((0, 1), (1, 2), (2, 3), (3, 0)),
    *((4, 5), (5, 6), (6, 7), (7, 4)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
]
_HEX_FACES: list[tuple[int, ...]] = [
    (0, 3, 2, 1),
    (4, 5, 6, 7),
    (0, 1, 5, 4),
    (1, 2, 6, 5),
    (2, 3, 7, 6),
    (3, 0, 4, 7),
]
SHAPES = {
    shape.name: shape
    for shape in (
        Shape("tet4", _node_places(_TET, []), _faces(_TET_FACES, 4, [])),
        Shape("tet10", _node_places(_TET, _TET_EDGES), _faces(_TET_FACES, 4, _TET_EDGES)),
        Shape("pyramid5", _node_places(_PYRAMID, []), _faces(_PYRAMID_FACES, 5, [])),
        Shape(
            "pyramid13",
            _node_places(_PYRAMID, _PYRAMID_EDGES),
            _faces(_PYRAMID_FACES, 5, _PYRAMID_EDGES),
        ),
        Shape("wedge6", _node_places(_WEDGE, []), _faces(_WEDGE_FACES, 6, [])),
        Shape("wedge15", _node_places(_WEDGE, _WEDGE_EDGES), _faces(_WEDGE_FACES, 6, _WEDGE_EDGES)),
        Shape("hex8", _node_places(_HEX, []), _faces(_HEX_FACES, 8, [])),
        Shape("hex20", _node_places(_HEX, _HEX_EDGES), _faces(_HEX_FACES, 8, _HEX_EDGES)),
    )
}
