"""Cells of a meshed component, its surface, and the elastic energy of each cell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.element_shapes import SHAPES

NONE = -1  # index of a node that a facet does not have


class CellBlock(NamedTuple):
    """Cells of one type.

    Attributes
    ----------
    kind : str
        A name of `SHAPES`: tet4, tet10, pyramid5, pyramid13, wedge6, wedge15, hex8 or hex20.
    nodes : ndarray (n, k) of int
        Indices of nodes of the component, in the order of the shape. Jacobians are positive.
    """

    kind: str
    nodes: np.ndarray


@dataclass(frozen=True)
class ComponentCells:
    """Cells of a component's mesh, for pictures and files of mode shapes.

    Attributes
    ----------
    blocks : tuple of CellBlock
    volumes : ndarray (n_cells,)
        m3, block after block.
    energies : callable
        Takes displacements (3 n_nodes,) [m], real or complex; returns twice the elastic energy
        u^H K u of each cell (n_cells,) [J]. It can be pickled.

    Raises
    ------
    ModelError
        A type is unknown; cells have a wrong number of nodes; volumes are not positive.
    """

    blocks: tuple[CellBlock, ...]
    volumes: np.ndarray
    energies: Callable[[np.ndarray], np.ndarray]

    def __post_init__(self) -> None:
        for kind, nodes in self.blocks:
            if kind not in SHAPES:
                raise ModelError(f"cells of a type '{kind}', expected one of {', '.join(SHAPES)}")
            expected = SHAPES[kind].nodes
            if nodes.ndim != 2 or nodes.shape[1] != expected:
                raise ModelError(f"cells '{kind}' have {expected} nodes each, got {nodes.shape}")
        count = sum(len(nodes) for _, nodes in self.blocks)
        if self.volumes.shape != (count,) or not (self.volumes > 0).all():
            raise ModelError(f"{count} cells need as many volumes, all positive")

    @cached_property
    def facets(self) -> np.ndarray:
        """The surface: nodes (n, 8) of the facets that belong to one cell only.

        Four corners, counter-clockwise as seen from outside, then the middle node of the edge after
        each corner. NONE stands for the fourth corner of a triangle and for missing middle nodes.
        """
        faces = []
        for kind, nodes in self.blocks:
            padded = np.column_stack([nodes, np.full(len(nodes), NONE)])
            faces.append(padded[:, _face_places(kind)].reshape(-1, 8))
        all_facets = np.concatenate(faces)
        _, first, count = np.unique(
            np.sort(all_facets[:, :4], axis=1), axis=0, return_index=True, return_counts=True
        )
        return all_facets[np.sort(first[count == 1])]


def _face_places(kind: str) -> np.ndarray:
    """Columns (n_faces, 8) of the nodes of a cell's faces; NONE is a column after the last."""
    shape = SHAPES[kind]
    rows = []
    for face in shape.faces:
        corners = [i for i in face if shape.is_corner(i)]
        middles = [i for i in face if not shape.is_corner(i)] or [NONE] * len(corners)
        gap = [NONE] * (4 - len(corners))
        rows.append([*corners, *gap, *middles, *gap])
    return np.array(rows)
