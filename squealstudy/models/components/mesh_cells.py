"""Elements of a mesh as cells, for pictures and files of shapes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.models.cells import CellBlock, ComponentCells
from squealstudy.models.components.assembly import element_stiffnesses
from squealstudy.models.components.formulations import integration
from squealstudy.models.components.jacobians import jacobians
from squealstudy.models.components.mesh import SolidMesh


@dataclass(frozen=True)
class MeshEnergies:
    """Elastic energy of each element: what `ComponentCells.energies` asks for."""

    mesh: SolidMesh

    def __call__(self, u: np.ndarray) -> np.ndarray:
        """Twice the energies u^H K u (n_elements,) [J] of displacements u (3 n_nodes,) [m]."""
        found, moved = np.zeros(self.mesh.n_elements), u.reshape(-1, 3)
        for places, nodes, K in element_stiffnesses(self.mesh):
            own = moved[nodes].reshape(len(nodes), -1)
            found[places] = np.einsum("ei,eij,ej->e", own.conj(), K, own, optimize=True).real
        return found


def mesh_cells(mesh: SolidMesh) -> ComponentCells:
    """All elements of a mesh in SI."""
    volumes = []
    for block, start in zip(mesh.blocks, mesh.starts, strict=False):
        rule = integration(block.kind.mass)
        _, dN = block.kind.shape.functions(rule.points)
        rows = np.arange(len(block.labels))
        det, _ = jacobians(mesh, int(start), rows, mesh.nodes[block.nodes], dN)
        volumes.append(det @ rule.weights)
    blocks = tuple(CellBlock(b.kind.shape.name, b.nodes) for b in mesh.blocks)
    return ComponentCells(blocks, np.concatenate(volumes), MeshEnergies(mesh))
