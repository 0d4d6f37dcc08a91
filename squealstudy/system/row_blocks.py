"""Sums of L^T diag(w) R of dense matrices whose rows are zero in most columns.

A contact point moves with its own two components alone: its row is zero in the coordinates of all
others. Rows that are zero in the same columns form a block, whose products leave these columns out.
A row "sees" the other columns.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

LEAST_COORDINATES = 100  # coordinates from which blocks are looked for: small products are fast
MOST_BLOCKS = 16  # more different sets of columns than this, and no blocks are made
# multiplications with blocks over those without, up to which blocks are used
LARGEST_SHARE = 0.7
Run = tuple[slice, slice]  # a range of columns seen: in the block, in the whole matrix


class RowBlock(NamedTuple):
    """Numbers (r,) of rows that see the same columns, and these columns as ranges of neighbours."""

    rows: np.ndarray
    runs: tuple[Run, ...]


def blocks_of(matrices: Sequence[np.ndarray]) -> tuple[RowBlock, ...]:
    """Blocks of rows of matrices (m, n); a row sees the columns in which any matrix has an entry.

    Rows of zeros are in no block. There are no blocks in small matrices, nor where they would be
    many or save little.
    """
    rows, n = matrices[0].shape
    if n < LEAST_COORDINATES or not rows:
        return ()
    sees_column = np.any([A != 0 for A in matrices], axis=0)
    kinds, which = np.unique(np.packbits(sees_column, axis=1), axis=0, return_inverse=True)
    which = which.reshape(-1)
    if len(kinds) > MOST_BLOCKS:
        return ()
    sees = np.unpackbits(kinds, axis=1, count=n).astype(bool)
    work = (np.bincount(which) * sees.sum(axis=1) ** 2.0).sum()
    if work > LARGEST_SHARE * rows * float(n) ** 2:
        return ()
    return tuple(
        RowBlock(np.flatnonzero(which == kind), _runs(np.flatnonzero(columns)))
        for kind, columns in enumerate(sees)
        if columns.any()
    )


def _runs(columns: np.ndarray) -> tuple[Run, ...]:
    """Runs of consecutive columns, each as a slice of the list and of the matrix."""
    ends = np.flatnonzero(np.diff(columns) != 1) + 1
    starts = [0, *ends.tolist()]
    parts = zip(starts, [*ends.tolist(), len(columns)], strict=True)
    return tuple(
        (slice(start, end), slice(int(columns[start]), int(columns[end - 1]) + 1))
        for start, end in parts
    )


class BlockRows(NamedTuple):
    """Blocks that some matrices share, and the entries of each matrix in them.

    Attributes
    ----------
    blocks : tuple of RowBlock
    parts : dict of int -> list of ndarray
        Entries of a matrix, found by its `id`, in each block: (rows, columns seen).
    """

    blocks: tuple[RowBlock, ...]
    parts: dict[int, list[np.ndarray]]

    @classmethod
    def of(cls, matrices: Sequence[np.ndarray]) -> BlockRows:
        """Blocks of matrices (m, n); none where they save little (`blocks_of`)."""
        blocks = blocks_of(matrices)
        entries = {
            id(A): [np.hstack([A[b.rows, columns] for _, columns in b.runs]) for b in blocks]
            for A in matrices
        }
        return cls(blocks, entries)

    def add(self, total: np.ndarray, terms: Iterable[tuple[Any, Any, Any]]) -> None:
        """Add the sum of L^T diag(w) R of terms (L, w, R) to a matrix (n, n), in place."""
        terms = list(terms)
        for number, block in enumerate(self.blocks if terms else ()):
            parts = [
                weighted(self.parts[id(L)][number], w[block.rows], self.parts[id(R)][number])
                for L, w, R in terms
            ]
            part = parts[0]
            for other_part in parts[1:]:
                part += other_part
            for part_rows, rows in block.runs:
                for part_columns, columns in block.runs:
                    total[rows, columns] += part[part_rows, part_columns]


def weighted(L: np.ndarray, w: np.ndarray, R: np.ndarray) -> np.ndarray:
    """L^T diag(w) R of dense matrices (m, n) and weights (m,)."""
    if L is R and (w >= 0).all():
        half = np.sqrt(w)[:, None] * R
        return half.T @ half  # half the work: NumPy computes one triangle of X^T X only
    return L.T @ (w[:, None] * R)
