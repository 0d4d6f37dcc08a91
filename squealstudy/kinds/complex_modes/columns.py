"""The chunk files of a study as columns: one array over all modes of all points."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from squealstudy.engine.store import INACCURATE, read_tables
from squealstudy.errors import ResultsError
from squealstudy.kinds.complex_modes.rows import (
    MODE_FIELDS,
    POINT_FIELDS,
    SCHEMA,
    SHAPES,
    worst_errors,
)

ITEM = np.dtype(np.complex64).itemsize


@dataclass(frozen=True)
class ShapeFile:
    """Shapes of all points in one file, read a point at a time: they may exceed the memory.

    Attributes
    ----------
    path : Path
    offset, size : ndarray (n,) of int
        Place of each point's shapes in the file, bytes.
    count : ndarray (n,) of int
        Modes of each point.
    """

    path: Path
    offset: np.ndarray
    size: np.ndarray
    count: np.ndarray

    def read(self, point: int) -> np.ndarray:
        """Shapes (m, k) complex64 of a point."""
        count = int(self.count[point])
        if not count:
            return np.zeros((0, 1), dtype=np.complex64)
        n = int(self.size[point]) // ITEM
        flat = np.fromfile(self.path, np.complex64, n, offset=int(self.offset[point]))
        return flat.reshape(count, -1)

    def remove(self) -> None:
        """Delete the file."""
        self.path.unlink(missing_ok=True)


@dataclass(frozen=True)
class ModeColumns:
    """Findings of the points of a study, in the order of its design.

    Attributes
    ----------
    points : pa.Table (n rows)
        POINT_FIELDS.
    counts : ndarray (n,) of int
        Modes of each point.
    lam : ndarray (N,) complex
        Roots of all points one after the other, rad/s.
    overdamped : ndarray (N,) of bool
    residual, error_rung : ndarray (N,)
    energies : ndarray (N, n_components + 1) or (N, 0)
    shapes : ShapeFile or None
    """

    points: pa.Table
    counts: np.ndarray
    lam: np.ndarray
    overdamped: np.ndarray
    residual: np.ndarray
    error_rung: np.ndarray
    energies: np.ndarray
    shapes: ShapeFile | None

    @property
    def point(self) -> np.ndarray:
        """Row in `points` of each mode (N,)."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    def oscillating(self) -> list[np.ndarray]:
        """Roots of the oscillating modes of each point; they come first in a point."""
        kept = ~self.overdamped
        counts = np.bincount(self.point[kept], minlength=len(self.counts))
        return np.split(self.lam[kept], np.cumsum(counts)[:-1])


def read_columns(
    directory: Path, ids: Sequence[str], shapes: bool = True, largest_error: float = np.inf
) -> ModeColumns:
    """Read all chunk files once.

    Parameters
    ----------
    directory : Path
    ids : sequence of str (n,)
        Points in the order that is wanted.
    shapes : bool
        Copy the shapes to a temporary file in the directory, for the caller to remove.
    largest_error : float
        Points with a root that is wrong by more, relative to |lam|, get the status `inaccurate`
        (`worst_errors`); whether one is does not stand in chunk files, so that another tolerance
        asks for no new solution.

    Raises
    ------
    ResultsError
        Where a point is in no chunk.
    """
    names = [name for name, _ in (*POINT_FIELDS, *MODE_FIELDS)]
    tables = [SCHEMA.empty_table().select(names)]
    writer = _ShapeWriter(directory) if shapes else None
    for found in read_tables(directory, SCHEMA, None if shapes else names):
        tables.append(found.select(names))
        if writer is not None:
            writer.write(found[SHAPES])
    table = pa.concat_tables(tables)
    row = {point_id: number for number, point_id in enumerate(table["point_id"].to_pylist())}
    missing = sum(i not in row for i in ids)
    if missing:
        if writer is not None:
            writer.discard()
        raise ResultsError(f"{directory}: {missing} of {len(ids)} design points are not solved")
    order = np.array([row[i] for i in ids], dtype=np.int64)
    table = table.take(order).combine_chunks()
    counts = table["re"].combine_chunks().value_lengths().to_numpy(zero_copy_only=False)
    lam = _flat(table, "re") + 1j * _flat(table, "im")
    energies, error = _flat(table, "energies"), _flat(table, "error_rung")
    points = table.select([name for name, _ in POINT_FIELDS])
    return ModeColumns(
        points=_judged(points, counts.astype(np.int64), lam, error, largest_error),
        counts=counts.astype(np.int64),
        lam=lam,
        overdamped=_flat(table, "overdamped").astype(bool),
        residual=_flat(table, "residual"),
        error_rung=error,
        energies=energies.reshape(len(lam), energies.size // max(len(lam), 1)),
        shapes=None if writer is None else writer.close(order, counts),
    )


def _judged(
    points: pa.Table, counts: np.ndarray, lam: np.ndarray, error: np.ndarray, largest: float
) -> pa.Table:
    """The points with the status and message of those that are inaccurate."""
    point = np.repeat(np.arange(len(counts)), counts)
    worst, at = worst_errors(lam, error, point, len(counts))
    status, message = (points[name].to_pylist() for name in ("status", "message"))
    for i in np.flatnonzero(worst > largest):
        status[i] = INACCURATE
        message[i] = (
            f"the mode at {np.abs(lam[at[i]]) / (2 * np.pi):.5g} Hz may be wrong by "
            f"{worst[i]:.1e} of its frequency or in its damping ratio, more than the tolerance "
            f"{largest:g} of [modes]"
        )
    for name, values in (("status", status), ("message", message)):
        column = points.schema.get_field_index(name)
        points = points.set_column(
            column, points.schema.field(column), pa.array(values, pa.string())
        )
    return points


class _ShapeWriter:
    """Puts the shapes of chunk files one after the other."""

    def __init__(self, directory: Path) -> None:
        handle, path = tempfile.mkstemp(prefix=".shapes.", suffix=".tmp", dir=directory)
        self._path, self._file = Path(path), os.fdopen(handle, "wb")
        self._sizes: list[int] = []

    def write(self, column: pa.ChunkedArray) -> None:
        """Append the bytes of a binary column as they stand."""
        for value in column:
            self._sizes.append(self._file.write(value.as_buffer()))

    def discard(self) -> None:
        """Close and delete."""
        self._file.close()
        self._path.unlink()

    def close(self, order: np.ndarray, counts: np.ndarray) -> ShapeFile:
        """The file, its points in `order`, each with its number of modes."""
        self._file.close()
        size = np.array(self._sizes, dtype=np.int64)
        offset = np.cumsum(size) - size
        return ShapeFile(path=self._path, offset=offset[order], size=size[order], count=counts)


def _flat(table: pa.Table, name: str) -> np.ndarray:
    """Values of a list column of all rows one after the other."""
    values: np.ndarray = table[name].combine_chunks().flatten().to_numpy(zero_copy_only=False)
    return values
