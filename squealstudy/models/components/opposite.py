"""Points of a slave surface, and points of the master opposite along the slave's normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from squealstudy.kernels.facets import CURVED_RADIUS_FACTOR, MAX_FACET_NODES, project
from squealstudy.models.components.facet_geometry import Facets
from squealstudy.models.fem.sampling import Surface

SAMPLES = 2000  # most points of a survey
AT_ONCE = 1_000_000  # pairs of facets in one array operation


@dataclass(frozen=True)
class Opposite:
    """Points of a slave with the master in reach along their normals; possibly none.

    Attributes
    ----------
    points, normal : ndarray (n, 3)
        Points on the slave [m] and its outward unit normals there.
    area : ndarray (n,)
        Positive, m2.
    slave, master : csr_matrix (n, n_nodes)
        Shape functions of each side.
    gap : ndarray (n,)
        Distance along the slave's normal, m; negative where the surfaces overlap.
    same_way : float
        Area [m2] of the slave where the master is in reach only with normals that point the same
        way, so that the two do not face each other.
    """

    points: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    slave: sp.csr_matrix
    master: sp.csr_matrix
    gap: np.ndarray
    same_way: float


@dataclass(frozen=True)
class Neighbours:
    """Master facets that may face slave facet i: candidates[start[i] : start[i + 1]].

    Attributes
    ----------
    start : ndarray (n_slaves + 1,) of int
    candidates : ndarray of int
        Indices of master facets.
    """

    start: np.ndarray
    candidates: np.ndarray

    def of(self, facets: np.ndarray) -> Neighbours:
        """The neighbours of some slave facets, by their indices."""
        parts = [self.candidates[self.start[i] : self.start[i + 1]] for i in facets]
        return Neighbours(np.cumsum([0, *map(len, parts)]), np.concatenate(parts))


def near_facets(slave: Facets, master: Facets, search: float) -> Neighbours:
    """Master facets that normals of each slave facet may meet within `search` [m].

    Master facets are searched in classes of size, so that a few large ones do not widen the search
    for all others.
    """
    normal, spread = slave.directions
    sizes = np.floor(np.log2(master.radii))
    owner, neighbours = [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)]
    for size in np.unique(sizes):
        some = np.flatnonzero(sizes == size)
        tree = cKDTree(master.centres[some])
        reach = CURVED_RADIUS_FACTOR * (slave.radii + master.radii[some].max()) + search
        counts = tree.query_ball_point(slave.centres, reach, return_length=True)
        batch = np.cumsum(counts) // AT_ONCE
        for part in np.split(np.arange(len(counts)), np.flatnonzero(np.diff(batch)) + 1):
            lists = tree.query_ball_point(slave.centres[part], reach[part])
            i = np.repeat(part, counts[part])
            m = some[np.concatenate([np.asarray(x, dtype=int) for x in lists])]
            offset = master.centres[m] - slave.centres[i]
            height = np.sum(offset * normal[i], axis=1)
            off = np.linalg.norm(offset - height[:, None] * normal[i], axis=1)
            extent = CURVED_RADIUS_FACTOR * (slave.radii[i] + master.radii[m])
            in_reach = (abs(height) <= extent + search) & (off <= extent + spread[i] * abs(height))
            owner.append(i[in_reach])
            neighbours.append(m[in_reach])
    i, m = np.concatenate(owner), np.concatenate(neighbours)
    order = np.lexsort((m, i))
    start = np.searchsorted(i[order], np.arange(len(slave.kinds) + 1))
    return Neighbours(start, m[order])


def gauss_points(
    slave: Facets, master: Facets, neighbours: Neighbours, search: float, points_per_side: int
) -> Opposite:
    """The Gauss points of the slave's facets with the master within `search` [m]."""
    surface, group = slave.gauss_points(points_per_side)
    facet, same_way, gap, values = _projected(surface, group, neighbours, master, search)
    has_facet = facet >= 0
    return Opposite(
        surface.points[has_facet],
        surface.normal[has_facet],
        surface.area[has_facet],
        surface.shape[has_facet],
        master.rows(facet[has_facet], values[has_facet]),
        gap[has_facet],
        float(surface.area[same_way & ~has_facet].sum()),
    )


def survey(slave: Facets, master: Facets) -> tuple[float, np.ndarray]:
    """Share of the slave with the master opposite at any distance, and the gaps there [m].

    From at most SAMPLES Gauss points, evenly drawn from all facets.
    """
    surface, _ = slave.gauss_points(2)
    some = np.unique(np.linspace(0, len(surface.area) - 1, SAMPLES).astype(int))
    part = Surface(
        surface.points[some], surface.area[some], surface.normal[some], surface.shape[some]
    )
    everywhere = Neighbours(np.array([0, len(master.kinds)]), np.arange(len(master.kinds)))
    group = np.zeros(len(some), dtype=int)
    facet, _, gap, _ = _projected(part, group, everywhere, master, np.inf)
    return float(part.area[facet >= 0].sum() / part.area.sum()), gap[facet >= 0]


def _projected(
    surface: Surface, group: np.ndarray, neighbours: Neighbours, master: Facets, search: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Master facet (n,), same_way (n,), gap (n,) and shape functions (n, 9), as in `project`."""
    n = len(surface.points)
    facet, same_way = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=bool)
    gap, values = np.zeros(n), np.zeros((n, MAX_FACET_NODES))
    project(
        surface.points,
        surface.normal,
        group,
        neighbours.start,
        neighbours.candidates,
        master.kinds,
        master.nodes,
        master.centres,
        master.radii,
        search,
        facet,
        same_way,
        gap,
        values,
    )
    return facet, same_way, gap, values
