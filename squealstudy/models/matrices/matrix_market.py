"""Reads Matrix Market files (Boisvert, Pozo, Remington 1996) strictly.

SciPy's own reader reads "1,5" and "1.5D2" as 1 and 1.5 without an error.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import cast

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.matrices.entries import Symmetry, check_size, matrix_of_entries
from squealstudy.models.matrices.text import TextFile, read_table, shortened

BANNER = re.compile(r"%%?matrixmarket\s+matrix\s+(\S+)\s+(\S+)\s+(\S+)\s*", re.IGNORECASE)
INDEX_COLUMNS = {"coordinate": ("row", "column"), "array": ()}  # numbers before the value of a line
TYPES = ("real", "double", "integer", "unsigned-integer")


def read_matrix_market(path: Path) -> sp.csr_matrix:
    """Read a real matrix (n, n), with both triangles, from a file of coordinates or of all values.

    Raises
    ------
    ModelError
        A line is malformed; the matrix is a pattern without values, or complex.
    OSError, EOFError
        A compressed file is damaged.
    ValueError
        The matrix is not square.
    """
    text = TextFile.read(path)
    layout, kind, symmetry = _banner(text)
    start = 1
    while text.line(start).startswith("%") or not text.line(start).strip():
        start += 1
    words = text.line(start).split()
    expected = "rows, columns and entries" if layout == "coordinate" else "rows and columns"
    if len(words) != (3 if layout == "coordinate" else 2):
        raise text.error(start, f"expected {expected}, found '{shortened(text.line(start))}'")
    rows, columns, *entries = text.counts(start, words, expected)
    check_size(rows, columns)
    line_numbers = [i for i in range(start + 1, len(text.lines)) if text.lines[i].strip()]
    stored = entries[0] if entries else _stored(rows, symmetry)
    if len(line_numbers) != stored:
        what = f"{stored:,} entries" if entries else f"{stored:,} values"
        raise text.error(start, f"the header says {what}, {len(line_numbers):,} lines follow")
    table = read_table(text, line_numbers, INDEX_COLUMNS[layout], whole="integer" in kind)

    def refused(k: int, message: str) -> ModelError:
        return text.error(line_numbers[k], message)

    if layout == "coordinate":
        i, j = table["row"], table["column"]
    else:
        i, j = _packed(rows, symmetry)
    return matrix_of_entries(i, j, table["value"], rows, symmetry, refused)


def _banner(text: TextFile) -> tuple[str, str, Symmetry]:
    """Layout, type of the values and symmetry, from the first line; ModelError where wrong."""
    first = text.line(0)
    match = BANNER.fullmatch(first)
    if match is None:
        expected = "%%MatrixMarket matrix, layout, type and symmetry"
        raise text.error(0, f"expected {expected}, found '{shortened(first)}'")
    layout, kind, symmetry = (word.lower() for word in match.groups())
    if kind == "pattern":
        raise text.error(0, "a pattern without values")
    if kind == "complex" or symmetry == "hermitian":
        raise text.error(0, f"expected real values, found {kind} {symmetry} ones")
    for word, allowed in (
        (layout, tuple(INDEX_COLUMNS)),
        (kind, TYPES),
        (symmetry, ("general", "symmetric", "skew-symmetric")),
    ):
        if word not in allowed:
            raise text.error(0, f"expected {' or '.join(allowed)}, found '{shortened(word)}'")
    return layout, kind, cast("Symmetry", symmetry)


def _stored(n: int, symmetry: Symmetry) -> int:
    """Number of values that a file in the layout `array` has of an (n, n) matrix."""
    return {
        "general": n * n,
        "symmetric": n * (n + 1) // 2,
        "skew-symmetric": n * (n - 1) // 2,
    }[symmetry]


def _packed(n: int, symmetry: Symmetry) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns, from 1, of the values in the layout `array`.

    Values are column by column. Symmetric matrices have them from the diagonal down.
    """
    if symmetry == "general":
        j, i = np.divmod(np.arange(n * n), n)
    else:
        j, i = np.triu_indices(n, 0 if symmetry == "symmetric" else 1)
    return i + 1, j + 1
