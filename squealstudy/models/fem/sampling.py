"""Surfaces of solids: facet quadrature points, and the same points seen from a facing solid."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from skfem import CellBasis
from skfem.quadrature import get_quadrature

from squealstudy.errors import ModelError
from squealstudy.models.fem.solid import Solid
from squealstudy.models.surface import Surface

INSIDE = 1e-8  # m, from the face into the facing solid
NEWTON_STEPS = 20
NEARLY = 1e-10  # of the largest coordinate
# facet centre in (r, theta, z) -> keep it
FacetFilter = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def sample_surface(solid: Solid, keep: FacetFilter, points_per_side: int = 3) -> Surface:
    """Gauss points of the boundary facets whose centre passes `keep(r, theta, z)`.

    `points_per_side` 3 gives 3 x 3 points a facet. Corner-node lumping is not offered: the
    corner weights of an 8-node face are negative. Raises ModelError where no facet is kept.
    """
    mesh, kept = solid.grid.mesh, kept_facets(solid, keep)
    mapping, cells = mesh.mapping(), mesh.f2t[0, kept]
    X, weights = get_quadrature(mesh.brefdom, 2 * points_per_side - 1)
    points = mapping.G(X, find=kept)
    local = _local_coordinates(solid.basis, points, cells)
    S = _values(solid.basis, local, cells)
    S.data[np.abs(S.data) < 1e-14] = 0.0  # nodes off the facet
    S.eliminate_zeros()
    normals = mapping.normals(local, cells, kept, mesh.t2f)
    area = np.abs(mapping.detDG(X, find=kept)) * weights
    return Surface(points.reshape(3, -1).T, area.ravel(), normals.reshape(3, -1).T, S)


def kept_facets(solid: Solid, keep: FacetFilter) -> np.ndarray:
    """Numbers of the boundary facets whose centre passes `keep`; ModelError where there is none."""
    mesh = solid.grid.mesh
    facets = mesh.boundary_facets()
    x, y, z = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
    kept: np.ndarray = facets[keep(np.hypot(x, y), np.arctan2(y, x), z)]
    if not len(kept):
        raise ModelError("a surface selects no facet of its component")
    return kept


def surface_nodes(solid: Solid, keep: FacetFilter) -> np.ndarray:
    """Ascending node numbers of the boundary facets whose centre passes `keep`."""
    nodes: np.ndarray = np.sort(solid.basis.get_dofs(facets=kept_facets(solid, keep)).all())
    return nodes


def facing_surface(solid: Solid, surface: Surface) -> Surface:
    """The points of `surface` as seen by the facing `solid`: its own shape functions there.

    Points must lie on `solid`; the normals are reversed. Raises ModelError where they do not.
    The cells are looked up a hair inside `solid`: on the face itself it is round-off that decides.
    """
    S = shape_functions(solid, surface.points, surface.points + INSIDE * surface.normal)
    return Surface(surface.points, surface.area, -surface.normal, S)


def shape_functions(
    solid: Solid, points: np.ndarray, inside: np.ndarray | None = None
) -> sp.csr_matrix:
    """Values at points (n, 3) [m] of a solid from values at its nodes: (n, n_nodes).

    `inside`, by default the points themselves, are the places by which their cells are looked up.
    Raises ModelError where one of them lies outside.
    """
    basis = solid.basis
    cells = solid.grid.cells_at(points if inside is None else inside)
    if (cells < 0).any():
        raise ModelError(
            f"{(cells < 0).sum()} of {len(cells)} points of a surface lie outside the facing solid"
        )
    return _values(basis, _local_coordinates(basis, points.T[:, :, None], cells), cells)


def _values(basis: CellBasis, local: np.ndarray, cells: np.ndarray) -> sp.csr_matrix:
    """Shape functions (n * q, n_nodes) at local places (3, n, q) of cells (n,)."""
    shape = np.stack([basis.elem.lbasis(local, k)[0] for k in range(basis.Nbfun)])
    n_points = shape[0].size
    rows = np.tile(np.arange(n_points), basis.Nbfun)
    nodes = np.repeat(basis.element_dofs[:, cells], local.shape[2], axis=1).ravel()
    return sp.csr_matrix((shape.ravel(), (rows, nodes)), shape=(n_points, basis.N))


def _local_coordinates(basis: CellBasis, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Reference coordinates (3, n, q) of points (3, n, q) [m] in cells (n,), by Newton.

    The mapping's own inverse stops by one absolute norm of all points together, which thin cells
    do not reach, and evaluates its shape functions for each entry of a Jacobian. A cell follows the
    cylinder to 1e-5 of its radius: a point may be found that far outside. Raises ModelError where
    the iteration does not converge.
    """
    mesh, element = basis.mesh, basis.mapping.elem
    nodes = mesh.doflocs[:, mesh.dofs.element_dofs[:, cells]]
    X = np.full(points.shape, 0.5)
    for _ in range(NEWTON_STEPS):
        phi, slopes = zip(*(element.lbasis(X, k) for k in range(nodes.shape[1])), strict=True)
        off = points - np.einsum("ikn,knq->inq", nodes, np.stack(phi))
        J = np.einsum("ikn,kjnq->nqij", nodes, np.stack(slopes))
        X = X + np.linalg.solve(J, off.transpose(1, 2, 0)[..., None])[..., 0].transpose(2, 0, 1)
        if np.abs(off).max() <= NEARLY * np.abs(points).max():  # squared by this last step
            return X
    raise ModelError("points of a surface are not found in the cells of the facing solid")
