"""Constraints between nodes: ties of faces, rigid and distributing couplings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.materials import Orientation

NO_FACES = np.zeros((0, 2), dtype=np.int64)
GLOBAL = Orientation("rectangular", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@dataclass(frozen=True)
class MeshSelection:
    """Whether nodes and elements of a mesh are in a part, and their places in it."""

    nodes: np.ndarray
    node_at: np.ndarray
    elements: np.ndarray
    element_at: np.ndarray

    def faces(self, faces: np.ndarray) -> np.ndarray:
        """Faces (p, 2) by the new places of their elements, which must all be in the part."""
        return np.column_stack([self.element_at[faces[:, 0]], faces[:, 1]])


@dataclass(frozen=True)
class Tie:
    """Nodes that follow the points of master faces on which they lie.

    Attributes
    ----------
    name : str
        Name for messages.
    nodes : ndarray of int
        Places of the slave's nodes in the mesh.
    faces : ndarray (p, 2) of int
        Faces of the master, as surfaces of `SolidMesh`.
    tolerance : float or None
        Greatest distance of a node that is tied, in the units of the mesh; None: a share of the
        size of the master's facets.
    adjusted : bool
        Whether nodes are moved onto the master; else a node off it is an error.
    coarse : bool
        Whether the master has more nodes there than follow it, so that it is free between them.
    beside : int
        Number of nodes of the slave that are not on the master, and so are free.
    cyclic : bool
        Whether the master belongs to the next sector (`sectors.repeated`).
    """

    name: str
    nodes: np.ndarray
    faces: np.ndarray
    tolerance: float | None = None
    adjusted: bool = True
    coarse: bool = False
    beside: int = 0
    cyclic: bool = False

    @property
    def told(self) -> str:
        """Description for an inspection."""
        return f"{self.name}: {len(self.nodes)} nodes follow {len(self.faces)} faces"

    def scaled(self, size: float) -> Tie:
        """The tie in another unit of length."""
        return self if self.tolerance is None else replace(self, tolerance=size * self.tolerance)

    def moved(self, turn: np.ndarray, shift: np.ndarray) -> Tie:
        """The tie of a mesh whose points x are moved to turn x + shift."""
        return self

    def kept(self, selection: MeshSelection) -> Tie | None:
        """The tie in a part of the mesh; None where the part has none of its nodes."""
        selected = [*selection.nodes[self.nodes], *selection.elements[self.faces[:, 0]]]
        if not _all_or_none(self.name, selected):
            return None
        return replace(self, nodes=selection.node_at[self.nodes], faces=selection.faces(self.faces))


@dataclass(frozen=True)
class Coupling:
    """A reference node, and nodes that it moves or whose mean motion it follows.

    Attributes
    ----------
    name : str
        Name for messages.
    kind : str
        rigid: the nodes move as one rigid body with the reference node, which has rotations as
        degrees of freedom; distributing: the reference node has the rigid motion nearest to theirs.
    reference : int
        Place of the reference node in the mesh.
    nodes : ndarray of int
        Places of the other nodes.
    directions : tuple of int
        Directions from 1 to 3 in which the nodes, or the reference node, follow.
    axes : Orientation or None
        Axes of these directions at each node that follows; None for the global ones.
    faces : ndarray (p, 2) of int
        Faces of the nodes of a distributing coupling, whose nodes are weighted by area; without
        faces they are weighted equally.
    turning : bool
        Whether nodes of a rigid coupling that are reference nodes of others turn with this one.
    """

    name: str
    kind: Literal["rigid", "distributing"]
    reference: int
    nodes: np.ndarray
    directions: tuple[int, ...] = (1, 2, 3)
    faces: np.ndarray = field(default_factory=lambda: NO_FACES)
    turning: bool = True
    axes: Orientation | None = None

    @property
    def joined(self) -> np.ndarray:
        """Places of all nodes of the constraint."""
        return np.append(self.nodes, self.reference)

    @property
    def told(self) -> str:
        """Description for an inspection."""
        how = "moves" if self.kind == "rigid" else "follows the mean motion of"
        return f"{self.name}: a reference node {how} {len(self.nodes)} nodes"

    def along(self, points: np.ndarray) -> np.ndarray:
        """Unit vectors (..., m, 3) of the m directions at points (..., 3)."""
        return (self.axes or GLOBAL).axes(points)[..., np.array(self.directions) - 1, :]

    def scaled(self, size: float) -> Coupling:
        """The coupling in another unit of length."""
        if self.axes is None:
            return self
        return replace(self, axes=self.axes.moved(size * np.eye(3), np.zeros(3)))

    def moved(self, turn: np.ndarray, shift: np.ndarray) -> Coupling:
        """The coupling of a mesh whose points x are moved to turn x + shift."""
        if self.directions == (1, 2, 3) or (np.array_equal(turn, np.eye(3)) and self.axes is None):
            return self
        return replace(self, axes=(self.axes or GLOBAL).moved(turn, shift))

    def kept(self, selection: MeshSelection) -> Coupling | None:
        """The coupling in a part of the mesh; None where the part has none of its nodes."""
        if not _all_or_none(self.name, selection.nodes[self.nodes]):
            return None
        return replace(
            self,
            reference=int(selection.node_at[self.reference]),
            nodes=selection.node_at[self.nodes],
            faces=selection.faces(self.faces),
        )


@dataclass(frozen=True)
class Relation:
    """An equation of displacements, sum of v . u = 0, by which the first node follows the others.

    Attributes
    ----------
    name : str
        Name for messages.
    nodes : ndarray (n,) of int
        Places of its nodes in the mesh, each once; the first follows.
    vectors : ndarray (n, 3)
        Vector v of each node.
    """

    name: str
    nodes: np.ndarray
    vectors: np.ndarray

    @property
    def joined(self) -> np.ndarray:
        """Places of all nodes of the constraint."""
        return self.nodes

    @property
    def told(self) -> str:
        """Description for an inspection."""
        others = len(self.nodes) - 1
        return f"{self.name}: a displacement follows {others} node{'s' * (others != 1)}"

    def scaled(self, size: float) -> Relation:
        """The relation in another unit of length."""
        return self

    def moved(self, turn: np.ndarray, shift: np.ndarray) -> Relation:
        """The relation of a mesh whose points x are moved to turn x + shift."""
        return replace(self, vectors=self.vectors @ turn.T)

    def kept(self, selection: MeshSelection) -> Relation | None:
        """The relation in a part of the mesh; None where the part has none of its nodes."""
        if not _all_or_none(self.name, selection.nodes[self.nodes]):
            return None
        return replace(self, nodes=selection.node_at[self.nodes])


def relation(name: str, nodes: np.ndarray, vectors: np.ndarray) -> Relation:
    """A relation with the terms of each node summed, in the order of their first terms."""
    distinct, first, positions = np.unique(nodes, return_index=True, return_inverse=True)
    total = np.zeros((len(distinct), 3))
    np.add.at(total, positions, vectors)
    order = np.argsort(first)
    return Relation(name, distinct[order], total[order])


Constraint = Tie | Coupling | Relation


def _all_or_none(name: str, is_selected: list[bool] | np.ndarray) -> bool:
    if np.all(is_selected):
        return True
    if np.any(is_selected):
        raise ModelError(f"{name} couples this part to others: read all of them as one component")
    return False
