"""From entries as files store them, one triangle or all, to a sparse matrix."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError

MOST_ROWS = 10_000_000  # more are a damaged header, or beyond any solver here

Symmetry = Literal["general", "symmetric", "skew-symmetric"]
Refusal = Callable[[int, str], ModelError]  # position of an entry from 0, what is wrong -> error


def check_size(rows: int, columns: int) -> None:
    """ValueError where a matrix of this size is not square, is empty, or is absurdly large."""
    if rows != columns or not rows:
        raise ValueError(f"expected a square matrix, found {rows} x {columns}")
    if rows > MOST_ROWS:
        raise ValueError(f"expected at most {MOST_ROWS:,} rows, found {rows:,}")


def matrix_of_entries(
    rows: np.ndarray,
    columns: np.ndarray,
    values: np.ndarray,
    n: int,
    symmetry: Symmetry,
    refused: Refusal,
) -> sp.csr_matrix:
    """The matrix (n, n) of entries whose places count from 1; of one triangle both are made.

    Entries of the same place are added up.

    Parameters
    ----------
    rows, columns : ndarray (m,) of int
    values : ndarray (m,)
    symmetry : str
    refused : callable
        Makes the error about an entry.

    Raises
    ------
    ModelError
        A place outside the matrix; both triangles where one is stored; a skew-symmetric diagonal.
    """
    for name, places in (("row", rows), ("column", columns)):
        outside = (places < 1) | (places > n)
        if outside.any():
            k = int(outside.argmax())
            raise refused(k, f"expected a {name} from 1 to {n}, found {places[k]}")
    off = rows != columns
    if symmetry != "general":
        upper = rows < columns
        if upper.any() and (off & ~upper).any():
            other = upper != upper[off.argmax()]
            k = int((other & off).argmax())
            raise refused(k, f"a {symmetry} file stores one triangle, and this is in the other")
    if symmetry == "skew-symmetric" and values[~off].any():
        k = int((~off & (values != 0)).argmax())
        raise refused(k, "expected zeros on the diagonal of a skew-symmetric matrix")
    i, j = rows - 1, columns - 1
    if symmetry != "general":
        sign = -1.0 if symmetry == "skew-symmetric" else 1.0
        i, j = np.append(i, columns[off] - 1), np.append(j, rows[off] - 1)
        values = np.append(values, sign * values[off])
    return sp.coo_matrix((values, (i, j)), shape=(n, n)).tocsr()
