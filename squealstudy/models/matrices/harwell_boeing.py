"""Harwell-Boeing files as solvers write them: more of them than SciPy's reader takes by itself."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import scipy.sparse as sp

from squealstudy.errors import ModelError

TYPE_LINE, FORMAT_LINE = 2, 3  # of the header, from 0; the first three letters are the type
SCALE_FACTOR = re.compile(r"\(\s*\d+P\s*,?", re.IGNORECASE)  # means nothing for E and D on input
SIGNS = {"s": 1.0, "z": -1.0, "u": 0.0}  # of the upper triangle: symmetric, skew, all stored


def read_harwell_boeing(path: Path) -> sp.csr_matrix:
    """A real assembled matrix (n, n); of symmetric and skew ones both triangles.

    Raises
    ------
    ModelError
        A pattern without values, a complex, Hermitian or unassembled matrix.
    ValueError, IndexError
        What SciPy's reader raises on a damaged file.
    """
    lines = path.read_text(encoding="ascii", errors="replace").splitlines(keepends=True)
    kind = lines[TYPE_LINE][:3].lower() if len(lines) > TYPE_LINE else ""
    if len(kind) != 3 or kind[0] not in "rp" or kind[1] not in SIGNS or kind[2] != "a":
        wanted = "a real assembled matrix (RSA, RUA, RZA)"
        raise ModelError(f"{path}: expected {wanted}, found type '{kind}'")
    if kind[0] == "p":
        raise ModelError(f"{path}: a pattern without values")
    lines[TYPE_LINE] = "RUA" + lines[TYPE_LINE][3:]
    numbers = "".join(lines[FORMAT_LINE:]).upper().replace("D", "E")  # Fortran's double exponent
    text = "".join(lines[:FORMAT_LINE]) + SCALE_FACTOR.sub("(", numbers)
    import scipy.io

    stored: Any = sp.csr_matrix(scipy.io.hb_read(io.StringIO(text)))
    if kind[1] == "u":
        return stored
    return (stored + SIGNS[kind[1]] * sp.tril(stored, -1).T).tocsr()
