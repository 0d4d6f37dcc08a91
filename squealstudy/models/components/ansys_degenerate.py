"""Bricks of ANSYS with corners in one place: wedges, pyramids, tetrahedra."""

from __future__ import annotations

# of linear and of quadratic bricks: formulation, and which of the brick's nodes are its nodes
Degenerate = tuple[tuple[str, tuple[int, ...]], tuple[str, tuple[int, ...]]]
WEDGE: Degenerate = (
    ("C3D6", (0, 1, 2, 4, 5, 6)),
    ("C3D15", (0, 1, 2, 4, 5, 6, 8, 9, 11, 12, 13, 15, 16, 17, 18)),
)
PYRAMID: Degenerate = (
    ("C3D5", tuple(range(5))),
    ("C3D13", (0, 1, 2, 3, 4, 8, 9, 10, 11, 16, 17, 18, 19)),
)
TETRAHEDRON: Degenerate = ("C3D4", (0, 1, 2, 4)), ("C3D10", (0, 1, 2, 4, 8, 9, 11, 16, 17, 18))
