"""Equations between displacements in files of Abaqus and CalculiX: ``*EQUATION``, ``*MPC``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from squealstudy.models.components.constraints import Coupling, Relation, relation
from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.components.inp_orientations import read_orientation
from squealstudy.models.components.inp_places import NodePlaces
from squealstudy.models.components.materials import Orientation

EQUAL_MPC_TYPES = ("TIE", "PIN")  # types of *MPC: the displacements of two nodes are equal
ALONG = {"STRAIGHT": 2, "PLANE": 3}  # types of CalculiX: number of nodes that span the line, plane
TURNED = (
    "directions of a part that turns with its instance: whether they turn too is not known; "
    "expected axes of its own (ORIENTATION, of an equation *TRANSFORM), or the keyword in the "
    "assembly"
)
OFF = 1e-6  # largest distance of nodes from their line or plane, over the extent of all nodes
ROPE = ", a largest distance of two nodes (BEAM keeps their distance)"
KEYWORDS = ("EQUATION", "MPC", "TRANSFORM")
PASTE = 'where neither mass nor stiffness depend on it: pass_over = ["MPC"]'


class Equations:
    """Reader of the relations between displacements of a component.

    Parameters
    ----------
    places : NodePlaces
        Indices of the nodes that words name.
    nodes : ndarray (n, 3)
        Coordinates, in the unit of the file.
    bare : ndarray (n,) of bool
        Whether nodes belong to no element.
    abaqus : bool
        Whether ``*MPC`` is that of Abaqus; else that of CalculiX.
    note : callable
        Called with a card, and why something on it is passed over.
    turned : bool
        Whether the part turns with its instance. Directions by ``*TRANSFORM`` turn with it. For
        others Abaqus does not say.
    axes : dict of int -> Orientation
        Axes that nodes have already, by index.
    """

    def __init__(
        self,
        places: NodePlaces,
        nodes: np.ndarray,
        bare: np.ndarray,
        abaqus: bool,
        note: Callable[[Card, str], None],
        turned: bool = False,
        axes: Mapping[int, Orientation] | None = None,
    ) -> None:
        self._turned = turned
        self._at, self._nodes, self._bare = places, nodes, bare
        self._abaqus, self._note = abaqus, note
        self._axes = dict(axes or {})

    def transforms(self, cards: Sequence[Card]) -> dict[int, Orientation]:
        """Take axes of nodes from ``*TRANSFORM``, for `read`; returns the axes of all nodes."""
        for card in cards:
            if card.keyword == "TRANSFORM":
                self._transform(card)
        return self._axes

    def read(self, cards: Sequence[Card]) -> Iterator[Relation | Coupling]:
        """Relations and couplings of a part or the assembly; ModelError about a wrong line."""
        beams: dict[int, tuple[str, list[int]]] = {}
        for card in cards:
            if card.keyword == "EQUATION":
                yield from self._equation(card)
            elif card.keyword == "MPC":
                yield from self._mpc(card, beams)
        for reference, (name, nodes) in beams.items():
            yield Coupling(name, "rigid", reference, np.unique(nodes))

    def _transform(self, card: Card) -> None:
        """Take the axes in which equations of some nodes are written."""
        self._note(card, "directions of supports and loads are stated in the model file")
        kind = card.parameters.get("TYPE", "R").upper()
        if kind not in ("R", "C"):
            return  # spherical: axes of these nodes are not known
        words = {"SYSTEM": "RECTANGULAR" if kind == "R" else "CYLINDRICAL", "NAME": "axes"}
        axes = read_orientation(Card("ORIENTATION", words, card.line, card.data[:1]))
        for node in self._at.of(card.line, card.value("NSET")):
            self._axes[int(node)] = axes

    def _direction(self, node: int, axis: int) -> np.ndarray:
        if node not in self._axes:
            return np.eye(3)[axis]
        direction: np.ndarray = self._axes[node].axes(self._nodes[node][None])[0, axis]
        return direction

    # -- equations -------------------------------------------------------------------------------
    def _equation(self, card: Card) -> Iterator[Relation]:
        """Linear relations between degrees of freedom, from an *EQUATION."""
        lines = iter(card.data)
        for line in lines:
            count = line.whole(line.words()[0], "the number of terms")
            terms: list[tuple[Line, list[str]]] = []
            while len(terms) < count:
                more = next(lines, None)
                if more is None:
                    raise line.error(f"expected {count} terms of an equation, found {len(terms)}")
                words = [w for w in more.words() if w]
                if len(words) % 3:
                    raise more.error("expected terms of a node, a direction and a factor")
                terms += [(more, words[k : k + 3]) for k in range(0, len(words), 3)]
            if len(terms) > count:
                raise line.error(f"expected {count} terms of an equation, found {len(terms)}")
            yield from self._terms(card, line, terms)

    def _terms(
        self, card: Card, line: Line, terms: list[tuple[Line, list[str]]]
    ) -> Iterator[Relation]:
        """The equations of some terms: one for each node of the first term."""
        parts = []
        directions = set()
        for data_line, (word, direction, factor) in terms:
            directions.add(data_line.whole(direction, "a direction"))
            nodes = self._at.of(data_line, word)
            parts.append((nodes, int(direction) - 1, data_line.real(factor, "a factor")))
        if not directions <= {1, 2, 3}:
            if directions & {4, 5, 6}:
                raise line.error("an equation of turns, which nodes of solids do not have")
            self._note(card, "an equation without displacements")
            return
        if not sum(len(nodes) for nodes, _, _ in parts):
            self._note(card, "of other instances")
            return
        if self._turned and any(int(n) not in self._axes for nodes, _, _ in parts for n in nodes):
            raise line.error(f"an equation of {TURNED}")
        size = len(parts[0][0])
        for nodes, _, _ in parts:
            if len(nodes) not in (1, size) or not size:
                raise line.error(f"expected one node or {size} in each term, found {len(nodes)}")
        name = f"{card.shown} (line {line.place + 1})"
        for k in range(size):
            nodes = np.array([members[k if len(members) > 1 else 0] for members, _, _ in parts])
            vectors = np.array(
                [
                    coefficient * self._direction(int(node), axis)
                    for node, (_, axis, coefficient) in zip(nodes, parts, strict=True)
                ]
            )
            if self._bare[nodes].all():
                self._note(card, "nodes of no element")
                continue
            equation = relation(name, nodes, vectors)
            if not np.abs(equation.vectors[0]).max() > 0:
                raise line.error("the factor of the first term is zero")
            yield equation

    # -- multi-point constraints -----------------------------------------------------------------
    def _mpc(self, card: Card, beams: dict[int, tuple[str, list[int]]]) -> Iterator[Relation]:
        """Linear relations between degrees of freedom, from an *MPC."""
        for line in card.data:
            kind, *words = line.words()
            kind = kind.upper()
            if kind == "MEANROT" and words and self._bare[self._at.of(line, words[-1])].all():
                self._note(
                    card, f"nothing holds node {words[-1]}, which has the mean turn of others"
                )
                continue
            if kind in ALONG and not self._abaqus:
                yield from self._along(line, kind, words)
                continue
            supported = (
                (*EQUAL_MPC_TYPES, "LINK", "BEAM")
                if self._abaqus
                else (*EQUAL_MPC_TYPES, *ALONG, "BEAM")
            )
            if kind not in supported:
                why = ROPE if kind == "DIST" and not self._abaqus else ""
                raise line.error(
                    f"*MPC of type {kind} is not supported{why}: supported are "
                    f"{', '.join(supported)}; {PASTE}"
                )
            if len(words) != 2:
                raise line.error("expected a type and two nodes or sets")
            first, second = (self._at.of(line, word) for word in words)
            if not len(first) and not len(second):
                self._note(card, "of other instances")
                continue
            if not len(first) or len(second) not in (1, len(first)):
                raise line.error(f"expected as many nodes, found {len(first)} and {len(second)}")
            name = f"*MPC {kind} (line {line.place + 1})"
            for k, first_node in enumerate(first):
                other = second[k if len(second) > 1 else 0]
                if first_node == other:
                    continue
                if kind == "BEAM" and self._abaqus:
                    beams.setdefault(int(other), (name, []))[1].append(int(first_node))
                    continue
                pair = np.array([first_node, other])
                if kind in EQUAL_MPC_TYPES:
                    for axis in np.eye(3):
                        yield relation(name, pair, np.array([axis, -axis]))
                    continue
                along = self._nodes[first_node] - self._nodes[other]
                if not np.linalg.norm(along) > 0:
                    raise line.error("the two nodes lie at one place")
                along = along / np.linalg.norm(along)
                yield relation(name, pair, np.array([along, -along]))

    def _along(self, line: Line, kind: str, words: list[str]) -> Iterator[Relation]:
        """Nodes that stay, in small motions, on the line or plane of two or three of them.

        These are the first that are not in one place, or for a plane not on one line.
        """
        parts = [self._at.of(line, word) for word in words]
        nodes = np.concatenate([np.zeros(0, dtype=np.int64), *parts])
        _, first = np.unique(nodes, return_index=True)
        nodes = nodes[np.sort(first)]
        few = ALONG[kind]
        if len(nodes) <= few:
            raise line.error(f"expected more than {few} nodes of a {kind.lower()} MPC")
        x = self._nodes[nodes]
        chosen = _spanning(x, few)
        if chosen is None:
            raise line.error(f"no {few} of its nodes give a {'line' if few == 2 else 'plane'}")
        start, sides = x[chosen[0]], x[chosen[1:]] - x[chosen[0]]
        across = np.linalg.svd(sides)[2][few - 1 :]  # directions out of the line or plane
        size = np.ptp(x, axis=0).max()
        for k in np.setdiff1d(np.arange(len(nodes)), chosen):
            share = np.linalg.lstsq(sides.T, x[k] - start, rcond=None)[0]
            if np.linalg.norm(x[k] - start - sides.T @ share) > OFF * size:
                shape = "line" if few == 2 else "plane"
                raise line.error(f"node {k + 1} of {len(nodes)} of the MPC lies off the {shape}")
            factors = np.append(1 - share.sum(), share)
            related_nodes = np.append(nodes[k], nodes[chosen])
            for axis in across:
                vectors = np.append(1.0, -factors)[:, None] * axis
                yield relation(f"*MPC {kind} (line {line.place + 1})", related_nodes, vectors)


def _spanning(x: np.ndarray, few: int) -> np.ndarray | None:
    """Indices (few,) of the first nodes of x (n, 3) that span a line or plane; None without."""
    chosen = [0]
    for k in range(1, len(x)):
        sides = x[[*chosen[1:], k]] - x[chosen[0]]
        s = np.linalg.svd(sides, compute_uv=False)
        if s[-1] > OFF * s[0]:
            chosen.append(k)
        if len(chosen) == few:
            return np.array(chosen)
    return None
