"""Makes sparse matrices from entries of files, which store one triangle or all entries."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError

# difference of the two triangles of a file over the largest entry: round-off of their digits
TRIANGLES_REL_TOLERANCE = 1e-8
MOST_ROWS = 10_000_000  # larger sizes come from a damaged header, or exceed any solver here

Symmetry = Literal["general", "symmetric", "skew-symmetric"]
Refusal = Callable[[int, str], ModelError]  # position of an entry from 0, what is wrong -> error


def check_size(rows: int, columns: int, square: bool = True) -> None:
    """Raise ValueError where a matrix is empty or absurdly large, or not square if it must be."""
    if (square and rows != columns) or not rows or not columns:
        kind = "square matrix" if square else "matrix"
        raise ValueError(f"expected a {kind}, found {rows} x {columns}")
    if max(rows, columns) > MOST_ROWS:
        raise ValueError(f"expected at most {MOST_ROWS:,} rows, found {max(rows, columns):,}")


def matrix_of_entries(
    rows: np.ndarray,
    columns: np.ndarray,
    values: np.ndarray,
    n: int,
    symmetry: Symmetry,
    refused: Refusal,
) -> sp.csr_matrix:
    """The matrix (n, n) of entries with rows and columns from 1; one triangle gives both.

    Entries at the same place are added up.

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
        An entry is outside the matrix; a symmetric file has entries in both triangles; a
        skew-symmetric file has entries on the diagonal.
    """
    for name, indices in (("row", rows), ("column", columns)):
        outside = (indices < 1) | (indices > n)
        if outside.any():
            k = int(outside.argmax())
            raise refused(k, f"expected a {name} from 1 to {n}, found {indices[k]}")
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


def symmetric_of_pairs(
    rows: np.ndarray,
    columns: np.ndarray,
    values: np.ndarray,
    n: int,
    refused: Refusal,
    both_triangles: bool = False,
) -> sp.csr_matrix:
    """The symmetric matrix (n, n) of entries of either triangle, or of both with equal values.

    Parameters
    ----------
    rows, columns : ndarray (m,) of int
        From 0.
    values : ndarray (m,)
    refused : callable
        Makes the error about an entry.
    both_triangles : bool
        Whether both triangles must be there.

    Raises
    ------
    ModelError
        An entry is there twice, differs from its partner in the other triangle, or has no partner
        although others have.
    """
    size = np.abs(values).max(initial=0.0)
    A = square_of_entries(rows, columns, values, n, refused)
    entry_counts = sp.coo_matrix((np.ones(len(values)), (rows, columns)), shape=(n, n)).tocsr()
    partner = np.asarray(entry_counts.T.tocsr()[rows, columns]).ravel() > 0
    other = np.asarray(A.T.tocsr()[rows, columns]).ravel()
    off = rows != columns
    if not both_triangles and not (partner & off).any():  # one triangle, or of each pair one
        diagonal = sp.diags(A.diagonal())
        return (A + A.T - diagonal).tocsr()
    wrong = off & (np.abs(values - other) > TRIANGLES_REL_TOLERANCE * size)
    if wrong.any():
        k = int(wrong.argmax())
        if partner[k]:
            raise refused(k, f"{values[k]:g}, in the other triangle {other[k]:g}: not symmetric")
        raise refused(k, "not symmetric: it is not in the other triangle, where others are")
    return ((A + A.T) / 2).tocsr()


def square_of_entries(
    rows: np.ndarray, columns: np.ndarray, values: np.ndarray, n: int, refused: Refusal
) -> sp.csr_matrix:
    """The matrix (n, n) of entries with rows and columns from 0, each of which is there once.

    Raises
    ------
    ModelError
        An entry is there twice.
    """
    check_size(n, n)
    order = np.lexsort((columns, rows))
    same = (np.diff(rows[order]) == 0) & (np.diff(columns[order]) == 0)
    if same.any():
        pairs = np.column_stack([order[:-1], order[1:]])[same]
        k = int(pairs.max(axis=1).min())
        raise refused(k, "this entry is there twice")
    return sp.coo_matrix((values, (rows, columns)), shape=(n, n)).tocsr()
