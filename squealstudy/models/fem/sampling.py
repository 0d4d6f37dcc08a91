"""Points of solids with their shape functions: on surfaces, on a facing solid, within blocks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from skfem import CellBasis
from skfem.quadrature import get_quadrature

from squealstudy.errors import ModelError
from squealstudy.models.fem.grid import GridBlock
from squealstudy.models.fem.solid import Solid


@dataclass(frozen=True)
class Surface:
    """Points on one component's boundary.

    Attributes
    ----------
    points : ndarray (n, 3)
        Coordinates, m.
    area : ndarray (n,)
        Area of each point (its quadrature weight), m2, positive.
    normal : ndarray (n, 3)
        Outward unit normals.
    shape : csr_matrix (n, n_nodes)
        Shape functions: values at the points from values at the nodes; rows sum to one.
    """

    points: np.ndarray
    area: np.ndarray
    normal: np.ndarray
    shape: sp.csr_matrix

    def __post_init__(self) -> None:
        n = len(self.points)
        if self.area.shape != (n,) or self.normal.shape != (n, 3) or self.shape.shape[0] != n:
            raise ModelError("surface: points, area, normal and shape differ in length")
        if n == 0 or not (self.area > 0).all():
            raise ModelError("surface: it needs at least one point, all areas positive")
        if not np.allclose(self.shape.sum(axis=1), 1.0, atol=1e-9):
            raise ModelError("surface: shape functions must sum to one at every point")

    def observe(self, direction: np.ndarray) -> sp.csr_matrix:
        """Rows (n, 3 n_nodes) that give the displacement along `direction`, (n, 3) or (3,)."""
        d = np.broadcast_to(direction, self.points.shape)
        S = self.shape.tocoo()
        rows = np.repeat(S.row, 3)
        cols = (3 * S.col[:, None] + np.arange(3)).ravel()
        values = (S.data[:, None] * d[S.row]).ravel()
        return sp.coo_matrix((values, (rows, cols)), shape=(len(d), 3 * S.shape[1])).tocsr()


FACE_OFFSET_M = 1e-8  # m, from the face into the facing solid
MAX_NEWTON_STEPS = 20
SAME_COORDINATE_RATIO = 1e-10  # distance over the largest coordinate at which the iteration ends
# takes r, theta, z of facet centres; returns whether each facet is kept
FacetFilter = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def sample_surface(solid: Solid, keep: FacetFilter, points_per_side: int = 3) -> Surface:
    """Gauss points of the boundary facets whose centre passes `keep(r, theta, z)`.

    `points_per_side` 3 gives 3 x 3 points a facet. Nodes are not used as points, since the corner
    nodes of an 8-node face have negative weights. ModelError where no facet is kept.
    """
    mesh, facets = solid.grid.mesh, kept_facets(solid, keep)
    mapping, cells = mesh.mapping(), mesh.f2t[0, facets]
    X, weights = get_quadrature(mesh.brefdom, 2 * points_per_side - 1)
    points = mapping.G(X, find=facets)
    local = _local_coordinates(solid.basis, points, cells)
    S = _values(solid.basis, local, cells)
    S.data[np.abs(S.data) < 1e-14] = 0.0  # nodes off the facet
    S.eliminate_zeros()
    normals = mapping.normals(local, cells, facets, mesh.t2f)
    area = np.abs(mapping.detDG(X, find=facets)) * weights
    return Surface(points.reshape(3, -1).T, area.ravel(), normals.reshape(3, -1).T, S)


def kept_facets(solid: Solid, keep: FacetFilter) -> np.ndarray:
    """Numbers of the boundary facets whose centre passes `keep`; ModelError where there is none."""
    mesh = solid.grid.mesh
    facets = mesh.boundary_facets()
    x, y, z = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
    passing: np.ndarray = facets[keep(np.hypot(x, y), np.arctan2(y, x), z)]
    if not len(passing):
        raise ModelError("a surface selects no facet of its component")
    return passing


def facing_surface(solid: Solid, surface: Surface) -> Surface:
    """The points of `surface` with the shape functions of the facing `solid`.

    The normals are reversed. Cells are looked up FACE_OFFSET_M inside `solid`, since on the face
    itself round-off would decide. ModelError where a point is not on `solid`.
    """
    S = shape_functions(solid, surface.points, surface.points + FACE_OFFSET_M * surface.normal)
    return Surface(surface.points, surface.area, -surface.normal, S)


def shape_functions(
    solid: Solid, points: np.ndarray, inside: np.ndarray | None = None
) -> sp.csr_matrix:
    """Shape functions (n, n_nodes) at points (n, 3) [m] of a solid.

    Cells are looked up at `inside`, by default the points themselves. ModelError where one of these
    is outside the solid.
    """
    basis = solid.basis
    cells = solid.grid.cells_at(points if inside is None else inside)
    if (cells < 0).any():
        raise ModelError(
            f"{(cells < 0).sum()} of {len(cells)} points of a surface lie outside the facing solid"
        )
    return _values(basis, _local_coordinates(basis, points.T[:, :, None], cells), cells)


def _values(basis: CellBasis, local: np.ndarray, cells: np.ndarray) -> sp.csr_matrix:
    """Shape functions (n * q, n_nodes) at reference coordinates (3, n, q) of cells (n,)."""
    shape = np.stack([basis.elem.lbasis(local, k)[0] for k in range(basis.Nbfun)])
    n_points = shape[0].size
    rows = np.tile(np.arange(n_points), basis.Nbfun)
    nodes = np.repeat(basis.element_dofs[:, cells], local.shape[2], axis=1).ravel()
    return sp.csr_matrix((shape.ravel(), (rows, nodes)), shape=(n_points, basis.N))


def _local_coordinates(basis: CellBasis, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Reference coordinates (3, n, q) of points (3, n, q) [m] in cells (n,), by Newton iteration.

    The inverse mapping of skfem is not used: it stops by an absolute norm of all points together,
    which thin cells do not reach, and evaluates shape functions for each entry of a Jacobian. Cells
    follow a cylinder to 1e-5 of its radius, so that points may lie that far outside. ModelError
    where the iteration does not converge.
    """
    mesh, element = basis.mesh, basis.mapping.elem
    nodes = mesh.doflocs[:, mesh.dofs.element_dofs[:, cells]]
    X = np.full(points.shape, 0.5)
    for _ in range(MAX_NEWTON_STEPS):
        phi, slopes = zip(*(element.lbasis(X, k) for k in range(nodes.shape[1])), strict=True)
        distance = points - np.einsum("ikn,knq->inq", nodes, np.stack(phi))
        J = np.einsum("ikn,kjnq->nqij", nodes, np.stack(slopes))
        X = X + np.linalg.solve(J, distance.transpose(1, 2, 0)[..., None])[..., 0].transpose(
            2, 0, 1
        )
        if (
            np.abs(distance).max() <= SAME_COORDINATE_RATIO * np.abs(points).max()
        ):  # the last step squares this distance
            return X
    raise ModelError("points of a surface are not found in the cells of the facing solid")


RING_POINTS = 40  # points of a closed ring in theta: more than two a wave for up to 19 waves
BLOCK_POINTS = (2, 8, 2)  # points of any other block in r, theta, z
FULL_CIRCLE_RAD = 2 * np.pi * (1 - 1e-9)


def corresponding_rows(solid: Solid) -> sp.csr_matrix:
    """Rows that observe the displacement at fixed relative places of a solid, for comparisons.

    Each block of the grid has a fixed number of points at fixed shares of its extent in r, theta
    and z. So row i of two variants of a solid (other dimensions, another mesh) is the motion of the
    same material point. Rows are weighted by the square root of the mass of each point.

    Returns
    -------
    csr_matrix (3 p, 3 n_nodes)
        Rows x, y, z of the first point, then of the next.
    """
    points, shares = zip(*(_block_points(solid, b) for b in solid.grid.blocks), strict=True)
    xyz, share = np.vstack(points), np.concatenate(shares)
    mass = solid.M[::3, ::3].sum()
    weight = np.sqrt(mass * share / share.sum())
    return sp.kron(sp.diags(weight) @ shape_functions(solid, xyz), sp.eye(3)).tocsr()


def _block_points(solid: Solid, block: GridBlock) -> tuple[np.ndarray, np.ndarray]:
    """Points (p, 3) [m] at the middles of equal parts of a block, and their volumes (p,) [m3]."""
    x, y, z = solid.grid.mesh.doflocs
    r, height = np.hypot(x, y), (z.min(), z.max())
    spans = [
        (max(block.r[0], r.min()), min(block.r[1], r.max())),
        block.theta,
        (max(block.z[0], height[0]), min(block.z[1], height[1])),
    ]
    ring = block.theta[1] - block.theta[0] >= FULL_CIRCLE_RAD
    counts = (BLOCK_POINTS[0], RING_POINTS if ring else BLOCK_POINTS[1], BLOCK_POINTS[2])
    lines = [
        a + (b - a) * (np.arange(n) + 0.5) / n for (a, b), n in zip(spans, counts, strict=True)
    ]
    radius, theta, z = (c.ravel() for c in np.meshgrid(*lines, indexing="ij"))
    points = np.column_stack([radius * np.cos(theta), radius * np.sin(theta), z])
    cell = np.prod([(b - a) / n for (a, b), n in zip(spans, counts, strict=True)])
    return points, radius * cell
