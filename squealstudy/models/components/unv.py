"""Components from universal files (``.unv``) of I-deas and Salome.

Reads nodes (datasets 2411 and 781), elements (2412) and groups (2467, 2477, 2452, 2435). The
library pyuff is not used: it reads one line of nodes for each element, and quadratic elements have
two or three.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.faces import faces_with_corners
from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.components.mesh import ElementBlock, PassedOver, SolidMesh
from squealstudy.models.matrices.text import TextFile

MARK = "-1"  # the line around each dataset
NODES, ELEMENTS = ("2411", "781"), ("2412",)
GROUPS = ("2467", "2477", "2452", "2435")
# number of the element -> formulation, columns of its nodes in our order: in files middle nodes
# stand between the corners of their edges (dataset 2412, I-deas Test Universal File Datasets)
SOLIDS: dict[int, tuple[str, tuple[int, ...]]] = {
    111: ("C3D4", tuple(range(4))),
    112: ("C3D6", tuple(range(6))),
    115: ("C3D8", tuple(range(8))),
    118: ("C3D10", (0, 2, 4, 9, 1, 3, 5, 6, 7, 8)),
    113: ("C3D15", (0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8)),
    116: ("C3D20", (0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11)),
}
PLATES = {  # number of the element -> columns of its corners
    **dict.fromkeys((41, 51, 61, 74, 81, 91), (0, 1, 2)),
    **dict.fromkeys((42, 52, 62, 72, 82, 92), (0, 2, 4)),
    **dict.fromkeys((44, 54, 64, 71, 84, 94), (0, 1, 2, 3)),
    **dict.fromkeys((45, 55, 65, 75, 85, 95), (0, 2, 4, 6)),
}
BEAMS = (11, 21, 22, 23, 24)  # elements with an additional line before that of the nodes
OF_NODE, OF_ELEMENT = 7, 8  # kinds of members of groups
OFF = 0.6  # largest distance of a middle node from the middle of its edge, over the edge


def read_unv(path: Path, *, treat_as: Mapping[str, str] | None = None) -> SolidMesh:
    """Read a component from a universal file, in the units of its numbers, without materials.

    Groups of solids are element sets, groups of plates on the boundary are surfaces, groups of
    nodes are node sets.

    Parameters
    ----------
    path : Path
    treat_as : dict of str -> str
        Formulations to use in place of others with as many nodes, such as C3D8I for C3D8.

    Raises
    ------
    ModelError
        The file cannot be read, has no solid element, or has a line that is malformed or refers to
        what it lacks; `treat_as` has an unknown word.
    """
    names = _treated(path, treat_as or {})
    try:
        text = TextFile.read(path)
    except (OSError, EOFError) as error:
        raise ModelError(f"{path} cannot be read: {error}") from error
    return _Reader(path, text, names).mesh()


def _treated(path: Path, treat_as: Mapping[str, str]) -> dict[str, str]:
    """Formulation of each kind of element, changed by `treat_as`."""
    formulation_of = {name: name for name, _ in SOLIDS.values()}
    for old, new in treat_as.items():
        if old not in formulation_of or new not in FORMULATIONS:
            names = ", ".join(formulation_of)
            raise ModelError(
                f"{path}: treat_as {old} = '{new}': expected one of {names} and a formulation of "
                f"{', '.join(FORMULATIONS)}"
            )
        formulation_of[old] = new
    return formulation_of


class _Reader:
    """The datasets of a file, and the component that they describe."""

    def __init__(self, path: Path, text: TextFile, names: Mapping[str, str]) -> None:
        self._path, self._text, self._names = path, text, names
        self._nodes: dict[int, list[float]] = {}
        self._rows: dict[str, list[tuple[int, list[int], Line]]] = {}
        self._plates: dict[int, tuple[list[int], Line]] = {}
        self._groups: list[tuple[str, list[tuple[int, int]]]] = []
        self._others: dict[str, Line] = {}

    def mesh(self) -> SolidMesh:
        """The component."""
        for kind, lines in self._datasets():
            if kind in NODES:
                self._read_nodes(lines)
            elif kind in ELEMENTS:
                self._read_elements(lines)
            elif kind in GROUPS:
                self._read_groups(lines)
            elif lines:
                self._others.setdefault(f"dataset {kind}", lines[0])
        if not self._nodes or not self._rows:
            raise ModelError(f"{self._path} has no solid element in datasets 2411 and 2412")
        numbers = np.array(sorted(self._nodes), dtype=np.int64)
        index_of_node = {int(n): k for k, n in enumerate(numbers)}
        blocks = tuple(self._block(name, rows, index_of_node) for name, rows in self._rows.items())
        X = np.array([self._nodes[int(n)] for n in numbers])
        mesh = SolidMesh(self._path, X, numbers, blocks)
        self._check_middles(mesh)
        mesh = self._with_groups(mesh, index_of_node)
        notes = [
            PassedOver(what, self._path, line.place + 1, "neither nodes, solids nor groups")
            for what, line in self._others.items()
        ]
        used = mesh.used_nodes()
        if not used.all():
            why = f"{mesh.nodes_named(np.flatnonzero(~used))}: no solid element has them"
            notes.append(PassedOver("dataset 2411", self._path, 0, why))
            mesh = mesh.part(np.arange(mesh.n_elements))
        return replace(mesh, passed_over=(*mesh.passed_over, *notes))

    def _datasets(self) -> Iterator[tuple[str, list[Line]]]:
        """Number and lines of each dataset."""
        lines = self._text.lines
        line_number = 0
        while line_number < len(lines):
            if lines[line_number].strip() != MARK:
                line_number += 1
                continue
            start = line_number + 1
            line_number = start + 1
            while line_number < len(lines) and lines[line_number].strip() != MARK:
                line_number += 1
            if line_number >= len(lines):
                break_at = Line(self._text, min(start, len(lines) - 1))
                raise break_at.error("this dataset has no end, -1")
            kind = lines[start].strip()
            yield kind, [Line(self._text, k) for k in range(start + 1, line_number)]
            line_number += 1

    @staticmethod
    def _whole(line: Line, minimum: int) -> list[int]:
        numbers = [line.whole(word, "a whole number") for word in line.text.split()]
        if len(numbers) < minimum:
            raise line.error(f"expected {minimum} whole numbers, found {len(numbers)}")
        return numbers

    def _read_nodes(self, lines: list[Line]) -> None:
        """Read a dataset of nodes."""
        if len(lines) % 2:
            raise lines[-1].error("expected two lines a node")
        for head, line in zip(lines[::2], lines[1::2], strict=True):
            number = self._whole(head, 1)[0]
            x = [line.real(word, "a coordinate") for word in line.text.split()]
            if len(x) != 3:
                raise line.error(f"expected three coordinates, found {len(x)}")
            if self._nodes.setdefault(number, x) != x:
                raise head.error(f"node {number} is there twice, at different places")

    def _read_elements(self, lines: list[Line]) -> None:
        """Read a dataset of elements: solids, and plates that mark surfaces."""
        rest = iter(lines)
        labels: set[int] = set()
        for head in rest:
            label, kind, *_, count = self._whole(head, 6)[:6]
            if kind in BEAMS:
                next(rest, None)
            nodes: list[int] = []
            while len(nodes) < count:
                line = next(rest, None)
                if line is None:
                    raise head.error(f"element {label}: expected {count} nodes, found {len(nodes)}")
                nodes += self._whole(line, 1)
            if label in labels:
                raise head.error(f"element {label} is there twice")
            labels.add(label)
            if kind in SOLIDS:
                name, order = SOLIDS[kind]
                if len(nodes) != len(order):
                    text = f"element {label}: expected {len(order)} nodes, found {len(nodes)}"
                    raise head.error(text)
                ordered_nodes = [nodes[k] for k in order]
                self._rows.setdefault(self._names[name], []).append((label, ordered_nodes, head))
            elif kind in PLATES:
                self._plates[label] = [nodes[k] for k in PLATES[kind] if k < len(nodes)], head
            else:
                self._others.setdefault(f"elements {kind}", head)

    def _read_groups(self, lines: list[Line]) -> None:
        """Read a dataset of groups, with the kinds and numbers of their members."""
        rest = iter(lines)
        for head in rest:
            count = self._whole(head, 8)[7]
            named = next(rest, None)
            if named is None:
                raise head.error("expected the name of a group")
            numbers: list[int] = []
            while len(numbers) < 4 * count:
                line = next(rest, None)
                if line is None:
                    raise head.error(f"expected {count} members of a group")
                numbers += self._whole(line, 4)
            members = [(numbers[k], numbers[k + 1]) for k in range(0, 4 * count, 4)]
            self._groups.append((named.text.strip() or f"GROUP{self._whole(head, 8)[0]}", members))

    def _block(
        self, name: str, rows: list[tuple[int, list[int], Line]], index_of_node: Mapping[int, int]
    ) -> ElementBlock:
        """The block of elements of one formulation."""
        for label, nodes, line in rows:
            missing = next((n for n in nodes if n not in index_of_node), None)
            if missing is not None:
                raise line.error(f"element {label} has node {missing}, which does not exist")
        node_indices = np.array([[index_of_node[n] for n in nodes] for _, nodes, _ in rows])
        return ElementBlock(name, node_indices, np.array([label for label, *_ in rows]))

    def _check_middles(self, mesh: SolidMesh) -> None:
        """Raise ModelError if middle nodes are off their edges: programs order them differently."""
        for block, start in zip(mesh.blocks, mesh.starts, strict=False):
            shape = block.kind.shape
            X = mesh.nodes[block.nodes]
            for node in range(shape.nodes):
                if shape.is_corner(node):
                    continue
                a, b = next(
                    (a, b)
                    for a, b in sorted(shape.edges)
                    if np.allclose(shape.places[[a, b]].mean(axis=0), shape.places[node])
                )
                off = np.linalg.norm(X[:, node] - (X[:, a] + X[:, b]) / 2, axis=1)
                wrong = off > OFF * np.linalg.norm(X[:, a] - X[:, b], axis=1)
                if wrong.any():
                    named = mesh.elements_named(start + np.flatnonzero(wrong))
                    raise mesh.error(f"{named}: middle nodes that are not on their edges")

    def _with_groups(self, mesh: SolidMesh, index_of_node: Mapping[int, int]) -> SolidMesh:
        """The mesh with sets and surfaces from the groups."""
        place_of = {int(label): k for k, label in enumerate(mesh.labels)}
        node_sets: dict[str, np.ndarray] = {}
        element_sets: dict[str, np.ndarray] = {}
        surfaces: dict[str, np.ndarray] = {}
        notes = []
        for name, members in self._groups:
            nodes = [
                index_of_node[n] for kind, n in members if kind == OF_NODE and n in index_of_node
            ]
            elements = [place_of[n] for kind, n in members if kind == OF_ELEMENT and n in place_of]
            plates = [
                self._plates[n] for kind, n in members if kind == OF_ELEMENT and n in self._plates
            ]
            if nodes:
                node_sets[name] = np.union1d(node_sets.get(name, []), nodes).astype(np.int64)
            if elements:
                merged = np.union1d(element_sets.get(name, []), elements)
                element_sets[name] = merged.astype(np.int64)
            corners = [[index_of_node[n] for n in c if n in index_of_node] for c, _ in plates]
            corners = [c + [-1] * (4 - len(c)) for c in corners if len(c) >= 3]
            if corners:
                faces, is_face = faces_with_corners(mesh, np.array(corners))
                if len(faces):
                    surfaces[name] = faces
                if not is_face.all():
                    missing = f"{(~is_face).sum()} of {len(is_face)} faces"
                    why = f"{missing} are not on the boundary of the solid"
                    notes.append(PassedOver(f"group {name}", self._path, 0, why))
        return replace(
            mesh,
            node_sets=node_sets,
            element_sets=element_sets,
            surfaces=surfaces,
            passed_over=(*mesh.passed_over, *notes),
        )
