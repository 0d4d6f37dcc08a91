"""Mass and stiffness of 20-node serendipity bricks, contracted from scikit-fem's basis arrays.

scikit-fem's form loop visits each of the 60 x 60 shape function pairs; the contraction here does
one scalar basis of 20 functions and the three directions together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from skfem import CellBasis, ElementHexS2

from squealstudy.models.fem.grid import CylindricalMesh
from squealstudy.models.fem.material import Material

# Voigt index of the strain component (i, j)
VOIGT = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
MASS_ORDER = 4  # 27 points: exact for the mass matrix of an undistorted brick
FULL, REDUCED = 4, 3  # orders of the stiffness: 27 points, 8 points


@dataclass(frozen=True)
class Solid:
    """A meshed elastic body; degree of freedom 3 * node + axis (x, y, z).

    Attributes
    ----------
    grid : CylindricalMesh
        Cells.
    basis : skfem.CellBasis
        Scalar serendipity basis; its degrees of freedom are the nodes.
    M, K : csr_matrix (3 * n_nodes, 3 * n_nodes)
        Mass [kg] and stiffness [N/m], symmetric.
    """

    grid: CylindricalMesh
    basis: CellBasis
    M: sp.csr_matrix
    K: sp.csr_matrix

    @property
    def coordinates(self) -> np.ndarray:
        """Node coordinates (n_nodes, 3), m."""
        return np.ascontiguousarray(self.basis.doflocs.T)


def assemble_solid(
    grid: CylindricalMesh,
    materials: Mapping[str, Material],
    stiffness_order: int = FULL,
) -> Solid:
    """Assemble mass and stiffness of `grid`; `materials` maps the cells' material names.

    `stiffness_order` is the order of the Gauss quadrature of the stiffness. FULL locks where thin
    walls have long cells. REDUCED does not, but each cell then has mechanisms without energy: they
    are suppressed by its neighbours unless a body is one cell thick in two directions.

    Returns
    -------
    Solid
    """
    basis = CellBasis(grid.mesh, ElementHexS2(), intorder=MASS_ORDER)
    nodes = basis.element_dofs
    dofs = (3 * nodes.T[:, :, None] + np.arange(3)).reshape(nodes.shape[1], 60)
    M_e = _element_masses(basis, np.array([materials[m].density for m in grid.material]))
    K_e = _element_stiffnesses(grid, materials, stiffness_order)
    n = 3 * basis.N
    return Solid(grid, basis, _scatter(M_e, dofs, n), _scatter(K_e, dofs, n))


def _element_masses(basis: CellBasis, rho: np.ndarray) -> np.ndarray:
    """Mass (n_cells, 20, 3, 20, 3) [kg] of cells of density rho (n_cells,)."""
    N = np.stack([np.asarray(f[0]) for f in basis.basis])  # (20, n_cells, n_qp) or broadcast
    N = np.broadcast_to(N, (20, *basis.dx.shape))
    mass = np.einsum("aeq,beq,eq->eab", N, N, basis.dx * rho[:, None], optimize=True)
    M_e = np.zeros((len(rho), 20, 3, 20, 3))
    for axis in range(3):
        M_e[:, :, axis, :, axis] = mass
    return M_e


def _element_stiffnesses(
    grid: CylindricalMesh, materials: Mapping[str, Material], order: int
) -> np.ndarray:
    """Stiffness (n_cells, 20, 3, 20, 3) [N/m]: K_aibj = C_ikjl int dN_a/dx_k dN_b/dx_l."""
    basis = CellBasis(grid.mesh, ElementHexS2(), intorder=order)
    G = np.stack([f[0].grad for f in basis.basis])  # (20, 3, n_cells, n_qp)
    n_cells = G.shape[2]
    Gt = np.ascontiguousarray(G.transpose(2, 0, 1, 3).reshape(n_cells, 60, -1))
    g = (Gt * basis.dx[:, None, :]) @ Gt.transpose(0, 2, 1)
    g = g.reshape(n_cells, 20, 3, 20, 3)
    K_e = np.empty_like(g)
    for name, material in materials.items():
        cells = grid.material == name
        C = material.stiffness()[VOIGT[:, :, None, None], VOIGT[None, None]]
        K_e[cells] = np.einsum("ikjl,eakbl->eaibj", C, g[cells], optimize=True)
    return K_e


def _scatter(element: np.ndarray, dofs: np.ndarray, n: int) -> sp.csr_matrix:
    """Sum element matrices (n_cells, 20, 3, 20, 3) into a symmetric csr matrix."""
    values = element.reshape(len(dofs), 60, 60)
    rows = np.repeat(dofs, 60, axis=1).ravel()
    cols = np.tile(dofs, (1, 60)).ravel()
    A = sp.coo_matrix((values.ravel(), (rows, cols)), shape=(n, n)).tocsr()
    return ((A + A.T) * 0.5).tocsr()
