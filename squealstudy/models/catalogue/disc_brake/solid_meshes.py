"""Generated solids as meshes of a model file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from skfem import CellBasis, ElementHexS2

from squealstudy.models.components.materials import Elastic, Orthotropic
from squealstudy.models.components.mesh import ElementBlock, SolidMesh
from squealstudy.models.fem.grid import CylindricalMesh
from squealstudy.models.fem.solid import Isotropic, Material, brick_nodes


def mesh_of_grid(
    name: str,
    grid: CylindricalMesh,
    materials: Mapping[str, Material],
    formulation: str = "C3D20",
) -> SolidMesh:
    """A generated solid as a mesh of 20-node hexahedra in SI units.

    Nodes have the order of `Solid.coordinates`, so that matrices have the same rows. Each material
    has an element set.

    Parameters
    ----------
    name : str
        Name of the component, for messages.
    grid : CylindricalMesh
    materials : dict of str -> Isotropic or TransverselyIsotropic
    formulation : str
        C3D20 or C3D20R.
    """
    basis = CellBasis(grid.mesh, ElementHexS2(), intorder=1)
    nodes = brick_nodes(basis)
    numbers = np.arange(1, len(nodes) + 1)
    return SolidMesh(
        origin=Path(name),
        nodes=np.ascontiguousarray(basis.doflocs.T),
        numbers=np.arange(1, basis.N + 1),
        blocks=(ElementBlock(formulation, nodes, numbers),),
        element_sets={m: np.flatnonzero(grid.material == m) for m in sorted(set(grid.material))},
        materials={m: _elastic(materials[m]) for m in sorted(set(grid.material))},
        material=grid.material.astype(object),
    )


def _elastic(material: Material) -> Elastic:
    """The material, as orthotropic if it is transversely isotropic."""
    if isinstance(material, Isotropic):
        return material
    E, Ez, nu, nuz = (
        material.young_modulus,
        material.young_modulus_z,
        material.poisson_ratio,
        material.poisson_ratio_z,
    )
    G = (E / (2 * (1 + nu)), material.shear_modulus_z, material.shear_modulus_z)
    return Orthotropic.from_engineering((E, E, Ez), (nu, nuz, nuz), G, material.density)
