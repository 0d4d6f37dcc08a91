"""Gyroscopic terms of a component of a model file that turns."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.bodies import Body
from squealstudy.models.components.jacobians import jacobians
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.mesh_matrices import (
    NodeSums,
    chunks,
    material_of,
    parts_of,
    used_materials,
)
from squealstudy.models.turning import Rotors, convective_elements, gyroscopic

SAME_MASS = 1e-6  # with a larger relative difference to the elements' mass, there is other mass


def turning_matrix(body: Body, mesh: SolidMesh, rotors: Rotors, M: sp.csr_matrix) -> sp.csr_matrix:
    """Gyroscopic matrix (n, n) [kg] at 1 rad/s over the degrees of freedom of a body.

    Parameters
    ----------
    body : Body
    mesh : SolidMesh
        Mesh of the body, with the densities to use.
    rotors : Rotors
    M : csr_matrix (n, n)
        Mass of the body, with all masses on it.

    Raises
    ------
    ModelError
        The body has no mesh, has masses beside its elements, or is not symmetric about the axis.
    """
    if body.matrices is not None:
        raise ModelError(f"{body.name} is given by matrices: gyroscopic terms need its mesh")
    parts = [p for name in used_materials(mesh) for p in parts_of(mesh, name)]
    sums, total = NodeSums(mesh, parts, 1), 0.0
    for part, chunk, X in chunks(mesh, parts):
        rule = part.block.kind.mass_rule("full")
        N, dN = part.block.kind.shape.functions(rule.points)
        det, J = jacobians(mesh, part.start, chunk, X, dN)
        density = material_of(mesh, part.material).density + mesh.added_density[part.start + chunk]
        mass = det * rule.weights * density[:, None]
        slopes = np.matmul(dN, np.linalg.inv(J))
        points = np.einsum("qk,eki->eqi", N, X, optimize=True)
        elements = convective_elements(rotors, N, slopes, points, mass)
        sums.add(part, chunk, elements[..., None])
        total += float(mass.sum())
    along = body.expansion.freedoms(np.tile([1.0, 0.0, 0.0], len(mesh.nodes))[:, None])[:, 0]
    if abs(along @ (M @ along) - total) > SAME_MASS * total:
        raise ModelError(
            f"{body.name} carries masses beside its elements: it is not symmetric about its axis "
            "of rotation"
        )
    convective = sp.kron(sums.matrix(), sp.identity(3), format="csr")
    nodes = mesh.nodes[np.maximum(body.expansion.places, 0) // 3]
    return gyroscopic(body.expansion.restricted(convective).tocsr(), nodes, body.name)
