"""Ties, rigid bodies and couplings in files of Abaqus and CalculiX."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.constraints import NO_FACES, Constraint, Coupling, Tie
from squealstudy.models.components.faces import faces_among, facet_groups
from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_equations import TURNED
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.components.inp_orientations import read_orientation
from squealstudy.models.components.inp_places import NodePlaces
from squealstudy.models.components.inp_sectors import KEYWORD as SECTORS
from squealstudy.models.components.inp_sets import Sets
from squealstudy.models.components.materials import Orientation
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.set_names import has_name

CYCLIC = "CYCLICSYMMETRY"  # key of a tie whose master belongs to the next sector
TIE = ("NAME", "POSITIONTOLERANCE", "ADJUST", "TYPE", "NOROTATION", CYCLIC)
COUPLING = ("CONSTRAINTNAME", "REFNODE", "SURFACE", "ORIENTATION")
RIGID_BODY = ("NSET", "ELSET", "REFNODE", "ROTNODE", "TIENSET", "PINNSET")
DISTRIBUTING = ("COUPLING", "WEIGHTINGMETHOD")
NODES_TO_SURFACE = "NODETOSURFACE"
OF_COUPLING = ("KINEMATIC", "DISTRIBUTING")
KEYWORDS = ("TIE", "COUPLING", "RIGIDBODY", *OF_COUPLING)
ELSEWHERE = "state a [[tie]] or a spring in the model file, and name the keyword in pass_over"


@dataclass
class CardScope:
    """Cards and sets of a part, or of the assembly of one of its instances.

    Attributes
    ----------
    cards : sequence of Card
    nodes, elements : Sets
    prefix : str
        Prefix of names in the assembly that the part has too.
    file_names : set of str
        Names, in capitals, of all surfaces of the file, also of those of other instances.
    turned : bool
        Whether a part is turned by its instance.
    """

    cards: Sequence[Card]
    nodes: Sets
    elements: Sets
    prefix: str
    file_names: set[str]
    turned: bool = False


class Couplings:
    """Reads the ties and couplings of a component."""

    def __init__(
        self,
        mesh: SolidMesh,
        places: Callable[[np.ndarray], np.ndarray],
        nodes_of: Callable[[np.ndarray], np.ndarray],
        note: Callable[[Card, str], None],
    ) -> None:
        """`places` maps numbers of nodes to the mesh, `nodes_of` those of elements to nodes."""
        self._mesh, self._places, self._nodes_of, self._note = mesh, places, nodes_of, note

    def read(self, scope: CardScope) -> list[Constraint]:
        """Couplings of a part or of the assembly; ModelError about the line that is wrong."""
        constraints: list[Constraint | None] = []
        cards = list(scope.cards)
        for number, card in enumerate(cards):
            if card.keyword == "TIE":
                constraints += [self._tie(card, line, scope) for line in self._lines(card)]
            elif card.keyword == "RIGIDBODY":
                constraints.append(self._rigid_body(card, scope))
            elif card.keyword == "COUPLING":
                after = cards[number + 1] if number + 1 < len(cards) else None
                if after is None or after.keyword not in OF_COUPLING:
                    raise card.error("expected *KINEMATIC or *DISTRIBUTING after *COUPLING")
                constraints.append(self._coupling(card, after, scope))
            elif card.keyword in OF_COUPLING:
                before = cards[number - 1].keyword if number else ""
                if before != "COUPLING":
                    raise card.error(f"{card.shown} belongs after *COUPLING")
        return [c for c in constraints if c is not None]

    @staticmethod
    def _lines(card: Card) -> list[Line]:
        if not card.data:
            raise card.error(f"{card.shown}: expected a line with a slave and a master surface")
        return card.data

    def _tie(self, card: Card, line: Line, scope: CardScope) -> Tie | None:
        """The tie of a line of *TIE; None for other instances, or a cyclic tie without its card."""
        card.check(TIE)
        if CYCLIC in card.parameters and not any(c.keyword == SECTORS for c in scope.cards):
            self._note(card, "there is no *CYCLIC SYMMETRY MODEL that is read")
            return None
        kind = "".join(card.parameters.get("TYPE", "").upper().split())
        if kind not in ("", NODES_TO_SURFACE, "SURFACETOSURFACE"):
            raise card.error(f"*TIE, TYPE={kind} is not supported")
        words = line.words()
        if len(words) != 2:
            raise line.error("expected a slave and a master surface")
        (slave, _), (master, faces) = (self._surface(line, w, scope) for w in words)
        name = self._name(card, card.parameters.get("NAME", ""))
        if not len(slave) and not len(master):
            self._note(card, "of other instances")
            return None
        for word, members in zip(words, (slave, master), strict=True):
            if not len(members):
                raise line.error(f"'{word}' has nothing of this instance: {ELSEWHERE}")
        cyclic = CYCLIC in card.parameters
        if cyclic and not len(faces):
            faces = faces_among(self._mesh, master)
        elif not len(faces):
            raise line.error(
                f"the master '{words[1]}' has no faces: expected a surface of elements"
            )
        if kind != NODES_TO_SURFACE:
            self._note(card, "read as nodes that follow the master's surface, as CalculiX does")
        tolerance = None
        if text := card.parameters.get("POSITIONTOLERANCE"):
            tolerance = card.line.real(text, "a distance")
        adjust = card.parameters.get("ADJUST", "YES").upper()
        if adjust not in ("YES", "NO"):
            raise card.error(f"ADJUST={adjust} is not supported: expected YES or NO")
        return Tie(name, slave, faces, tolerance, adjust == "YES", cyclic=cyclic)

    def _rigid_body(self, card: Card, scope: CardScope) -> Coupling | None:
        """The coupling of a *RIGID BODY; None if it is of other instances."""
        card.check(RIGID_BODY)
        if "ROTNODE" in card.parameters:
            self._note(card, "ROT NODE: nothing can be said of its turns here")
        named = [card.parameters.get(key) for key in ("NSET", "TIENSET", "PINNSET")]
        node_lists = [self._places(scope.nodes.labels(name, card.line)) for name in named if name]
        if name := card.parameters.get("ELSET"):
            elements = scope.elements.labels(name, card.line)
            node_lists.append(self._places(self._nodes_of(elements)))
        if not node_lists:
            raise card.error("*RIGID BODY needs NSET=... or ELSET=...")
        nodes = np.unique(np.concatenate(node_lists))
        return self._coupled(card, self._name(card, ""), nodes, scope, "rigid", (1, 2, 3), NO_FACES)

    def _coupling(self, card: Card, how: Card, scope: CardScope) -> Coupling | None:
        """The coupling of a *COUPLING with its *KINEMATIC or *DISTRIBUTING card `how`."""
        card.check(COUPLING)
        name = self._name(card, card.parameters.get("CONSTRAINTNAME", ""))
        nodes, faces = self._surface(card.line, card.value("SURFACE"), scope)
        every = self._directions(how)
        directions = tuple(d for d in every if d <= 3)
        axes = None
        if "ORIENTATION" in card.parameters and directions not in ((), (1, 2, 3)):
            axes = self._axes(card, scope)
        elif scope.turned and directions not in ((), (1, 2, 3)):
            raise how.error(f"it has {TURNED}")
        if how.keyword == "KINEMATIC":
            how.check(())
            coupling = self._coupled(card, name, nodes, scope, "rigid", directions, NO_FACES)
            coupling = coupling and replace(coupling, axes=axes, turning={4, 5, 6} <= set(every))
            return self._off_axis(card, coupling, nodes)
        how.check(DISTRIBUTING)
        method = how.parameters.get("WEIGHTINGMETHOD", "UNIFORM").upper()
        if method != "UNIFORM":
            raise how.error(f"WEIGHTING METHOD={method} is not supported: expected UNIFORM")
        if not directions:
            self._note(card, "turns of the reference node alone, which has none here")
            return None
        coupling = self._coupled(card, name, nodes, scope, "distributing", directions, faces)
        coupling = coupling and replace(coupling, axes=axes)
        return self._off_axis(card, coupling, self._reference(card, scope))

    def _axes(self, card: Card, scope: CardScope) -> Orientation:
        """The ``*ORIENTATION`` of a coupling."""
        name = card.value("ORIENTATION")
        for other in scope.cards:
            if other.keyword == "ORIENTATION" and other.value("NAME").upper() == name.upper():
                return read_orientation(other)
        raise card.error(f"there is no orientation '{name}'")

    def _off_axis(self, card: Card, c: Coupling | None, nodes: np.ndarray) -> Coupling | None:
        """The coupling; ModelError where a node that follows lies on the axis of its directions."""
        if c is not None and c.axes is not None:
            for node in np.setdiff1d(nodes, c.reference if c.kind == "rigid" else []):
                try:
                    c.along(self._mesh.nodes[node])
                except ModelError as error:
                    who = self._mesh.nodes_named(np.array([node]))
                    text = f"{who} lies on the axis of the orientation, and has no direction there"
                    raise card.error(text) from error
        return c

    @staticmethod
    def _directions(card: Card) -> tuple[int, ...]:
        """Directions that the lines name; all six where there are no lines."""
        named_directions: set[int] = set()
        for line in card.data:
            words = [line.whole(w, "a direction 1 to 6") for w in line.words() if w]
            if not 1 <= len(words) <= 2 or not all(1 <= w <= 6 for w in words):
                raise line.error("expected the first and the last of the directions 1 to 6")
            named_directions |= set(range(words[0], words[-1] + 1))
        return tuple(d for d in range(1, 7) if d in named_directions or not card.data)

    def _coupled(
        self,
        card: Card,
        name: str,
        nodes: np.ndarray,
        scope: CardScope,
        kind: str,
        directions: tuple[int, ...],
        faces: np.ndarray,
    ) -> Coupling | None:
        """A coupling of nodes to their reference node; None if it is of other instances."""
        reference = self._reference(card, scope)
        if not len(nodes) and not len(reference):
            self._note(card, "of other instances")
            return None
        if len(reference) != 1:
            raise card.error(
                f"REF NODE={card.value('REFNODE')} is {len(reference)} nodes of this part: "
                "expected one; a reference node of the assembly belongs into the part"
            )
        if not directions:
            raise card.error(f"{card.shown}: none of the directions 1 to 3 is coupled")
        others = np.setdiff1d(nodes, reference)
        if not len(others):
            raise card.error(f"{card.shown}: it has no node of this instance: {ELSEWHERE}")
        rigid = kind == "rigid"
        reference_index = int(reference[0])
        return Coupling(
            name, "rigid" if rigid else "distributing", reference_index, others, directions, faces
        )

    def _reference(self, card: Card, scope: CardScope) -> np.ndarray:
        """Place of the reference node: a number, instance.number, or a set of one node."""
        return NodePlaces(scope.nodes, self._places).of(card.line, card.value("REFNODE"))

    def _surface(self, line: Line, word: str, scope: CardScope) -> tuple[np.ndarray, np.ndarray]:
        """Nodes of a surface and its faces; a node set has no faces."""
        mesh = self._mesh
        for name in (scope.prefix + word, word):
            if has_name(mesh.surfaces, name):
                faces = mesh.find("surfaces", name)
                nodes = [g.nodes.ravel() for g in facet_groups(mesh, faces)]
                return np.unique(np.concatenate(nodes)), faces
            if has_name(mesh.node_sets, name):
                return mesh.node_set(name), NO_FACES
        owner, _, inner = word.rpartition(".")
        if scope.prefix and owner and owner.upper() == scope.nodes.instance:
            return self._surface(line, inner, scope)
        if inner.upper() in scope.file_names:
            return np.zeros(0, dtype=np.int64), NO_FACES
        names = ", ".join([*mesh.surfaces, *mesh.node_sets]) or "none"
        raise line.error(f"there is no surface '{word}'; there is {names}")

    @staticmethod
    def _name(card: Card, name: str) -> str:
        called = f" {name}" if name else ""
        return f"{card.shown}{called} (line {card.line.place + 1})"
