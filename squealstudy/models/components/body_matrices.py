"""K and M of a mesh over its degrees of freedom: those of its elements, springs and masses."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from squealstudy.models.components.discrete import matrices
from squealstudy.models.components.expansion import Expansion
from squealstudy.models.components.formulations import MassRule
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix


def freedom_matrices(
    mesh: SolidMesh, expansion: Expansion, rule: MassRule
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """K [N/m] and M [kg], both (n, n).

    Raises
    ------
    ModelError
        An element has no material, or a negative Jacobian; a spring or a mass acts on the rotation
        of a node that has none.
    """
    restricted = [
        expansion.restricted(A) for A in (stiffness_matrix(mesh), mass_matrix(mesh, rule))
    ]
    if mesh.discrete:
        n = len(mesh.nodes)
        for d in mesh.discrete:
            if not d.turns:
                continue
            used = (abs(d.K) + abs(d.M)).sum(axis=1).reshape(-1, 6)[:, 3:].any(axis=1)
            without_turns = d.nodes[used & ~expansion.turning[d.nodes]]
            if len(without_turns):
                raise mesh.error(
                    f"{d.name}: {mesh.nodes_named(without_turns)} has no turns: expected the "
                    "reference node of a rigid or distributing coupling"
                )
        R = expansion.E
        if any(d.turns for d in mesh.discrete):
            R = sp.vstack([expansion.E, expansion.turns], format="csr")
        rows = np.arange(R.shape[0])
        added = matrices(mesh.discrete, n)
        restricted = [
            A + R.T @ B[rows][:, rows] @ R for A, B in zip(restricted, added, strict=True)
        ]
    return restricted[0].tocsr(), restricted[1].tocsr()
