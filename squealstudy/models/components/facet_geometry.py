"""Facets of a component's surface: their geometry, and points on them.

Facets are triangles of 3 or 6 nodes and quadrilaterals of 4, 8 or 9. Nodes are the corners, then
the middles of the edges, then the centre, in the order of VTK and Abaqus. The outward normal
follows from the order of the corners by the right-hand rule.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from squealstudy.errors import ModelError
from squealstudy.kernels.facets import MAX_FACET_NODES, shapes
from squealstudy.models.fem.sampling import Surface

TRIANGLES = (3, 6)
KINDS = (3, 4, 6, 8, 9)  # numbers of nodes of a facet
FLAT = 1e-12  # a facet with less area over radius squared counts as one without area


@dataclass(frozen=True)
class Facets:
    """Facets on a component.

    Attributes
    ----------
    coordinates : ndarray (n_nodes, 3)
        Coordinates of all nodes of the component, m.
    blocks : tuple of ndarray (m, k) of int
        Nodes of the facets, in a block for each number k of nodes. The facets are numbered through
        all blocks.
    name : str
        Name for messages.

    Raises
    ------
    ModelError
        There is no facet, a node does not exist, or a facet has no area.
    """

    coordinates: np.ndarray
    blocks: tuple[np.ndarray, ...]
    name: str = "surface"

    def __post_init__(self) -> None:
        n = len(self.coordinates)
        if self.coordinates.shape != (n, 3) or not np.isfinite(self.coordinates).all():
            raise ModelError(f"{self.name}: node coordinates must be finite, (n, 3)")
        if not sum(len(b) for b in self.blocks):
            raise ModelError(f"{self.name}: it has no facet")
        for block in self.blocks:
            if block.ndim != 2 or block.shape[1] not in KINDS:
                raise ModelError(f"{self.name}: a facet has 3, 4, 6, 8 or 9 nodes")
            if len(block) and not (block.min() >= 0 and block.max() < n):
                raise ModelError(f"{self.name}: facets refer to nodes that it does not have")
        flat = np.flatnonzero(self.areas <= FLAT * self.radii**2)
        if len(flat):
            raise ModelError(
                f"{self.name}: {len(flat)} facets have no area, first number {flat[0]}"
            )

    @cached_property
    def kinds(self) -> np.ndarray:
        """Number of nodes of each facet (m,)."""
        return np.repeat([b.shape[1] for b in self.blocks], [len(b) for b in self.blocks])

    @cached_property
    def table(self) -> np.ndarray:
        """Nodes of all facets (m, 9); the first node fills the places of facets with fewer."""
        rows = [
            np.hstack([b, np.repeat(b[:, :1], MAX_FACET_NODES - b.shape[1], axis=1)])
            for b in self.blocks
        ]
        return np.ascontiguousarray(np.vstack(rows), dtype=np.int64)

    @cached_property
    def nodes(self) -> np.ndarray:
        """Node coordinates of all facets (m, 9, 3), m."""
        return np.ascontiguousarray(self.coordinates[self.table], dtype=float)

    @cached_property
    def centres(self) -> np.ndarray:
        """Centre of each facet, the mean of its corners (m, 3), m."""
        is_triangle = np.isin(self.kinds, TRIANGLES)
        triangle, quad = (self.nodes[:, :n].mean(axis=1) for n in (3, 4))
        return np.where(is_triangle[:, None], triangle, quad)

    @cached_property
    def radii(self) -> np.ndarray:
        """Radius of each facet, the greatest distance of a node from its centre (m,), m."""
        radii: np.ndarray = np.linalg.norm(self.nodes - self.centres[:, None], axis=2).max(axis=1)
        return radii

    @cached_property
    def areas(self) -> np.ndarray:
        """Areas of all facets (m,), m2."""
        sampled = [_sampled(self.coordinates[b], 3)[2].sum(axis=1) for b in self.blocks]
        return np.concatenate(sampled)

    @cached_property
    def directions(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean unit normal of each facet (m, 3), and a bound of its normals' deviation (m,).

        The bound is twice the largest difference at Gauss points, as those are not at the corners.
        """
        surface, facet = self.gauss_points(3)
        mean = np.column_stack([np.bincount(facet, n) for n in surface.normal.T])
        mean = mean / np.linalg.norm(mean, axis=1, keepdims=True)
        lean = np.zeros(len(mean))
        np.maximum.at(lean, facet, np.linalg.norm(surface.normal - mean[facet], axis=1))
        return mean, 2 * lean

    def gauss_points(self, points_per_side: int) -> tuple[Surface, np.ndarray]:
        """Gauss points of all facets (see `rule`), and the number of each point's facet."""
        parts = [_sampled(self.coordinates[b], points_per_side) for b in self.blocks if len(b)]
        points, normals, area = (
            np.concatenate([p[i].reshape(-1, *p[i].shape[2:]) for p in parts]) for i in range(3)
        )
        values = np.vstack([np.tile(p[3], (p[2].shape[0], 1)) for p in parts])
        counts = np.concatenate([np.full(len(p[2]), p[2].shape[1]) for p in parts])
        facet = np.repeat(np.arange(len(counts)), counts)
        return Surface(points, area, normals, self.rows(facet, values)), facet

    def rows(self, facet: np.ndarray, values: np.ndarray) -> sp.csr_matrix:
        """Rows (n, n_nodes) from `values` (n, 9) at the nodes of the facets `facet` (n,)."""
        row = np.repeat(np.arange(len(facet)), MAX_FACET_NODES)
        entries = values.ravel(), (row, self.table[facet].ravel())
        rows = sp.csr_matrix(entries, shape=(len(facet), len(self.coordinates)))
        rows.eliminate_zeros()
        return rows


def rule(kind: int, points_per_side: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (q, 2) and positive weights (q,) of the quadrature on a reference facet.

    Quadrilaterals have n x n Gauss points. Triangles have 1, 3 or 6 points for n = 1, 2, 3, which
    integrate degrees 1, 2, 4, and n x n points on a collapsed square from n = 4.
    """
    if kind in TRIANGLES and points_per_side == 1:
        return np.full((1, 2), 1 / 3), np.array([0.5])
    if kind in TRIANGLES and points_per_side <= 3:
        X, weights = get_quadrature(RefTri, 2 * points_per_side - 2)
        return np.ascontiguousarray(X.T), weights
    x, w = np.polynomial.legendre.leggauss(points_per_side)
    a, b = np.repeat(x, len(x)), np.tile(x, len(x))
    square = np.outer(w, w).ravel()
    if kind not in TRIANGLES:
        return np.column_stack([a, b]), square
    a, b = (1 + a) / 2, (1 + b) / 2
    return np.column_stack([a, b * (1 - a)]), square / 4 * (1 - a)


def shape_values(kind: int, local: np.ndarray) -> np.ndarray:
    """Shape functions and slopes (n, 3, 9) at local coordinates `local` (n, 2)."""
    N = np.zeros((len(local), 3, MAX_FACET_NODES))
    shapes(kind, np.ascontiguousarray(local, dtype=float), N)
    return N


def _sampled(
    nodes: np.ndarray, points_per_side: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points (m, q, 3), unit normals (m, q, 3), areas (m, q), shape functions (q, 9)."""
    kind = nodes.shape[1]
    local, weights = rule(kind, points_per_side)
    N = shape_values(kind, local)
    x, x_a, x_b = np.einsum("qdk,mkj->dmqj", N[:, :, :kind], nodes)
    normal = np.cross(x_a, x_b)
    size = np.linalg.norm(normal, axis=2)
    with np.errstate(invalid="ignore", divide="ignore"):  # facets without area are refused later
        unit = normal / size[:, :, None]
    return x, unit, size * weights, N[:, 0]
