"""Sums of L^T diag(w) R of dense matrices whose rows see a part of the coordinates only.

A contact point moves with its own two components alone: rows of points that see the same
coordinates are a block, and what the block does not see is left out of its products.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

LEAST_COORDINATES = 100  # of a smaller model products take no time
MOST_BLOCKS = 16
# multiplications with blocks over those without, up to which blocks are used
LARGEST_SHARE = 0.7
Run = tuple[slice, slice]  # neighbouring columns: in the block, in the whole matrix


class RowBlock(NamedTuple):
    """Rows (r,) that see the same columns, those as runs of neighbours."""

    rows: np.ndarray
    runs: tuple[Run, ...]


def blocks_of(matrices: Sequence[np.ndarray]) -> tuple[RowBlock, ...]:
    """Blocks of rows of matrices (m, n), in all of which they see the same columns.

    Rows that see nothing are in no block. There is none where they are many or save little.
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
    ends = np.flatnonzero(np.diff(columns) != 1) + 1
    starts = [0, *ends.tolist()]
    parts = zip(starts, [*ends.tolist(), len(columns)], strict=True)
    return tuple(
        (slice(start, end), slice(int(columns[start]), int(columns[end - 1]) + 1))
        for start, end in parts
    )


class BlockRows(NamedTuple):
    """Blocks that some matrices share, and what each of these has in them.

    Attributes
    ----------
    blocks : tuple of RowBlock
    parts : dict of int -> list of ndarray
        By `id` of a matrix: its entries in each block, (rows, columns seen).
    """

    blocks: tuple[RowBlock, ...]
    parts: dict[int, list[np.ndarray]]

    @classmethod
    def of(cls, matrices: Sequence[np.ndarray]) -> BlockRows:
        """Blocks of matrices (m, n); none where they do not pay."""
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
            for own, there in block.runs:
                for other, across in block.runs:
                    total[there, across] += part[own, other]


def weighted(L: np.ndarray, w: np.ndarray, R: np.ndarray) -> np.ndarray:
    """L^T diag(w) R of dense matrices (m, n) and weights (m,)."""
    if L is R and (w >= 0).all():
        half = np.sqrt(w)[:, None] * R
        return half.T @ half  # half the work: BLAS sees that this is symmetric
    return L.T @ (w[:, None] * R)
