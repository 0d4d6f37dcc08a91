"""Reads and checks the matrices of a model file with [[term]]."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.file_table import PlacedError
from squealstudy.models.lumped.matrix_tables import MatrixFile
from squealstudy.models.matrices.files import read_term_matrix
from squealstudy.models.matrices.labelled import SLOTS_PER_NODE, LabelledMatrix, together
from squealstudy.models.matrix_checks import check_size

NEEDED = {"M": "mass", "K": "stiffness"}  # matrices of which there must be a term
MAX_ROWS = 500  # matrices are full: a design point with 400 coordinates takes a second
MAX_ASYMMETRY = 1e-9  # difference of the two triangles over the largest entry


class TermMatrices(NamedTuple):
    """Matrices of all terms.

    Attributes
    ----------
    matrices : list of ndarray (n, n)
    labels : tuple of str
        ``node.direction`` of each row where the files say so; else empty.
    """

    matrices: list[np.ndarray]
    labels: tuple[str, ...]


def read_terms(file: MatrixFile, folder: Path) -> TermMatrices:
    """Read the matrix of every term; files are relative to a folder.

    Raises
    ------
    PlacedError
        There is no term of M or of K; a file cannot be used; sizes differ; there are too many
        coordinates; M, C or K is not symmetric, or G not skew-symmetric.
    """
    for letter, quantity in NEEDED.items():
        if all(term.matrix != letter for term in file.term):
            text = f'expected a [[term]] with matrix = "{letter}", the {quantity}: there is none'
            raise PlacedError(("term",), text)
    file_matrices = [_read(file, i, folder) for i in range(len(file.term))]
    labelled = [matrix for matrix in file_matrices if isinstance(matrix, LabelledMatrix)]
    placed_matrices = iter(together(labelled) if labelled else [])
    matrices = [
        next(placed_matrices) if isinstance(m, LabelledMatrix) else m for m in file_matrices
    ]
    n = matrices[0].shape[0]
    if n > MAX_ROWS:
        text = f"it has {n} coordinates, expected at most {MAX_ROWS}: reduce it, or give "
        raise PlacedError(("term", 0, "file"), text + "matrices of parts, which are reduced here")
    for i, matrix in enumerate(matrices):
        if matrix.shape[0] != n:
            text = (
                f"its matrix is {matrix.shape[0]} x {matrix.shape[0]}, the first term's {n} x {n}"
            )
            raise PlacedError(("term", i, "file"), text)
    return TermMatrices(
        [_checked(file, i, matrix) for i, matrix in enumerate(matrices)], _labels(labelled)
    )


def _read(file: MatrixFile, i: int, folder: Path) -> sp.csr_matrix | LabelledMatrix:
    """The matrix of the i-th term, from its file."""
    term = file.term[i]
    try:
        matrix = read_term_matrix(folder / term.file, term.variable)
        check_size("its matrix", matrix.matrix if isinstance(matrix, LabelledMatrix) else matrix)
    except ModelError as error:
        key = "file" if term.variable is None else "variable"
        raise PlacedError(("term", i, key), str(error)) from error
    return matrix


def _checked(file: MatrixFile, i: int, matrix: sp.csr_matrix) -> np.ndarray:
    """The full matrix, made exactly (skew-)symmetric; PlacedError if it is not nearly so."""
    full: np.ndarray = matrix.toarray()
    letter = file.term[i].matrix
    mirrored = -full.T if letter == "G" else full.T
    if np.abs(full - mirrored).max() > MAX_ASYMMETRY * np.abs(full).max():
        text = {
            "K": "K is not symmetric: expected the stiffness without friction, which [[contact]] "
            "adds",
            "C": 'C is not symmetric: expected damping; gyroscopic terms have matrix = "G"',
            "M": "M is not symmetric",
            "G": "G is not skew-symmetric: expected gyroscopic terms, G^T = -G",
        }
        raise PlacedError(("term", i, "file"), text[letter])
    mean: np.ndarray = (full + mirrored) / 2
    return mean


def _labels(matrices: Sequence[LabelledMatrix]) -> tuple[str, ...]:
    if not matrices:
        return ()
    slots = np.unique(np.concatenate([SLOTS_PER_NODE * m.nodes + m.directions for m in matrices]))
    return tuple(f"{p // SLOTS_PER_NODE}.{p % SLOTS_PER_NODE}" for p in slots.tolist())
