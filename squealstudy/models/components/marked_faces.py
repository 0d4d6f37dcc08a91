"""Plane elements that only mark faces of solids, as in the groups that gmsh writes."""

from __future__ import annotations

import numpy as np

from squealstudy.models.components.faces import faces_with_corners
from squealstudy.models.components.mesh import PassedOver, SolidMesh

FACES = "faces"  # the value of treat_as for them
NODES = {  # numbers of nodes of plane elements, shells and membranes that may be faces
    **{f"{kind}{n}": n for kind in ("CPS", "CPE", "M3D", "S") for n in (3, 4, 6, 8)},
    "S8R": 8,
    "S4R": 4,
}


class MarkedFaces:
    """Plane elements that mark faces.

    Attributes
    ----------
    labels : ndarray (n,) of int
    corners : ndarray (n, 4) of int
        Indices of their corner nodes; -1 for the fourth of a triangle.
    """

    def __init__(self) -> None:
        self.labels = np.zeros(0, dtype=np.int64)
        self.corners = np.zeros((0, 4), dtype=np.int64)

    def add(self, labels: np.ndarray, nodes: np.ndarray) -> None:
        """Add elements with labels (n,) and indices of nodes (n, k), k = 3, 4, 6 or 8."""
        corners = np.full((len(labels), 4), -1)
        count = 4 if nodes.shape[1] in (4, 8) else 3
        corners[:, :count] = nodes[:, :count]
        self.labels = np.append(self.labels, labels)
        self.corners = np.vstack([self.corners, corners])

    def surface(
        self, mesh: SolidMesh, name: str, labels: np.ndarray
    ) -> tuple[np.ndarray, PassedOver | None]:
        """Faces (p, 2) of the boundary that elements of these labels mark.

        Also a note, or None, on marked faces that are not on the boundary.
        """
        corners = np.unique(self.corners[np.isin(self.labels, labels)], axis=0)
        faces, is_face = faces_with_corners(mesh, corners)
        missing = int((~is_face).sum())
        why = f"{missing} of {len(corners)} faces are not on the boundary of the solid"
        note = PassedOver(f"element set {name}", mesh.origin, 0, why) if missing else None
        return faces, note
