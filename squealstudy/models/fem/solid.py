"""Linear elastic solids: materials, mass and stiffness of 20-node serendipity bricks.

Materials are 6 x 6 stiffnesses in Voigt order xx, yy, zz, yz, xz, xy.

scikit-fem's forms loop over all 60 x 60 pairs of shape functions; the contraction here takes a
scalar basis of 20 functions and all three directions at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from skfem import CellBasis, ElementHexS2

from squealstudy.errors import ModelError
from squealstudy.models.cells import CellBlock, ComponentCells
from squealstudy.models.element_shapes import SHAPES
from squealstudy.models.fem.grid import CylindricalMesh
from squealstudy.models.turning import Rotors, convective_elements, gyroscopic


@dataclass(frozen=True)
class Isotropic:
    """Isotropic material.

    Parameters
    ----------
    young_modulus : float
        E, Pa, > 0.
    poisson_ratio : float
        nu, -1 < nu < 0.5.
    density : float
        Mass density, kg/m3, > 0.
    """

    young_modulus: float
    poisson_ratio: float
    density: float

    def stiffness(self) -> np.ndarray:
        """Stiffness matrix (6, 6), Pa, engineering shear strains."""
        E, nu = self.young_modulus, self.poisson_ratio
        return orthotropic_stiffness(
            (E, E, E), (nu, nu, nu), (E / (2 * (1 + nu)),) * 3, self.density
        )


@dataclass(frozen=True)
class TransverselyIsotropic:
    """Material isotropic in the x-y plane, another along z: a brake lining.

    Parameters
    ----------
    young_modulus : float
        In the plane, Pa.
    young_modulus_z : float
        Through the thickness, Pa.
    shear_modulus_z : float
        In the planes that hold z, Pa.
    poisson_ratio : float
        In the plane.
    poisson_ratio_z : float
        Contraction along z under load in the plane, nu_pz.
    density : float
        kg/m3.
    """

    young_modulus: float
    young_modulus_z: float
    shear_modulus_z: float
    poisson_ratio: float
    poisson_ratio_z: float
    density: float

    def stiffness(self) -> np.ndarray:
        """Stiffness matrix (6, 6), Pa, engineering shear strains."""
        E, Ez, Gz = self.young_modulus, self.young_modulus_z, self.shear_modulus_z
        G = E / (2 * (1 + self.poisson_ratio))
        nu = (self.poisson_ratio, self.poisson_ratio_z, self.poisson_ratio_z)
        return orthotropic_stiffness((E, E, Ez), nu, (Gz, Gz, G), self.density)


Material = Isotropic | TransverselyIsotropic
# compliance over the largest one below which it is round-off, as with nu = 0.5
SINGULAR_COMPLIANCE_RATIO = 1e-13


def orthotropic_stiffness(
    E: tuple[float, float, float],
    nu: tuple[float, float, float],
    G: tuple[float, float, float],
    density: float,
) -> np.ndarray:
    """Stiffness (6, 6) of an orthotropic material, engineering shear strains.

    nu = (xy, xz, yz), G = (yz, xz, xy). Raises ModelError where it is not positive definite.
    """
    nu_xy, nu_xz, nu_yz = nu
    S = np.zeros((6, 6))
    if min(*E, *G, density) <= 0:
        raise ModelError(f"moduli and density must be positive, got E={E}, G={G}, rho={density}")
    S[0, 0], S[1, 1], S[2, 2] = 1 / E[0], 1 / E[1], 1 / E[2]
    S[0, 1] = S[1, 0] = -nu_xy / E[0]
    S[0, 2] = S[2, 0] = -nu_xz / E[0]
    S[1, 2] = S[2, 1] = -nu_yz / E[1]
    S[3, 3], S[4, 4], S[5, 5] = 1 / G[0], 1 / G[1], 1 / G[2]
    if not np.isfinite(S).all():
        raise ModelError(f"moduli are too small to be divided by, got E={E}, G={G}")
    compliances = np.linalg.eigvalsh(S)
    if compliances[0] <= SINGULAR_COMPLIANCE_RATIO * compliances[-1]:
        constants = "; ".join(
            f"{n} {', '.join(f'{v:g}' for v in triple)}" for n, triple in (("E", E), ("nu", nu))
        )
        raise ModelError(f"elastic constants {constants} give no positive definite stiffness")
    return np.linalg.inv(S)


# Voigt index of the strain component (i, j)
VOIGT = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
MASS_ORDER = 4  # 27 points: exact for the mass matrix of an undistorted brick
# orders of the stiffness: 27 points, 8 points
FULL_INTEGRATION_ORDER, REDUCED_INTEGRATION_ORDER = 4, 3


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
    energies : CellEnergies
        Elastic energies of cells, by the quadrature of the stiffness.
    """

    grid: CylindricalMesh
    basis: CellBasis
    M: sp.csr_matrix
    K: sp.csr_matrix
    energies: CellEnergies

    def gyroscopic(self, rotors: Rotors, name: str) -> sp.csr_matrix:
        """Gyroscopic matrix (3 n_nodes, 3 n_nodes) [kg] at 1 rad/s (`models.turning`).

        ModelError where the body, called `name`, is not symmetric about the axis.
        """
        basis, materials = self.basis, self.energies.materials
        N = np.array([np.asarray(f[0])[0] for f in basis.basis]).T
        slopes = np.stack([f[0].grad for f in basis.basis]).transpose(2, 3, 0, 1)
        points = np.asarray(basis.global_coordinates()).transpose(1, 2, 0)
        density = np.array([materials[m].density for m in self.grid.material])
        A = convective_elements(rotors, N, slopes, points, basis.dx * density[:, None])
        nodes, size = basis.element_dofs.T, (basis.N, basis.N)
        rows, columns = np.repeat(nodes, 20, axis=1).ravel(), np.tile(nodes, (1, 20)).ravel()
        convective = sp.coo_matrix((A.ravel(), (rows, columns)), shape=size).tocsr()
        scalar = gyroscopic(convective, self.coordinates, name)
        return sp.kron(scalar, sp.identity(3), format="csr")

    @property
    def coordinates(self) -> np.ndarray:
        """Node coordinates (n_nodes, 3), m."""
        return np.ascontiguousarray(self.basis.doflocs.T)

    @property
    def cells(self) -> ComponentCells:
        """The bricks of the solid, for pictures and files."""
        volumes = self.basis.dx.sum(axis=1)
        return ComponentCells(
            (CellBlock("hex20", brick_nodes(self.basis)),), volumes, self.energies
        )


def brick_nodes(basis: CellBasis) -> np.ndarray:
    """Nodes (n_cells, 20) of 20-node bricks in the order of `SHAPES`."""
    distances = np.abs(SHAPES["hex20"].places[:, None] - ElementHexS2.doflocs[None]).max(axis=2)
    nodes: np.ndarray = basis.element_dofs[distances.argmin(axis=1)].T
    return nodes


@dataclass(frozen=True)
class CellEnergies:
    """Elastic energy of each cell: what `ComponentCells.energies` asks for.

    Attributes
    ----------
    grid : CylindricalMesh
    materials : mapping of name -> Material
    order : int
        Order of the quadrature of the stiffness.
    """

    grid: CylindricalMesh
    materials: Mapping[str, Material]
    order: int

    def __call__(self, u: np.ndarray) -> np.ndarray:
        """Twice the energies u^H K u (n_cells,) [J] of displacements u (3 n_nodes,) [m]."""
        basis = CellBasis(self.grid.mesh, ElementHexS2(), intorder=self.order)
        element_motion = u.reshape(-1, 3)[basis.element_dofs]  # (20, n_cells, 3)
        slope = sum(
            np.einsum("ei,keq->eqik", element_motion[a], f[0].grad)
            for a, f in enumerate(basis.basis)
        )
        strain = np.empty((*slope.shape[:2], 6), dtype=u.dtype)
        for i, k in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)):
            shear = slope[..., i, k] + slope[..., k, i]
            strain[..., VOIGT[i, k]] = slope[..., i, i] if i == k else shear
        energy = np.empty(len(strain))
        for name, material in self.materials.items():
            cells = self.grid.material == name
            e, C = strain[cells], material.stiffness()
            density = np.einsum("eqi,ij,eqj->eq", e.conj(), C, e, optimize=True).real
            energy[cells] = (density * basis.dx[cells]).sum(axis=1)
        return energy


def assemble_solid(
    grid: CylindricalMesh,
    materials: Mapping[str, Material],
    stiffness_order: int = FULL_INTEGRATION_ORDER,
) -> Solid:
    """Assemble mass and stiffness of `grid`; `materials` maps the cells' material names.

    `stiffness_order` is the order of the Gauss quadrature of the stiffness. FULL_INTEGRATION_ORDER
    locks where thin walls have long cells. REDUCED_INTEGRATION_ORDER does not, but each cell then
    has mechanisms without energy: they are suppressed by its neighbours unless a body is one cell
    thick in two directions.

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
    energies = CellEnergies(grid, dict(materials), stiffness_order)
    return Solid(grid, basis, _scatter(M_e, dofs, n), _scatter(K_e, dofs, n), energies)


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
