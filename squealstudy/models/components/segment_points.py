"""Contact points as means over a slave's facets, integrated over the segments of two meshes.

The functions of the means (THEORY.md eq. (104), (105)) are the Lagrange functions L_a of the
facet's Gauss points: they sum to one, so that no force is lost, and their integrals are the Gauss
points' areas. Where parallelograms match, points and rows are those of Gauss points. On a facet
that is covered in part, integrals of Lagrange functions may be negative; they are drawn towards
constant functions, just so far that every area is at least MIN_AREA_SHARE of what
it would be with those.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from squealstudy.errors import ModelError
from squealstudy.kernels.facets import MAX_FACET_NODES
from squealstudy.kernels.segments import N_SHAPE_TERMS, integrate_segments
from squealstudy.models.components.facet_geometry import TRIANGLES, Facets, rule
from squealstudy.models.components.opposite import Neighbours, Opposite

AT_ONCE = 20_000  # pairs of facets integrated in one call: 13 MB
MIN_AREA_SHARE = 0.1  # area of a point over that with constant functions
MIN_COVERED_SHARE = 1e-12  # a facet counts as uncovered below this share
LAYERS = 1.02  # several masters cover a facet if more of its area is covered


@dataclass(frozen=True)
class Segments:
    """Settings of the integration over segments.

    Attributes
    ----------
    points_per_side : int
        n = 1, 2, 3: n x n means on a quadrilateral, 1, 3 or 6 on a triangle.
    pieces : int
        Chords on a curved edge, at least 1.
    degree : int
        Degree up to which polynomials of local coordinates are integrated exactly over a segment,
        2 to 12.
    search : float
        Greatest distance of surfaces in contact, m.
    """

    points_per_side: int
    pieces: int
    degree: int
    search: float


def segment_means(
    slave: Facets, master: Facets, neighbours: Neighbours, settings: Segments
) -> Opposite:
    """Contact points as means over the parts of all slave facets that are in reach.

    Raises ModelError where master facets lie in layers, or a facet is folded.
    """
    parts = []
    for three in (True, False):
        family = np.flatnonzero(np.isin(slave.kinds, TRIANGLES) == three)
        work_so_far = np.cumsum(np.diff(neighbours.start)[family])
        cuts = np.flatnonzero(np.diff(work_so_far // AT_ONCE)) + 1
        functions = lagrange(three, settings.points_per_side)
        parts += [
            _means(slave, master, some, neighbours.of(some), functions, settings)
            for some in np.split(family, cuts)
            if len(some)
        ]
    return Opposite(
        points=np.concatenate([p.points for p in parts]),
        normal=np.concatenate([p.normal for p in parts]),
        area=np.concatenate([p.area for p in parts]),
        slave=sp.vstack([p.slave for p in parts]).tocsr(),
        master=sp.vstack([p.master for p in parts]).tocsr(),
        gap=np.concatenate([p.gap for p in parts]),
        same_way=sum(p.same_way for p in parts),
    )


def lagrange(three: bool, points_per_side: int) -> tuple[np.ndarray, np.ndarray]:
    """Lagrange functions of a facet's Gauss points, and the points' shares of the area.

    Returns
    -------
    functions : ndarray (p, 9)
        Coefficients of the terms 1, a, b, ab, a2, b2, a2 b, a b2, a2 b2.
    share : ndarray (p,)
        Gauss weights, which sum to one.
    """
    local, weights = rule(3 if three else 4, points_per_side)
    a, b = local.T
    terms = np.column_stack([a**0, a, b, a * b, a * a, b * b, a * a * b, a * b * b, a * a * b * b])
    n = len(weights)
    functions = np.zeros((n, N_SHAPE_TERMS))
    functions[:, :n] = np.linalg.inv(terms[:, :n]).T
    return functions, weights / weights.sum()


def _means(
    slave: Facets,
    master: Facets,
    some: np.ndarray,
    near: Neighbours,
    lagrange_functions: tuple[np.ndarray, np.ndarray],
    settings: Segments,
) -> Opposite:
    """Means over the slave facets `some`, all triangles or all quadrilaterals."""
    terms = _integrals(slave, master, some, near, settings)
    functions, share = lagrange_functions
    total_area = terms.area[:, 0]
    layered = np.flatnonzero(total_area > LAYERS * slave.areas[some])
    if len(layered):
        raise ModelError(
            f"{master.name}: its facets lie above each other, opposite {len(layered)} facets of "
            f"{slave.name}, first number {some[layered[0]]}"
        )
    constant = np.zeros_like(functions)
    constant[:, 0] = share
    drawn = _constant_share(terms.area @ functions.T, total_area[:, None] * share)[:, None, None]
    functions = (1 - drawn) * functions + drawn * constant  # (facets, points, terms)
    area = np.einsum("spt,st->sp", functions, terms.area)
    is_covered = total_area > MIN_COVERED_SHARE * slave.areas[some]
    functions[is_covered] /= area[is_covered, :, None]
    n = np.count_nonzero(is_covered) * len(share)
    number = np.full(len(some), -1)
    number[is_covered] = np.arange(np.count_nonzero(is_covered))

    def rows(
        facets: Facets, which: np.ndarray, slave_rows: np.ndarray, M: np.ndarray
    ) -> sp.csr_matrix:
        """Rows from integrals M of the facets `which`, each over a part of one of `slave_rows`."""
        values = functions[slave_rows] @ M
        row = number[slave_rows][:, None] * len(share) + np.arange(len(share))
        columns = np.broadcast_to(facets.table[which][:, None], values.shape)
        entries = values.ravel(), (np.repeat(row.ravel(), MAX_FACET_NODES), columns.ravel())
        matrix = sp.csr_matrix(entries, shape=(n, len(facets.coordinates)))
        matrix.eliminate_zeros()
        return matrix

    owner = np.repeat(np.arange(len(some)), np.diff(near.start))
    met = is_covered[owner] & terms.master.any(axis=(1, 2))
    of_slave = rows(slave, some[is_covered], np.flatnonzero(is_covered), terms.slave[is_covered])
    normal = (functions[is_covered] @ terms.normal[is_covered]).reshape(-1, 3)
    return Opposite(
        points=of_slave @ slave.coordinates,
        normal=normal / np.linalg.norm(normal, axis=1, keepdims=True),
        area=area[is_covered].ravel(),
        slave=of_slave,
        master=rows(master, near.candidates[met], owner[met], terms.master[met]),
        gap=np.einsum("spt,st->sp", functions[is_covered], terms.gap[is_covered]).ravel(),
        same_way=float(terms.left_out[:, 1].sum()),
    )


def _constant_share(areas: np.ndarray, constant: np.ndarray) -> np.ndarray:
    """Share (facets,) of the constant functions by which all areas (facets, p) are large enough.

    `constant` are the areas that these would have; both sum to that of the facet.
    """
    short = MIN_AREA_SHARE * constant - areas
    with np.errstate(invalid="ignore", divide="ignore"):  # a facet that is not covered has none
        needed = np.where(short > 0, short / (constant - areas), 0.0)
    drawn: np.ndarray = needed.max(axis=1)
    return drawn


@dataclass(frozen=True)
class _Integrals:
    """Arrays that `integrate_segments` returns."""

    area: np.ndarray
    slave: np.ndarray
    master: np.ndarray
    gap: np.ndarray
    normal: np.ndarray
    left_out: np.ndarray


def _integrals(
    slave: Facets, master: Facets, some: np.ndarray, near: Neighbours, settings: Segments
) -> _Integrals:
    """Integrals over the segments of the slave facets `some`."""
    n = len(some)
    terms = _Integrals(
        np.zeros((n, N_SHAPE_TERMS)),
        np.zeros((n, N_SHAPE_TERMS, MAX_FACET_NODES)),
        np.zeros((len(near.candidates), N_SHAPE_TERMS, MAX_FACET_NODES)),
        np.zeros((n, N_SHAPE_TERMS)),
        np.zeros((n, N_SHAPE_TERMS, 3)),
        np.zeros((n, 2)),
    )
    local, weights = get_quadrature(RefTri, settings.degree)
    failed = integrate_segments(
        slave.kinds[some],
        slave.nodes[some],
        master.kinds,
        master.nodes,
        near.start,
        near.candidates,
        np.ascontiguousarray(local.T),
        weights,
        settings.pieces,
        settings.search,
        terms.area,
        terms.slave,
        terms.master,
        terms.gap,
        terms.normal,
        terms.left_out,
    )
    if failed >= 0:
        raise ModelError(
            f"{slave.name}: facet {some[failed]} is folded or too distorted for clipping"
        )
    return terms
