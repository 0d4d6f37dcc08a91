"""Missing middle nodes of quadratic elements, which are added and follow the mean of their corners.

Without a middle node the displacement along the edge is linear. With an added node that moves as
the mean of its two corners it is the same.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from squealstudy.models.components.constraints import Relation, relation
from squealstudy.models.components.mesh import PassedOver, SolidMesh
from squealstudy.models.element_shapes import Shape

LACKING = -1  # index of a missing middle node


class Middles:
    """Added middle nodes, one for each edge without one.

    Parameters
    ----------
    n : int
        Number of nodes of the file; added ones have indices from n on.
    """

    def __init__(self, n: int) -> None:
        self._n = n
        self._of: dict[tuple[int, int], int] = {}

    def filled(self, shape: Shape, nodes: np.ndarray) -> np.ndarray:
        """Nodes (k,) of an element with indices of added ones in place of `LACKING`."""
        filled = nodes.copy()
        for node in np.flatnonzero(nodes == LACKING):
            ends = sorted(int(nodes[corner]) for corner in shape.ends[int(node)])
            filled[node] = self._of.setdefault((ends[0], ends[1]), self._n + len(self._of))
        return filled

    def added(self, nodes: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates and numbers of all nodes, added ones last."""
        if not self._of:
            return nodes, numbers
        ends = np.array(list(self._of))
        new = numbers.max() + 1 + np.arange(len(ends))
        return np.vstack([nodes, nodes[ends].mean(axis=1)]), np.append(numbers, new)

    def tied(self, mesh: SolidMesh) -> SolidMesh:
        """The mesh with relations for added nodes, which join node sets with both their corners."""
        if not self._of:
            return mesh
        relations: list[Relation] = []
        for (a, b), middle in self._of.items():
            for axis in np.eye(3):
                vectors = np.array([-2.0, 1.0, 1.0])[:, None] * axis
                relations.append(relation("middle node", np.array([middle, a, b]), vectors))
        ends, places = np.array(list(self._of)), np.array(list(self._of.values()))
        sets = {
            name: np.union1d(members, places[np.isin(ends, members).all(axis=1)])
            for name, members in mesh.node_sets.items()
        }
        why = (
            f"{len(places)} middle nodes of elements are missing: the displacement of such an edge "
            "is linear"
        )
        note = PassedOver("middle nodes", mesh.origin, 0, why)
        return replace(
            mesh,
            node_sets=sets,
            constraints=(*mesh.constraints, *relations),
            passed_over=(*mesh.passed_over, note),
        )
