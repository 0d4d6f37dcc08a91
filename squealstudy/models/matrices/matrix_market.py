"""Matrix Market files (Boisvert, Pozo, Remington 1996), read to the letter.

SciPy's own reader takes "1,5" and "1.5D2" for 1 and 1.5 without a word.
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
INDEX_COLUMNS = {"coordinate": ("row", "column"), "array": ()}  # on each line, before its value
TYPES = ("real", "double", "integer", "unsigned-integer")


def read_matrix_market(path: Path) -> sp.csr_matrix:
    """A real matrix (n, n) from a file of coordinates or of all values; both triangles.

    Raises
    ------
    ModelError
        With the line of what is not as the format has it; a pattern without values, complex ones.
    OSError, EOFError, ValueError
        A damaged compressed file; a matrix that is not square.
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
    """Layout, type of the values and symmetry, as the first line says."""
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
    """How many values of an (n, n) matrix a file of all values has."""
    return {
        "general": n * n,
        "symmetric": n * (n + 1) // 2,
        "skew-symmetric": n * (n - 1) // 2,
    }[symmetry]


def _packed(n: int, symmetry: Symmetry) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns, from 1, of the values of such a file: by columns, from the diagonal."""
    if symmetry == "general":
        j, i = np.divmod(np.arange(n * n), n)
    else:
        j, i = np.triu_indices(n, 0 if symmetry == "symmetric" else 1)
    return i + 1, j + 1
