"""Springs, masses and ``*DISTRIBUTING COUPLING`` of files of Abaqus and CalculiX, by elements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from squealstudy.models.components.constraints import Constraint, Coupling, relation
from squealstudy.models.components.discrete import Discrete, point_mass, rigid_mass, spring
from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.components.inp_places import NodePlaces
from squealstudy.models.components.inp_sets import Sets
from squealstudy.models.components.inp_text import Text
from squealstudy.models.components.mesh import SolidMesh

POINTS = {  # types of elements at points, and their numbers of nodes
    **dict.fromkeys(("MASS", "ROTARYI", "SPRING1", "DASHPOT1", "DCOUP3D"), 1),
    **dict.fromkeys(("SPRINGA", "SPRING2", "DASHPOTA", "DASHPOT2"), 2),
}
KEYWORDS = ("MASS", "ROTARYINERTIA", "SPRING", "DISTRIBUTINGCOUPLING")
Members = dict[int, tuple[Line, str, np.ndarray]]  # by label: line, type of element, nodes


def read_discrete(
    mesh: SolidMesh, text: Text, at: NodePlaces, sets: Sets, abaqus: bool
) -> SolidMesh:
    """Add springs, masses and ``*DISTRIBUTING COUPLING`` to a mesh.

    A spring is connected to ground at a node without elements, couplings and masses.

    Parameters
    ----------
    mesh : SolidMesh
    text : Text
    at : NodePlaces
        Indices of nodes.
    sets : Sets
        Element sets.
    abaqus : bool
        In Abaqus a ``*DISTRIBUTING COUPLING`` carries moments. In CalculiX it only sets the mean
        of displacements.

    Raises
    ------
    ModelError
        About the line that is wrong or not supported.
    """
    cards = [card for card in text.part if card.keyword in KEYWORDS]
    if not cards:
        return mesh
    members = _members(text, at)
    discrete: list[Discrete] = []
    constraints: list[Constraint] = list(mesh.constraints)
    springs: list[tuple[Card, list[tuple[Line, str, np.ndarray]]]] = []
    for card in cards:
        card.check(("ELSET",))
        labels = sets.labels(card.value("ELSET"), card.line)
        elements = [members[int(label)] for label in labels if int(label) in members]
        if card.keyword == "MASS":
            mass = card.numbers("a mass", 1, 1)[0][1]
            if not mass >= 0:
                raise card.data[0].error(f"expected a mass of zero or above, got {mass:g}")
            for _, kind, nodes in elements:
                if kind == "MASS":
                    discrete.append(point_mass(card.shown, int(nodes[0]), mass))
        elif card.keyword == "ROTARYINERTIA":
            inertia = _inertia(card, text)
            nodes = np.array([int(nodes[0]) for _, kind, nodes in elements if kind == "ROTARYI"])
            discrete += _turning(card, nodes, inertia, mesh, text)
        elif card.keyword == "SPRING":
            springs.append((card, elements))
        else:
            references = [int(nodes[0]) for _, kind, nodes in elements if kind == "DCOUP3D"]
            for reference in references:
                constraints += _older(card, reference, at, abaqus)
    mesh = replace(mesh, discrete=tuple(discrete), constraints=tuple(constraints))
    ground = mesh.bare
    ground[mesh.used_without_element] = False
    for card, elements in springs:
        for line, kind, nodes in elements:
            if kind.startswith("SPRING"):
                discrete += _spring(card, line, kind, nodes, mesh, ground, text)
    return replace(mesh, discrete=tuple(discrete))


def _inertia(card: Card, text: Text) -> np.ndarray:
    """Inertia matrix (3, 3) of I11, I22, I33.

    ModelError about products of inertia, since codes differ in their sign.
    """
    if "ORIENTATION" in card.parameters:
        raise card.error(f"{card.shown}, ORIENTATION is not supported: write global moments")
    values = [moment for _, moment in card.numbers("a moment of inertia", 1, 6)]
    if len({*values[:3]}) > 1 or len(values) < 3:
        _check_directions(card, text)
    if any(values[3:]) or min(values) < 0:
        raise card.data[0].error("expected moments of inertia I11, I22, I33 and no products")
    return np.diag((values + [0.0] * 3)[:3])


def _check_directions(card: Card, text: Text) -> None:
    """Raise ModelError where the part turns with its instance."""
    if not np.array_equal(text.turn, np.eye(3)):
        raise card.error(
            f"{card.shown} has directions of a part that turns with its instance: whether they "
            "turn too is not known; state it in the model file"
        )


def _turning(
    card: Card, nodes: np.ndarray, inertia: np.ndarray, mesh: SolidMesh, text: Text
) -> Iterator[Discrete]:
    """Rotary inertia at those nodes that are reference nodes: only these have rotations."""
    references = {c.reference for c in mesh.constraints if isinstance(c, Coupling)}
    for node in nodes.tolist():
        if node in references:
            yield rigid_mass(card.shown, node, 0.0, np.zeros(3), inertia)
        else:
            named = mesh.nodes_named(np.array([node]))
            text.note(card, f"{named}: no coupling has it, so that its turns move nothing")


def _members(text: Text, at: NodePlaces) -> Members:
    """Nodes of point elements (masses and springs), by element number."""
    elements: Members = {}
    for card in text.points:
        kind = card.value("TYPE").upper()
        for line in card.data:
            words = [w for w in line.words() if w]
            if len(words) != POINTS[kind] + 1:
                raise line.error(
                    f"expected an element and {POINTS[kind]} of its nodes, found {len(words)} words"
                )
            label = line.whole(words[0], "an element number")
            nodes = [at.of(line, word) for word in words[1:]]
            elements[label] = (line, kind, np.concatenate(nodes))
    return elements


def _spring(
    card: Card,
    line: Line,
    kind: str,
    nodes: np.ndarray,
    mesh: SolidMesh,
    ground: np.ndarray,
    text: Text,
) -> Iterator[Discrete]:
    """Springs of one element: along its axis, or in the directions that its card states."""
    words = [[(data_line, w) for w in data_line.words() if w] for data_line in card.data]
    if len(words) != (1 if kind == "SPRINGA" else 2):
        raise card.error(
            "expected a line with the stiffness; for SPRING1 and SPRING2 a line with directions "
            "before it"
        )
    data_line, word = words[-1][0]
    stiffness = data_line.real(word, "a stiffness")
    if kind == "SPRINGA":
        along = mesh.nodes[nodes[1]] - mesh.nodes[nodes[0]]
        if not np.linalg.norm(along) > 0:
            raise line.error("the two nodes of the spring lie at one place")
        along = along / np.linalg.norm(along)
        ends = [(int(nodes[0]), -along), (int(nodes[1]), along)]
    else:
        _check_directions(card, text)
        ends = []
        for node, (where, direction), sign in zip(nodes, words[0], (1.0, -1.0), strict=False):
            axis = where.whole(direction, "a direction")
            if axis not in range(1, 7):
                raise where.error(f"expected a direction 1 to 6, found {axis}")
            ends.append((int(node), sign * np.eye(6)[axis - 1]))
        if len(ends) < len(nodes):
            raise card.data[0].error("expected a direction for each node of the spring")
        if not any(direction[3:].any() for _, direction in ends):
            ends = [(node, direction[:3]) for node, direction in ends]
    grounded = [node for node, _ in ends if ground[node]]
    if grounded:
        text.note(card, f"{mesh.nodes_named(np.array(grounded))}: no element: counts as ground")
    ends = [end for end in ends if not ground[end[0]]]
    if ends:
        yield spring(f"{card.shown} (line {card.line.place + 1})", ends, stiffness)


def _older(card: Card, reference: int, at: NodePlaces, abaqus: bool) -> Iterator[Constraint]:
    """The constraints of a *DISTRIBUTING COUPLING with a reference node."""
    nodes: list[np.ndarray] = []
    weights: list[np.ndarray] = []
    for line in card.data:
        words = line.words()
        nodes.append(at.of(line, words[0]))
        node_weight = line.real(words[1], "a weight") if len(words) > 1 and words[1] else 1.0
        weights.append(np.full(len(nodes[-1]), node_weight))
    others = np.concatenate([np.zeros(0, dtype=np.int64), *nodes])
    weight = np.concatenate([np.zeros(0), *weights])
    if not len(others) or not (weight > 0).all():
        raise card.error(f"{card.shown}: expected nodes with weights above zero")
    name = f"{card.shown} (line {card.line.place + 1})"
    if abaqus:
        if not (weight == weight[0]).all():
            raise card.error(f"{card.shown}: weights that differ are not supported")
        yield Coupling(name, "distributing", reference, np.setdiff1d(others, reference))
        return
    everything = np.append(reference, others)
    for axis in np.eye(3):
        factors = np.append(-weight.sum(), weight)
        yield relation(name, everything, factors[:, None] * axis)
