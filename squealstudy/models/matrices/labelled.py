"""Matrices whose entries name nodes and directions, from Abaqus and Nastran (DMIG)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.matrices.entries import Refusal, square_of_entries, symmetric_of_pairs
from squealstudy.models.matrices.text import TextFile, read_table, shortened

LABEL_COLUMNS = ("row node", "row direction", "column node", "column direction")
# least diagonal entry that stands for a boundary condition, for which Abaqus writes 1e36
ABAQUS_CONSTRAINT_DIAGONAL = 1e30
DIRECTIONS = (1, 2, 3, 4, 5, 6)  # displacements and rotations
SLOTS_PER_NODE = 7  # directions of a node, with 0 of a scalar point


@dataclass(frozen=True)
class LabelledMatrix:
    """A matrix with a node and a direction for each row.

    Attributes
    ----------
    nodes, directions : ndarray (n,) of int
        Numbers of nodes as in the file, ascending. Directions are 1 to 3 for displacements, 4 to 6
        for rotations, and 0 for scalar points.
    matrix : csr_matrix (n, n)
    """

    nodes: np.ndarray
    directions: np.ndarray
    matrix: sp.csr_matrix


def labelled_matrix(
    labels: np.ndarray,
    values: np.ndarray,
    refused: Refusal,
    both_triangles: bool = False,
    scalars: bool = False,
    square: bool = False,
) -> LabelledMatrix:
    """The matrix of entries, which are in one triangle, or in both with equal values.

    Parameters
    ----------
    labels : ndarray (m, 4) of int
        Node and direction of the row, then of the column.
    values : ndarray (m,)
    refused : callable
        Makes the error about an entry.
    both_triangles : bool
        Whether an entry without a partner in the other triangle is refused.
    scalars : bool
        Whether direction 0 is allowed, that of a scalar point (a modal coordinate).
    square : bool
        Whether all entries are given, so that the matrix need not be symmetric.

    Raises
    ------
    ModelError
        A node or direction is not valid; an entry stands for a boundary condition or is there
        twice; the matrix is not symmetric.
    ValueError
        There are no entries.
    """
    allowed_directions = (*DIRECTIONS, 0) if scalars else DIRECTIONS
    for node, direction in ((0, 1), (2, 3)):
        _check(labels[:, node] < 1, refused, labels[:, node], "a node of the mesh (internal ones "
               "of a connector, contact or rigid body cannot be taken over)")  # fmt: skip
        _check(~np.isin(labels[:, direction], allowed_directions), refused, labels[:, direction],
               "a direction 1 to 6 (no modal coordinates)")  # fmt: skip
    is_constrained = np.abs(values) >= ABAQUS_CONSTRAINT_DIAGONAL
    if is_constrained.any():
        k = int(is_constrained.argmax())
        raise refused(
            k,
            f"{values[k]:g} stands for a boundary condition: write the matrices without, and hold "
            "the nodes by [[fixed]]",
        )
    if not len(values):
        raise ValueError("it has no entries")
    numbers, freedom_index = np.unique(labels[:, [0, 2]], return_inverse=True)
    freedom = SLOTS_PER_NODE * freedom_index.reshape(-1, 2) + labels[:, [1, 3]]
    freedoms, number = np.unique(freedom, return_inverse=True)
    row, column = number.reshape(-1, 2).T
    if square:
        matrix = square_of_entries(row, column, values, len(freedoms), refused)
    else:
        matrix = symmetric_of_pairs(row, column, values, len(freedoms), refused, both_triangles)
    nodes, directions = np.divmod(freedoms, SLOTS_PER_NODE)
    return LabelledMatrix(numbers[nodes], directions, matrix)


def together(matrices: Sequence[LabelledMatrix]) -> list[sp.csr_matrix]:
    """Matrices over the degrees of freedom of all of them, ascending by node, then direction."""
    freedoms = [SLOTS_PER_NODE * m.nodes + m.directions for m in matrices]
    every = np.unique(np.concatenate(freedoms))
    over_all = []
    for own_freedoms, labelled in zip(freedoms, matrices, strict=True):
        A = labelled.matrix.tocoo()
        positions = np.searchsorted(every, own_freedoms)
        shape = (len(every), len(every))
        over_all.append(sp.csr_matrix((A.data, (positions[A.row], positions[A.col])), shape=shape))
    return over_all


def _check(wrong: np.ndarray, refused: Refusal, entries: np.ndarray, expected: str) -> None:
    if wrong.any():
        k = int(wrong.argmax())
        raise refused(k, f"expected {expected}, found {entries[k]}")


def read_abaqus(path: Path) -> LabelledMatrix | sp.csr_matrix:
    """Read a matrix of ``*MATRIX GENERATE`` of Abaqus, in any of its text formats.

    The formats MATRIX INPUT and LABELS name nodes and directions, COORDINATE has numbers of rows
    and columns.

    Raises
    ------
    ModelError
        A line is malformed, or `labelled_matrix` or `numbered_matrix` refuses an entry.
    """
    text = TextFile.read(path)
    line_numbers = [
        i for i, line in enumerate(text.lines) if line.strip() and not line.startswith("**")
    ]
    if not line_numbers:
        raise text.error(0, "expected entries of a matrix, the file has none")
    for i in line_numbers:
        if text.lines[i].lstrip().startswith("*"):
            excerpt = shortened(text.lines[i])
            raise text.error(i, f"expected entries of a matrix alone, found '{excerpt}'")
    words = len(text.lines[line_numbers[0]].replace(",", " ").split())
    names = LABEL_COLUMNS if words == len(LABEL_COLUMNS) + 1 else ("row", "column")
    table = read_table(text, line_numbers, names, commas=True)
    labels = np.column_stack([table[name] for name in names])

    def refused(k: int, message: str) -> ModelError:
        return text.error(line_numbers[k], message)

    if names is LABEL_COLUMNS:
        return labelled_matrix(labels, table["value"], refused)
    return numbered_matrix(labels, table["value"], refused)


def read_calculix(path: Path) -> sp.csr_matrix:
    """Read a matrix of ``SOLVER=MATRIXSTORAGE`` of CalculiX (``.sti``, ``.mas``).

    Each line has a row, a column and a value.

    Raises
    ------
    ModelError
        A line is malformed, or `numbered_matrix` refuses an entry.
    """
    text = TextFile.read(path)
    line_numbers = [i for i, line in enumerate(text.lines) if line.strip()]
    if not line_numbers:
        raise text.error(0, "expected entries of a matrix, the file has none")
    table = read_table(text, line_numbers, ("row", "column"))

    def refused(k: int, message: str) -> ModelError:
        return text.error(line_numbers[k], message)

    labels = np.column_stack([table["row"], table["column"]])
    return numbered_matrix(labels, table["value"], refused)


def numbered_matrix(labels: np.ndarray, values: np.ndarray, refused: Refusal) -> sp.csr_matrix:
    """The symmetric matrix of entries with rows and columns `labels` (m, 2), from 1.

    Raises
    ------
    ModelError
        A row or column is below 1 or larger than the number of entries; an entry is there twice;
        the matrix is not symmetric.
    """
    most = len(labels)  # each row has at least its diagonal entry
    for wrong, expected in (
        (labels < 1, "at least 1"),
        (labels > most, f"at most {most}, for there are {most} entries"),
    ):
        if wrong.any():
            k, side = (int(i) for i in np.argwhere(wrong)[0])
            what = ("row", "column")[side]
            raise refused(k, f"expected a {what} {expected}, found {labels[k, side]}")
    n = int(labels.max(initial=0))
    return symmetric_of_pairs(labels[:, 0] - 1, labels[:, 1] - 1, values, n, refused)
