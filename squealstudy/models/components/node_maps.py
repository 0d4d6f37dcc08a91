"""Maps from rows of a matrix to nodes and directions, which solvers write beside matrices."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.files import OF_LINES, read_whole
from squealstudy.models.components.mesh import SolidMesh

MAPPING = ".mapping"  # suffix of ANSYS; other files have lines node.direction, as CalculiX's .dof
LINE = re.compile(r"\s*([0-9]{1,18})\.([0-9]{1,18})\s*", re.ASCII)
EQUATION = re.compile(r"\s*([0-9]{1,18})\s+([0-9]{1,18})\s+([A-Za-z]\w*)\s*", re.ASCII)
NUMBERED = re.compile(r"\s*[0-9]")
DISPLACEMENTS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
MODAL_LINE, MODAL = "modal", -1  # a row without a node


class FreedomsOf:
    """Degrees of freedom of a mesh by numbers of nodes and directions.

    Displacements are numbered 3 * node + axis; rotations follow in the same order.

    Parameters
    ----------
    mesh : SolidMesh
    name : str
        Name of its file, for messages.
    """

    def __init__(self, mesh: SolidMesh, name: str) -> None:
        self._name, self._numbers = name, mesh.numbers
        self._order = np.argsort(mesh.numbers)

    def at(self, nodes: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Degrees of freedom of nodes (m,) in directions (m,) 1 to 6; -1 for an unknown node."""
        ordered = self._numbers[self._order]
        indices = np.minimum(np.searchsorted(ordered, nodes), len(ordered) - 1)
        turns, axis = np.divmod(directions - 1, 3)
        freedom = 3 * (self._order[indices] + turns * len(ordered)) + axis
        freedoms = np.where(ordered[indices] == nodes, freedom, -1)
        return freedoms.astype(np.int64)

    @property
    def count(self) -> int:
        """Number of degrees of freedom of the nodes, from which modal coordinates are numbered."""
        return 6 * len(self._numbers)

    def unknown(self, node: int) -> str:
        """Message about a node that the mesh does not have."""
        return (
            f"{self._name} has no node {node}; its nodes are {self._numbers.min()} to "
            f"{self._numbers.max()}: is it the mesh of these matrices?"
        )


def read_map(path: Path, freedoms: FreedomsOf) -> np.ndarray:
    """Degree of freedom of each row (n,) of the matrices, as in `FreedomsOf`.

    Modal coordinates are numbered from 6 * n_nodes.

    Parameters
    ----------
    path : Path
        A file with a line ``node.direction`` or ``modal`` for each row; or a ``.mapping`` of ANSYS
        with lines of row, node and UX, UY, UZ, ROTX, ROTY or ROTZ.
    freedoms : FreedomsOf

    Raises
    ------
    ModelError
        A line is malformed, its node is not in the mesh, or it is there twice.
    """
    try:
        lines = read_whole(path, OF_LINES).decode("utf-8-sig", errors="replace").split("\n")
    except OSError as error:
        raise ModelError(f"{path} cannot be read: {error.strerror or error}") from None
    ansys = path.suffix.lower() == MAPPING
    rows: dict[int, int] = {}
    line_of: dict[int, int] = {}
    modal = freedoms.count
    for line_number, row, node, direction in (
        _equations(path, lines) if ansys else _lines(path, lines)
    ):
        where = f"{path.name}, line {line_number}"
        if direction == MODAL:
            rows[row] = modal
            modal += 1
            continue
        if direction not in range(1, 7):
            raise ModelError(f"{where}: direction {direction}: expected 1 to 6")
        (freedom,) = freedoms.at(np.array([node]), np.array([direction]))
        if freedom < 0:
            raise ModelError(f"{where}: {freedoms.unknown(node)}")
        if freedom in line_of:
            raise ModelError(f"{where}: {node}.{direction} is in line {line_of[freedom]} already")
        if row in rows:
            raise ModelError(f"{where}: equation {row} is there already")
        line_of[int(freedom)], rows[row] = line_number, int(freedom)
    missing = next((i for i in range(1, len(rows) + 1) if i not in rows), None)
    if missing is not None:
        raise ModelError(f"{path.name} has {len(rows)} equations, but none with number {missing}")
    return np.array([rows[i] for i in range(1, len(rows) + 1)], dtype=np.int64)


def _lines(path: Path, lines: list[str]) -> Iterator[tuple[int, int, int, int]]:
    """Line, row, node and direction of lines node.direction."""
    row = 0
    for line_number, text in enumerate(lines, start=1):
        if text.strip():
            row += 1
            if text.strip().lower() == MODAL_LINE:
                yield line_number, row, 0, MODAL
                continue
            match = LINE.fullmatch(text)
            if match is None:
                excerpt = text.strip()[:40]
                raise ModelError(
                    f"{path.name}, line {line_number}: expected 'node.direction' or 'modal', "
                    f"got '{excerpt}'"
                )
            yield line_number, row, int(match[1]), int(match[2])


def _equations(path: Path, lines: list[str]) -> Iterator[tuple[int, int, int, int]]:
    """Rows of lines with equation, node and name of the displacement, below titles."""
    titles = True
    for line_number, text in enumerate(lines, start=1):
        titles = titles and not NUMBERED.match(text)
        if titles or not text.strip():
            continue
        match, excerpt = EQUATION.fullmatch(text), text.strip()[:40]
        where = f"{path.name}, line {line_number}"
        if match is None:
            raise ModelError(f"{where}: expected equation, node and UX ... ROTZ, got '{excerpt}'")
        label = match[3].upper()
        if label not in DISPLACEMENTS:
            raise ModelError(f"{where}: {label}: expected one of {', '.join(DISPLACEMENTS)}")
        yield line_number, int(match[1]), int(match[2]), DISPLACEMENTS.index(label) + 1
