"""A component as a file describes it: nodes, elements, sets, surfaces, materials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.constraints import (
    Constraint,
    Coupling,
    MeshSelection,
    Relation,
    Tie,
)
from squealstudy.models.components.discrete import Discrete
from squealstudy.models.components.formulations import FORMULATIONS, Formulation
from squealstudy.models.components.materials import Elastic, Orientation, Unfinished
from squealstudy.models.components.set_names import found_name, has_name

N_NAMED_IN_MESSAGE = 5  # elements or nodes that a message names
# reason why contact keywords are passed over
CONTACT_NOT_READ = "contact is stated in the model file"


class PassedOver(NamedTuple):
    """A part of a file that the model leaves out: keyword, file, line from 1 (0: none), reason."""

    keyword: str
    path: Path
    line: int
    why: str


@dataclass(frozen=True)
class ElementBlock:
    """Elements of one formulation.

    Attributes
    ----------
    formulation : str
        A name of `FORMULATIONS`.
    nodes : ndarray (n, k) of int
        Places of their nodes in `SolidMesh.nodes`, in the order of Abaqus, CalculiX and VTK.
    labels : ndarray (n,) of int
        Numbers of the elements in the file.
    """

    formulation: str
    nodes: np.ndarray
    labels: np.ndarray

    def __post_init__(self) -> None:
        if self.formulation not in FORMULATIONS:
            names = ", ".join(FORMULATIONS)
            raise ModelError(f"unknown element '{self.formulation}', expected one of {names}")
        if self.nodes.shape != (len(self.labels), self.kind.shape.nodes):
            raise ModelError(
                f"{self.formulation}: expected {self.kind.shape.nodes} nodes for each of "
                f"{len(self.labels)} elements, got an array {self.nodes.shape}"
            )

    @property
    def kind(self) -> Formulation:
        """The formulation."""
        return FORMULATIONS[self.formulation]


@dataclass(frozen=True)
class SolidMesh:
    """A meshed component, in the units of its file. Elements are counted over all blocks.

    Attributes
    ----------
    origin : Path
        The file, for messages.
    nodes : ndarray (n, 3)
    numbers : ndarray (n,) of int
        Numbers of the nodes in the file.
    blocks : tuple of ElementBlock
        An empty tuple where the file has only the nodes of matrices.
    node_sets, element_sets : dict of str -> ndarray of int
        Ascending rows of `nodes`, and ascending places of elements.
    surfaces : dict of str -> ndarray (p, 2) of int
        Places of elements, and numbers of their faces from 1, as S1 to S6 in files.
    materials : dict of str -> Isotropic, Orthotropic or Anisotropic
    unfinished : dict of str -> Unfinished
        Materials that the file states in part only; the model file may state the rest.
    material : ndarray (n_elements,) of str
        Name of each element's material; empty where it has none.
    orientations : dict of str -> Orientation
    orientation : ndarray (n_elements,) of str
        Name of each element's material axes; empty where they are the global ones.
    constraints : tuple of Tie, Coupling or Relation
        Constraints by which nodes follow others.
    passed_over : tuple of PassedOver
        Parts of the file that are left out of the mesh.
    lumped : bool
        Whether the program of the file lumps the mass at the nodes.
    discrete : tuple of Discrete
        Springs and masses beside the solids.
    added_density : ndarray (n_elements,)
        Density of mass without stiffness, such as paint; it adds to the material's.
    """

    origin: Path
    nodes: np.ndarray
    numbers: np.ndarray
    blocks: tuple[ElementBlock, ...]
    node_sets: Mapping[str, np.ndarray] = field(default_factory=dict)
    element_sets: Mapping[str, np.ndarray] = field(default_factory=dict)
    surfaces: Mapping[str, np.ndarray] = field(default_factory=dict)
    materials: Mapping[str, Elastic] = field(default_factory=dict)
    material: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=str))
    orientations: Mapping[str, Orientation] = field(default_factory=dict)
    orientation: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=str))
    constraints: tuple[Constraint, ...] = ()
    passed_over: tuple[PassedOver, ...] = ()
    unfinished: Mapping[str, Unfinished] = field(default_factory=dict)
    lumped: bool = False
    discrete: tuple[Discrete, ...] = ()
    added_density: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        n = self.n_elements
        for name in ("material", "orientation"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(n, "", dtype=object))
            if len(getattr(self, name)) != n:
                raise self.error(f"expected a {name} for each of {n} elements")
        if not len(self.added_density):
            object.__setattr__(self, "added_density", np.zeros(n))
        if self.nodes.shape != (len(self.numbers), 3) or not len(self.nodes):
            raise self.error(f"expected nodes (n, 3), got {self.nodes.shape}")
        if self.blocks and not n:
            raise self.error("there is no solid element")

    @cached_property
    def starts(self) -> np.ndarray:
        """Place of each block's first element, then the number of elements (n_blocks + 1,)."""
        return np.cumsum([0, *(len(b.labels) for b in self.blocks)])

    @cached_property
    def body_of(self) -> np.ndarray:
        """Number of each element's body (n_elements,), from 0 in the order of the elements.

        Elements belong to one body where shared nodes, constraints, springs or masses join them.
        """
        from scipy.sparse.csgraph import connected_components

        n, edges = len(self.nodes), [np.zeros((0, 2), dtype=np.int64)]  # pairs of joined nodes
        for block in self.blocks:
            edges += [block.nodes[:, [0, k]] for k in range(1, block.nodes.shape[1])]
        for c in self.constraints:
            if isinstance(c, Tie):
                members = np.append(c.nodes, self.node_of_face(c.faces))
            else:
                members = c.joined
            edges.append(np.column_stack([np.full(len(members), members[0]), members]))
        node_groups = (d.nodes for d in self.discrete)
        edges += [np.column_stack([np.full(len(m), m[0]), m]) for m in node_groups]
        starts, ends = np.vstack(edges).T
        graph = sp.coo_matrix((np.ones(len(starts)), (starts, ends)), (n, n))
        _, body_of_node = connected_components(graph, directed=False)
        bodies = [body_of_node[block.nodes[:, 0]] for block in self.blocks]
        body = np.concatenate([np.zeros(0, dtype=np.int64), *bodies])
        _, first, index = np.unique(body, return_index=True, return_inverse=True)
        return np.argsort(np.argsort(first))[index]  # bodies in the order of their first elements

    def node_of_face(self, faces: np.ndarray) -> np.ndarray:
        """One node (p,) of the element of each face (p, 2)."""
        block = np.searchsorted(self.starts, faces[:, 0], side="right") - 1
        blocks, starts = self.blocks, self.starts
        return np.array(
            [blocks[b].nodes[e - starts[b], 0] for b, e in zip(block, faces[:, 0], strict=True)],
            dtype=np.int64,
        )

    @property
    def used_without_element(self) -> np.ndarray:
        """Reference nodes of couplings, and nodes of relations and masses: some have no element."""
        node_lists = [np.array([c.reference]) for c in self.constraints if isinstance(c, Coupling)]
        node_lists += [c.nodes for c in self.constraints if isinstance(c, Relation)]
        return np.concatenate([np.zeros(0, dtype=np.int64), *node_lists, self.mass_nodes])

    @property
    def mass_nodes(self) -> np.ndarray:
        """Nodes with masses of their own."""
        node_lists = [d.nodes for d in self.discrete if d.M.any()]
        return np.concatenate([np.zeros(0, dtype=np.int64), *node_lists])

    @property
    def bare(self) -> np.ndarray:
        """Whether each node (n,) belongs to no element."""
        is_bare = np.ones(len(self.nodes), dtype=bool)
        for block in self.blocks:
            is_bare[block.nodes] = False
        return is_bare

    @property
    def may_coincide(self) -> np.ndarray:
        """Nodes that may lie where others do: slave nodes of ties, and nodes of relations."""
        parts = [c.nodes for c in self.constraints if isinstance(c, Tie | Relation)]
        return np.concatenate([np.zeros(0, dtype=np.int64), *parts])

    @property
    def n_elements(self) -> int:
        """Number of elements of all blocks."""
        return int(self.starts[-1])

    @cached_property
    def labels(self) -> np.ndarray:
        """Numbers (n_elements,) of all elements in the file."""
        return np.concatenate([np.zeros(0, dtype=np.int64), *(b.labels for b in self.blocks)])

    def error(self, message: str) -> ModelError:
        """The error to raise about this component."""
        return ModelError(f"{self.origin}: {message}")

    def elements_named(self, elements: np.ndarray) -> str:
        """Some of the elements at these places, for a message: "C3D10 elements 7, 8"."""
        kinds = np.array([b.formulation for b in self.blocks])
        elements = np.unique(elements)
        named = kinds[np.searchsorted(self.starts, elements[:N_NAMED_IN_MESSAGE], side="right") - 1]
        kind = f"{named[0]} " if len(set(named)) == 1 else ""
        return f"{kind}element{'s' * (len(elements) > 1)} {_numbers_text(self.labels[elements])}"

    def nodes_named(self, nodes: np.ndarray) -> str:
        """Some of the nodes at these places, for a message: "nodes 1, 2, 3"."""
        return f"node{'s' * (len(nodes) > 1)} {_numbers_text(self.numbers[nodes])}"

    def find(self, collection: str, name: str) -> np.ndarray:
        """A node set, element set or surface by its name; `found_name` says when capitals count.

        Parameters
        ----------
        collection : str
            node_sets, element_sets or surfaces.

        Raises
        ------
        ModelError
            There is none of this name; the message lists those that exist.
        """
        return found_name(
            getattr(self, collection), name, collection.replace("_", " ")[:-1], self.origin
        )

    def node_set(self, name: str) -> np.ndarray:
        """Nodes of a node set, or of the faces of a surface where no node set has this name."""
        if has_name(self.surfaces, name) and not has_name(self.node_sets, name):
            return np.unique(np.concatenate(self._nodes_of_faces(self.find("surfaces", name))))
        # the error about an unknown name lists surfaces as well; none of them is returned here
        everything = {**dict.fromkeys(self.surfaces, np.zeros(0, int)), **self.node_sets}
        return found_name(everything, name, "node set or surface", self.origin)

    def _nodes_of_faces(self, faces: np.ndarray) -> list[np.ndarray]:
        node_lists = []
        for block, start, end in zip(self.blocks, self.starts, self.starts[1:], strict=False):
            inside = faces[(faces[:, 0] >= start) & (faces[:, 0] < end)]
            for k, face in enumerate(block.kind.shape.faces):
                rows = inside[inside[:, 1] == k + 1, 0] - start
                node_lists.append(block.nodes[rows][:, list(face)].ravel())
        return node_lists

    def with_material(
        self,
        name: str,
        material: Elastic | Unfinished,
        elements: str | None = None,
        orientation: tuple[str, Orientation] | None = None,
    ) -> SolidMesh:
        """The mesh with a material assigned to an element set, by default to all elements.

        Parameters
        ----------
        name : str
            Name of the material.
        material : Isotropic, Orthotropic, Anisotropic or Unfinished
        elements : str or None
            Name of an element set; None for all elements.
        orientation : tuple (str, Orientation) or None
            Name and material axes; None leaves the axes unchanged.
        """
        if not name:
            raise self.error("a material needs a name")
        rows = slice(None) if elements is None else self.find("element_sets", elements)
        axes, orientations = self.orientation, self.orientations
        names = self.material.astype(object)
        names[rows] = name
        if orientation is not None:
            axes = axes.astype(object)
            axes[rows] = orientation[0]
            orientations = {**orientations, orientation[0]: orientation[1]}
        finished = {k: m for k, m in self.materials.items() if k != name}
        unfinished = {k: m for k, m in self.unfinished.items() if k != name}
        if isinstance(material, Unfinished):
            unfinished[name] = material
        else:
            finished[name] = material
        return replace(
            self,
            materials=finished,
            unfinished=unfinished,
            material=names,
            orientations=orientations,
            orientation=axes,
        )

    def used_nodes(self) -> np.ndarray:
        """Whether each node (n,) belongs to an element or to `used_without_element`.

        Raises ModelError where a constraint is on other nodes.
        """
        used = np.zeros(len(self.nodes), dtype=bool)
        for block in self.blocks:
            used[block.nodes] = True
        used[self.used_without_element] = True
        for c in self.constraints:
            if not used[c.nodes].all():
                bare = self.nodes_named(c.nodes[~used[c.nodes]])
                raise self.error(f"{c.name} couples {bare}, which no element has")
        return used

    def part(self, elements: np.ndarray, nodes: np.ndarray | None = None) -> SolidMesh:
        """The mesh of only these elements (places), with their nodes, sets, faces and constraints.

        `nodes` (n,) of bool adds nodes. Raises ModelError where a constraint couples the part with
        other nodes, or where there is no element and no `nodes` are given.
        """
        keep = np.zeros(self.n_elements, dtype=bool)
        keep[elements] = True
        if not keep.any() and nodes is None:
            raise self.error("there is no solid element")
        blocks = [
            ElementBlock(b.formulation, b.nodes[keep[s:e]], b.labels[keep[s:e]])
            for b, s, e in zip(self.blocks, self.starts, self.starts[1:], strict=False)
        ]
        used = np.zeros(len(self.nodes), dtype=bool) if nodes is None else nodes.copy()
        for b in blocks:
            used[b.nodes] = True
        self._add_joined(used)
        node_at, element_at = np.cumsum(used) - 1, np.cumsum(keep) - 1
        selection = MeshSelection(used, node_at, keep, element_at)
        try:
            constraints = [p for c in self.constraints if (p := c.kept(selection)) is not None]
            discrete = [q for d in self.discrete if (q := d.kept(selection)) is not None]
        except ModelError as error:
            raise self.error(str(error)) from error
        faces = {k: f[keep[f[:, 0]]] for k, f in self.surfaces.items()}
        return replace(
            self,
            nodes=self.nodes[used],
            numbers=self.numbers[used],
            blocks=tuple(replace(b, nodes=node_at[b.nodes]) for b in blocks if len(b.labels)),
            node_sets=_without_empty({k: node_at[s[used[s]]] for k, s in self.node_sets.items()}),
            element_sets=_without_empty(
                {k: element_at[s[keep[s]]] for k, s in self.element_sets.items()}
            ),
            surfaces=_without_empty(
                {k: np.column_stack([element_at[f[:, 0]], f[:, 1]]) for k, f in faces.items()}
            ),
            material=self.material[keep],
            orientation=self.orientation[keep],
            added_density=self.added_density[keep],
            constraints=tuple(constraints),
            discrete=tuple(discrete),
        )

    def _add_joined(self, used: np.ndarray) -> None:
        """Add nodes without an element that constraints and springs join to those `used` (n,).

        One may join what another adds, so they are gone through until none adds a node.
        """
        bare, n_before = self.bare, -1
        while (n_used := int(np.count_nonzero(used))) != n_before:
            n_before = n_used
            for c in self.constraints:
                if isinstance(c, Coupling) and used[c.nodes].all():
                    used[c.reference] = True
                elif isinstance(c, Relation):
                    used[c.nodes] |= bare[c.nodes] & used[c.nodes[~bare[c.nodes]]].any()
            for d in self.discrete:
                used[d.nodes] |= bare[d.nodes] & used[d.nodes].any()


def _without_empty(sets: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: members for name, members in sets.items() if len(members)}


def _numbers_text(numbers: np.ndarray) -> str:
    shown = ", ".join(str(n) for n in numbers[:N_NAMED_IN_MESSAGE])
    more = len(numbers) - N_NAMED_IN_MESSAGE
    return f"{shown} and {more} more" if more > 0 else shown
