"""Elements of a mesh as cells, for pictures and files of mode shapes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from squealstudy.models.cells import CellBlock, ComponentCells
from squealstudy.models.components.jacobians import volumes
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.mesh_matrices import element_stiffnesses


@dataclass(frozen=True)
class MeshEnergies:
    """Twice the elastic energy of each element, as `ComponentCells.energies`."""

    mesh: SolidMesh

    def __call__(self, u: np.ndarray) -> np.ndarray:
        """Twice the energy u^H K u (n_elements,) [J] of displacements u (3 n_nodes,) [m]."""
        energies, displacements = np.zeros(self.mesh.n_elements), u.reshape(-1, 3)
        for places, nodes, K in element_stiffnesses(self.mesh):
            element_motion = displacements[nodes].reshape(len(nodes), -1)
            energies[places] = np.einsum(
                "ei,eij,ej->e", element_motion.conj(), K, element_motion, optimize=True
            ).real
        return energies


@dataclass(frozen=True)
class UnknownEnergies:
    """NaN as the energy of each element of a component that is given by matrices."""

    count: int

    def __call__(self, u: np.ndarray) -> np.ndarray:
        """NaN (n_elements,)."""
        return np.full(self.count, np.nan)


def moved_cells(mesh: SolidMesh, lacking: np.ndarray) -> ComponentCells | None:
    """The elements whose nodes have all displacements; None where there are none.

    `lacking` (3 n_nodes,) of bool says which displacements the matrices do not have.
    """
    is_known = np.asarray(~lacking.reshape(-1, 3).any(axis=1))
    blocks = []
    for block in mesh.blocks:
        all_known = is_known[block.nodes].all(axis=1)
        blocks.append(replace(block, nodes=block.nodes[all_known], labels=block.labels[all_known]))
    blocks = [b for b in blocks if len(b.labels)]
    if not blocks:
        return None
    count = sum(len(b.labels) for b in blocks)
    empty = np.full(count, "", dtype=object)
    part = replace(mesh, blocks=tuple(blocks), material=empty, orientation=empty)
    return replace(mesh_cells(part), energies=UnknownEnergies(count))


def mesh_cells(mesh: SolidMesh) -> ComponentCells:
    """All elements of a mesh in SI units, with volumes and energies."""
    blocks = tuple(CellBlock(b.kind.shape.name, b.nodes) for b in mesh.blocks)
    return ComponentCells(blocks, volumes(mesh), MeshEnergies(mesh))
