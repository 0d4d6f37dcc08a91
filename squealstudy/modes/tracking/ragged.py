"""Arrays of different lengths, one for each design point, stored in one array."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np


class Ragged:
    """Rows of different lengths, one after the other in one array.

    Attributes
    ----------
    flat : ndarray (N,)
        Values of all rows.
    counts : ndarray (n,) of int
        Length of each row.
    starts : ndarray (n,) of int
        Index in `flat` of the first value of each row.

    Raises
    ------
    ValueError
        Where `counts` do not add up to the number of values.
    """

    def __init__(self, flat: np.ndarray, counts: np.ndarray) -> None:
        if counts.sum() != len(flat):
            raise ValueError(f"{len(flat)} values do not fill rows of {int(counts.sum())}")
        self.flat, self.counts = flat, counts
        self.starts = np.cumsum(counts) - counts

    @classmethod
    def of(cls, rows: Iterable[np.ndarray]) -> Ragged:
        """Ragged array of separate arrays (m,)."""
        arrays = [np.asarray(row) for row in rows]
        flat = np.concatenate(arrays) if arrays else np.zeros(0)
        return cls(flat, np.array([len(row) for row in arrays], dtype=np.int64))

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.counts)

    def __getitem__(self, row: int) -> np.ndarray:
        """Values (m,) of a row, a view."""
        start = self.starts[row]
        values: np.ndarray = self.flat[start : start + self.counts[row]]
        return values

    def __iter__(self) -> Iterator[np.ndarray]:
        """The rows in order."""
        return (self[row] for row in range(len(self)))

    @property
    def owner(self) -> np.ndarray:
        """Index (N,) of the row of each value."""
        return np.repeat(np.arange(len(self)), self.counts)

    def with_flat(self, flat: np.ndarray) -> Ragged:
        """Rows of the same lengths with other values (N,)."""
        return Ragged(flat, self.counts)

    def block(self, rows: np.ndarray, count: int) -> np.ndarray:
        """Indices (r, count) in `flat` of the values of rows (r,) that all have this length."""
        positions: np.ndarray = self.starts[rows][:, None] + np.arange(count)
        return positions

    def least(self) -> np.ndarray:
        """Least value of each row (n,), infinite for an empty row."""
        least = np.full(len(self), np.inf)
        filled = np.flatnonzero(self.counts)
        if len(filled):
            least[filled] = np.minimum.reduceat(self.flat, self.starts[filled])
        return least
