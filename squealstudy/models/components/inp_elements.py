"""Elements of a part: ``*ELEMENT``, ``*ELGEN`` of Abaqus, and plane elements that mark faces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.components.inp_nodes import MAX_GENERATED
from squealstudy.models.components.inp_sets import NO_LABELS, Sets
from squealstudy.models.components.marked_faces import FACES, NODES, MarkedFaces
from squealstudy.models.components.mesh import ElementBlock, PassedOver

ELEMENT = ("TYPE", "ELSET", "INPUT")
GENERATED = ("ELSET", "ALLNODES")
KEYWORDS = ("ELEMENT", "ELGEN")
Tables = list[tuple[np.ndarray, np.ndarray]]  # labels (n,), numbers of their nodes (n, k)


class Elements:
    """The elements of a part.

    Attributes
    ----------
    blocks : list of ElementBlock
        Solid elements.
    marked : MarkedFaces
        Plane elements that mark faces.
    labels : ndarray (n,) of int
        Of all solid elements, block after block.
    by_label : ndarray (n,) of int
        Indices of solid elements in the order of their labels.
    notes : list of PassedOver
        On lines with numbers after the nodes of an element.
    """

    def __init__(
        self,
        cards: Sequence[Card],
        kinds: Mapping[str, str],
        numbers: np.ndarray,
        sets: Sets,
        abaqus: bool,
    ) -> None:
        """Read the cards; ModelError about a line that is wrong.

        `kinds` has the formulation of each type of element, `numbers` (n_nodes,) the numbers of
        nodes, ascending. Element sets that the cards name are added to `sets`.
        """
        self._kinds, self._numbers, self._sets, self._abaqus = kinds, numbers, sets, abaqus
        self._beyond: dict[int, Line] = {}  # lines with more numbers than nodes
        self._first: dict[int, Line] = {}
        self.marked = MarkedFaces()
        parts: dict[str, Tables] = {}
        for card in cards:
            if card.keyword == "ELEMENT":
                self._read(card, parts)
            elif card.keyword == "ELGEN":
                self._generate(card, parts)
        self.blocks = [
            ElementBlock(
                name,
                np.searchsorted(numbers, np.concatenate([nodes for _, nodes in tables])),
                np.concatenate([labels for labels, _ in tables]),
            )
            for name, tables in parts.items()
        ]
        self.labels = np.concatenate([NO_LABELS, *(b.labels for b in self.blocks)])
        self.by_label = np.argsort(self.labels)
        why = "numbers after the {} nodes of an element, which CalculiX ignores"
        self.notes = [
            PassedOver("*ELEMENT", line.file.path, line.place + 1, why.format(k))
            for k, line in self._beyond.items()
        ]

    def _read(self, card: Card, parts: dict[str, Tables]) -> None:
        """Read an *ELEMENT card: solids, or faces that mark surfaces."""
        card.check(ELEMENT)
        name = self._kinds[card.value("TYPE").upper()]
        if name == FACES:
            labels, nodes = self._records(card, NODES[card.value("TYPE").upper()])
            self.marked.add(labels, np.searchsorted(self._numbers, nodes))
        else:
            labels, nodes = self._records(card, FORMULATIONS[name].shape.nodes)
            parts.setdefault(name, []).append((labels, nodes))
        if in_set := card.parameters.get("ELSET"):
            self._sets.add(in_set, labels)

    def _records(self, card: Card, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Labels (n,) and node numbers (n, k) of elements; an element may take several lines."""
        records: list[list[int]] = []
        begun: list[int] = []
        starts: list[Line] = []
        for line in card.data:
            words = line.words()
            if not begun:
                starts.append(line)
                if len(words) > k + 1 and not self._abaqus:
                    self._beyond.setdefault(k, line)  # CalculiX ignores them
                    words = words[: k + 1]
            begun += [line.whole(w, "an element or node number") for w in words]
            if len(begun) > k + 1:
                message = f"expected an element and its {k} nodes, found {len(begun)} numbers"
                raise starts[-1].error(message)
            if len(begun) == k + 1:
                self._check_new(begun[0], line, starts[-1])
                records.append(begun)
                begun = []
        if begun:
            message = f"expected an element and its {k} nodes, found {len(begun)} numbers"
            raise starts[-1].error(message)
        table = np.array(records, dtype=np.int64).reshape(-1, k + 1)
        self._check_nodes(table, starts)
        return table[:, 0], table[:, 1:]

    def _check_new(self, label: int, line: Line, start: Line) -> None:
        """Raise ModelError for an element number that occurs twice."""
        if label in self._first:
            first_line = self._first[label]
            raise line.error(
                f"element {label} is there twice, first in line {first_line.place + 1} of "
                f"{first_line.file.path}"
            )
        self._first[label] = start

    def _check_nodes(self, table: np.ndarray, starts: Sequence[Line]) -> None:
        """Raise ModelError about unknown nodes of elements, rows (n, 1 + k) of label and nodes."""
        indices = np.searchsorted(self._numbers, table[:, 1:])
        indices[indices == len(self._numbers)] = 0
        wrong = self._numbers[indices] != table[:, 1:]
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            label, node = table[row, 0], table[row, column + 1]
            raise starts[row].error(f"element {label} has node {node}, which does not exist")

    def _generate(self, card: Card, parts: dict[str, Tables]) -> None:
        """Add copies of an element in rows and layers; labels and nodes increase in equal steps."""
        card.check(GENERATED)
        if "ALLNODES" in card.parameters:
            raise card.error("*ELGEN, ALL NODES is not supported: write the elements")
        members: list[np.ndarray] = []
        for line in card.data:
            words = line.words()
            if not 2 <= len(words) <= 10:
                raise line.error("expected an element, numbers of copies and steps of numbers")
            parameters = [line.whole(w, "a whole number") if w else 1 for w in words]
            parameters += [1] * (10 - len(parameters))
            counts, node_steps, steps = (np.array(parameters[k::3]) for k in (1, 2, 3))
            if not (counts >= 1).all() or np.prod(counts.astype(float)) > MAX_GENERATED:
                raise line.error(f"expected counts from 1, and at most {MAX_GENERATED} elements")
            name, nodes = self._named(line, parameters[0], parts)
            k = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
            k = k.reshape(-1, 3)[1:]  # the first is the element itself
            labels = parameters[0] + k @ steps
            table = np.column_stack([labels, nodes + (k @ node_steps)[:, None]])
            for label in labels.tolist():
                self._check_new(label, line, line)
            self._check_nodes(table, [line] * len(table))
            parts[name].append((table[:, 0], table[:, 1:]))
            members.append(np.append(labels, parameters[0]))
        if (in_set := card.parameters.get("ELSET")) and members:
            self._sets.add(in_set, np.concatenate(members))

    def _named(self, line: Line, label: int, parts: Mapping[str, Tables]) -> tuple[str, np.ndarray]:
        """Formulation and node numbers (k,) of a solid element; ModelError where it is unknown."""
        for name, tables in parts.items():
            for labels, nodes in tables:
                row = np.flatnonzero(labels == label)
                if len(row):
                    return name, nodes[row[0]]
        raise line.error(f"there is no solid element {label} yet")
