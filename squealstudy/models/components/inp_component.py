"""The mesh of a component from cards of a file: nodes, elements, sets, sections, couplings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from squealstudy.models.components.constraints import Constraint
from squealstudy.models.components.faces import boundary
from squealstudy.models.components.inp_added_mass import KEYWORD as ADDED
from squealstudy.models.components.inp_added_mass import with_added_mass
from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_couplings import KEYWORDS, CardScope, Couplings
from squealstudy.models.components.inp_discrete import KEYWORDS as DISCRETE
from squealstudy.models.components.inp_discrete import read_discrete
from squealstudy.models.components.inp_distributions import KEYWORD as DISTRIBUTION
from squealstudy.models.components.inp_distributions import unused_distributions
from squealstudy.models.components.inp_elements import KEYWORDS as ELEMENTS
from squealstudy.models.components.inp_elements import Elements
from squealstudy.models.components.inp_equations import KEYWORDS as EQUATIONS
from squealstudy.models.components.inp_equations import Equations
from squealstudy.models.components.inp_lines import WHOLE_NUMBER, Line
from squealstudy.models.components.inp_materials import with_sections
from squealstudy.models.components.inp_nodes import KEYWORDS as NODES
from squealstudy.models.components.inp_nodes import Nodes
from squealstudy.models.components.inp_places import NodePlaces
from squealstudy.models.components.inp_sectors import KEYWORD as SECTORS
from squealstudy.models.components.inp_sectors import SectorCard, read_sectors
from squealstudy.models.components.inp_sets import NO_LABELS, Sets
from squealstudy.models.components.inp_text import Text, unused
from squealstudy.models.components.marked_faces import MarkedFaces
from squealstudy.models.components.materials import Orientation
from squealstudy.models.components.mesh import ElementBlock, SolidMesh

SET = ("NSET", "ELSET", "GENERATE", "INSTANCE", "UNSORTED", "INTERNAL")
SURFACE = ("NAME", "TYPE", "INTERNAL")
SECTIONS = ("SOLIDSECTION", "ORIENTATION", DISTRIBUTION)
OF_MESH = (*NODES, *ELEMENTS, "NSET", "ELSET", "SURFACE")
READ = (*OF_MESH, *SECTIONS, *KEYWORDS, *EQUATIONS, *DISCRETE, SECTORS, ADDED)


class Component:
    """Reads the cards of a component into a mesh."""

    def __init__(self, text: Text) -> None:
        self.text = text
        self.numbers, self.nodes = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        self.node_sets, self.element_sets = Sets("node"), Sets("element")
        self.assembly_sets = (
            Sets("node", self.node_sets, text.instance),
            Sets("element", self.element_sets, text.instance),
        )
        self.blocks: list[ElementBlock] = []
        self.marked = MarkedFaces()
        self.labels = np.zeros(0, dtype=np.int64)  # of all solid elements, block after block
        self.by_label = np.zeros(0, dtype=np.int64)  # their indices in the order of labels

    def mesh(self) -> SolidMesh:
        """The component; ModelError about a line that is wrong or not supported."""
        self._read()
        self._collect_sets()
        mesh = SolidMesh(self.text.path, self.nodes, self.numbers, tuple(self.blocks))
        mesh = replace(
            mesh,
            element_sets=self._resolved(self.element_sets, self.assembly_sets[1], self._elements),
            node_sets=self._resolved(self.node_sets, self.assembly_sets[0], self._nodes),
        )
        mesh = self._with_surfaces(self._with_sections(mesh))
        mesh = self._with_couplings(self._with_marked_faces(mesh))
        mesh = self._without_unused(mesh)
        cards = (*self.text.part, *self.text.assembly)
        self.text.passed_over += [unused(card) for card in cards if card.unused]
        for sets in (self.node_sets, self.element_sets):
            for card, missing in sets.absent:
                self.text.note(card, f"{missing} of its numbers belong to no {sets.kind}")
        orientations = {
            name: axes.moved(self.text.turn, self.text.shift)
            for name, axes in mesh.orientations.items()
        }
        return replace(
            mesh,
            nodes=mesh.nodes @ self.text.turn.T + self.text.shift,
            orientations=orientations,
            discrete=tuple(d.moved(self.text.turn) for d in mesh.discrete),
            constraints=tuple(c.moved(self.text.turn, self.text.shift) for c in mesh.constraints),
            passed_over=tuple(self.text.passed_over),
        )

    def sectors(self) -> list[SectorCard]:
        """Cards that say how the mesh repeats, if it is a sector of a body."""

        def labels_of(name: str, card: Card) -> np.ndarray:
            return self.element_sets.labels(name, card.line)

        return read_sectors(self.text.part, labels_of)

    # -- nodes and elements ----------------------------------------------------------------------
    def _read(self) -> None:
        """Read nodes and elements, and the sets that their cards name."""
        nodes = Nodes(self.text.part, self.node_sets)
        self.numbers, self.nodes = nodes.numbers, nodes.places
        self.node_sets.all_labels = self.numbers
        text = self.text
        read = Elements(text.part, text.elements, self.numbers, self.element_sets, text.abaqus)
        if not read.blocks and not text.points_alone:
            raise self._first().error("there are no elements")
        self.blocks, self.marked = read.blocks, read.marked
        self.labels, self.by_label = read.labels, read.by_label
        self.text.passed_over += read.notes
        others = [np.array(numbers, dtype=np.int64) for _, numbers in self.text.non_solids]
        for (card, _), numbers in zip(self.text.non_solids, others, strict=True):
            if in_set := card.parameters.get("ELSET"):
                self.element_sets.add(in_set, numbers)
        element_labels = np.unique(np.concatenate([self.labels, self.marked.labels, *others]))
        self.element_sets.all_labels = element_labels

    # -- sets and surfaces -----------------------------------------------------------------------
    def _collect_sets(self) -> None:
        """Collect the sets of *ELSET and *NSET, of the part and of the assembly."""
        nodes, elements = self.assembly_sets
        for cards, node_sets, element_sets in (
            (self.text.part, self.node_sets, self.element_sets),
            (self.text.assembly, nodes, elements),
        ):
            for card in cards:
                if card.keyword == "ELSET":
                    card.check(SET)
                    element_sets.add(card.value("ELSET"), card)
                elif card.keyword == "NSET":
                    card.check(SET)
                    if "ELSET" in card.parameters:
                        labels = element_sets.labels(card.parameters["ELSET"], card.line)
                        node_sets.add(card.value("NSET"), self._nodes_of(labels))
                    else:
                        node_sets.add(card.value("NSET"), card)

    def _nodes_of(self, elements: np.ndarray) -> np.ndarray:
        """Numbers of the nodes of the elements with these labels."""
        block_nodes = [b.nodes[np.isin(b.labels, elements)].ravel() for b in self.blocks]
        return self.numbers[np.unique(np.concatenate([NO_LABELS, *block_nodes]))]

    def _nodes(self, labels: np.ndarray) -> np.ndarray:
        return np.searchsorted(self.numbers, labels)

    def _elements(self, labels: np.ndarray) -> np.ndarray:
        """Indices, ascending, of the solid elements among labels."""
        if len(self.element_sets.all_labels) > len(self.labels):
            labels = labels[np.isin(labels, self.labels)]
        indices = np.searchsorted(self.labels, labels, sorter=self.by_label)
        return np.sort(self.by_label[indices])

    def _resolved(
        self, part: Sets, assembly: Sets, places: Callable[[np.ndarray], np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Members of all sets by name; ASSEMBLY.name where part and assembly have the same name."""
        resolved = {}
        for key, name in part.shown.items():
            resolved[name] = places(part.labels(key, self._first().line))
        for key, name in assembly.shown.items():
            members = places(assembly.labels(key, self._first().line))
            if len(members):
                resolved[f"ASSEMBLY.{name}" if key in part.shown else name] = members
        return resolved

    def _with_surfaces(self, mesh: SolidMesh) -> SolidMesh:
        """The mesh with the surfaces of *SURFACE."""
        surfaces: dict[str, np.ndarray] = {}
        node_sets = dict(mesh.node_sets)
        outer = boundary(mesh)
        for cards, sets, in_assembly in (
            (self.text.part, (self.node_sets, self.element_sets), False),
            (self.text.assembly, self.assembly_sets, True),
        ):
            for card in cards:
                if card.keyword != "SURFACE":
                    continue
                card.check(SURFACE)
                name = card.value("NAME")
                kind = card.parameters.get("TYPE", "ELEMENT").upper()
                if kind == "ELEMENT":
                    members = self._faces(mesh, card, sets[1], outer)
                elif kind == "NODE":
                    members = self._nodes(self._members(card, sets[0]))
                else:
                    raise card.error(
                        f"*SURFACE, TYPE={kind} is not supported: only ELEMENT and NODE"
                    )
                by_name = surfaces if kind == "ELEMENT" else node_sets
                earlier = by_name.get(name)
                if len(members) and (earlier is None or not np.array_equal(earlier, members)):
                    by_name[_free_name(name, by_name, card, in_assembly)] = members
        return replace(mesh, surfaces=surfaces, node_sets=node_sets)

    def _with_marked_faces(self, mesh: SolidMesh) -> SolidMesh:
        """Make surfaces of element sets with plane elements that are treated as faces."""
        surfaces = dict(mesh.surfaces)
        for sets in (self.element_sets, self.assembly_sets[1]):
            for key, name in sets.shown.items():
                labels = sets.labels(key, self._first().line)
                if not np.isin(labels, self.marked.labels).any():
                    continue
                faces, note = self.marked.surface(mesh, name, labels)
                if note:
                    self.text.passed_over.append(note)
                if len(faces):
                    in_assembly = sets is not self.element_sets
                    surfaces[_free_name(name, surfaces, self._first(), in_assembly)] = faces
        sets_of_solids = {name: e for name, e in mesh.element_sets.items() if len(e)}
        return replace(mesh, surfaces=surfaces, element_sets=sets_of_solids)

    def _members(self, card: Card, sets: Sets) -> np.ndarray:
        """Labels named by the first words of a surface's lines."""
        labels = [self._named(line, line.words()[0], sets) for line in card.data]
        return np.unique(np.concatenate([NO_LABELS, *labels]))

    def _named(self, line: Line, word: str, sets: Sets) -> np.ndarray:
        """Labels that a word in a surface names: those of a set, or a single number."""
        owner, dot, label = word.rpartition(".")
        if WHOLE_NUMBER.fullmatch(label) and (sets.part is not None) == bool(dot):
            if dot and owner.upper() != sets.instance:
                return NO_LABELS
            (sets.part or sets).check(line, int(label))
            return np.array([int(label)], dtype=np.int64)
        return sets.labels(word, line)

    def _faces(self, mesh: SolidMesh, card: Card, sets: Sets, outer: np.ndarray) -> np.ndarray:
        """Faces (element, side) that the lines of a *SURFACE name."""
        face_lists = [np.zeros((0, 2), dtype=np.int64)]
        for line in card.data:
            word, *face = line.words()
            elements = self._elements(self._named(line, word, sets))
            if not face or not face[0]:
                face_lists.append(outer[np.isin(outer[:, 0], elements)])
                continue
            number = face[0].upper().removeprefix("S")
            if not WHOLE_NUMBER.fullmatch(number) or face[1:]:
                raise line.error(f"expected a face S1 to S6, found '{', '.join(face)}'")
            for block, start, end in zip(mesh.blocks, mesh.starts, mesh.starts[1:], strict=False):
                block_elements = elements[(elements >= start) & (elements < end)]
                if len(block_elements) and not 1 <= int(number) <= len(block.kind.shape.faces):
                    raise line.error(
                        f"{mesh.elements_named(block_elements)}: there is no face {face[0]}, "
                        f"only S1 to S{len(block.kind.shape.faces)}"
                    )
            face_lists.append(np.column_stack([elements, np.full(len(elements), int(number))]))
        return np.unique(np.concatenate(face_lists), axis=0)

    # -- sections and couplings ------------------------------------------------------------------
    def _with_sections(self, mesh: SolidMesh) -> SolidMesh:
        """The mesh with materials, orientations and added masses of its sections."""

        def elements_of(line: Line, word: str) -> np.ndarray:
            sets = self.element_sets
            named = word.upper() in sets.shown
            return self._elements(
                sets.labels(word, line) if named else self._named(line, word, sets)
            )

        for card in unused_distributions(self.text.part):
            self.text.note(card, "no orientation names it")
        mesh = with_sections(
            mesh, self.text.part, self.text.materials, elements_of, self.text.temperature
        )
        return with_added_mass(mesh, self.text.part, elements_of)

    def _with_couplings(self, mesh: SolidMesh) -> SolidMesh:
        """The mesh with ties, couplings, equations, masses and springs."""
        cards = (*self.text.part, *self.text.assembly)
        names = {card.value("NAME").upper() for card in cards if card.keyword == "SURFACE"} | {
            name.upper() for sets in (self.node_sets, self.assembly_sets[0]) for name in sets.shown
        }
        turn, shift = self.text.turn, self.text.shift
        turned = not np.array_equal(turn, np.eye(3))
        part = CardScope(self.text.part, self.node_sets, self.element_sets, "", names, turned)
        assembly = CardScope(self.text.assembly, *self.assembly_sets, "ASSEMBLY.", names)
        placed = replace(mesh, nodes=mesh.nodes @ turn.T + shift)
        constraints, axes = self._constraints(part, mesh, {})
        axes = {node: orientation.moved(turn, shift) for node, orientation in axes.items()}
        of_assembly, _ = self._constraints(assembly, placed, axes)  # in global directions
        constraints += [c.moved(turn.T, -turn.T @ shift) for c in of_assembly]
        mesh, abaqus = replace(mesh, constraints=tuple(constraints)), self.text.abaqus
        node_places = NodePlaces(self.node_sets, self._nodes)
        return read_discrete(mesh, self.text, node_places, self.element_sets, abaqus)

    def _constraints(
        self, scope: CardScope, mesh: SolidMesh, axes: Mapping[int, Orientation]
    ) -> tuple[list[Constraint], dict[int, Orientation]]:
        """Constraints of a part or the assembly, and axes of nodes by ``*TRANSFORM``."""
        couplings = Couplings(mesh, self._nodes, self._nodes_of, self.text.note).read(scope)
        node_places, abaqus = NodePlaces(scope.nodes, self._nodes), self.text.abaqus
        equations = Equations(
            node_places, mesh.nodes, mesh.bare, abaqus, self.text.note, scope.turned, axes
        )
        axes = equations.transforms(scope.cards)
        return [*couplings, *equations.read(scope.cards)], axes

    def _without_unused(self, mesh: SolidMesh) -> SolidMesh:
        """The mesh without nodes that no element has."""
        used = mesh.used_nodes()
        if used.all() or self.text.points_alone:
            return mesh
        unused = np.flatnonzero(~used)
        them = "them" if len(unused) > 1 else "it"
        why = f"{mesh.nodes_named(unused)}: no element has {them}"
        self.text.note(self._cards("NODE")[0], why)
        return mesh.part(np.arange(mesh.n_elements))

    def _cards(self, keyword: str) -> list[Card]:
        return [card for card in self.text.part if card.keyword == keyword]

    def _first(self) -> Card:
        return self.text.part[0]


def _free_name(
    name: str, members_by_name: Mapping[str, object], card: Card, in_assembly: bool
) -> str:
    """`name`, or ASSEMBLY.name where a part has it already; ModelError where both are taken."""
    taken_names = {n.upper() for n in members_by_name}
    if name.upper() not in taken_names:
        return name
    if not in_assembly or f"ASSEMBLY.{name}".upper() in taken_names:
        raise card.error(f"there is a '{name}' already")
    return f"ASSEMBLY.{name}"
