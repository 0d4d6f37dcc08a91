"""Chunk rows of complex-mode studies: one row for each design point, with lists over its modes.

Workers write the rows. A run reads them for decisions, and at its end as columns: each is one array
over the modes of all points.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from squealstudy.engine.rows import (
    HEAD,
    WORKING_POINT_FIELDS,
    head,
    rows_of,
    working_point_cells,
)
from squealstudy.engine.store import INACCURATE, Store
from squealstudy.engine.table_files import SIDE_BY_SIDE
from squealstudy.kinds.complex_modes.stored_shapes import SHAPES, ShapeFile, ShapeWriter
from squealstudy.modes.judged_roots import settled, worst_errors
from squealstudy.modes.point import PointModes
from squealstudy.modes.tracking.ragged import Ragged

POINT_FIELDS = (
    *HEAD,
    ("method", pa.string()),
    *WORKING_POINT_FIELDS,
)
MODE_FIELDS = (
    ("re", pa.list_(pa.float64())),
    ("im", pa.list_(pa.float64())),
    ("overdamped", pa.list_(pa.bool_())),
    ("residual", pa.list_(pa.float64())),
    ("error_rung", pa.list_(pa.float64())),  # 1/s; NaN where it is not estimated
    ("energies", pa.list_(pa.float64())),  # table (m, components + 1), row after row; may be empty
)
SCHEMA = pa.schema(
    [pa.field(n, t, nullable=False) for n, t in (*POINT_FIELDS, *MODE_FIELDS)]
    + [pa.field(SHAPES, pa.binary(), nullable=False)],
    metadata={SIDE_BY_SIDE: " ".join(name for name, _ in MODE_FIELDS[:-1])},
)


def solved_row(
    point_id: str, wall_s: float, modes: PointModes, message: str = ""
) -> dict[str, Any]:
    """Chunk row of a solved point; working-point columns are NaN for a model without contact."""
    return head(point_id, wall_s, message=message) | {
        "method": modes.method,
        **working_point_cells(modes.working_point),
        "re": modes.lam.real,
        "im": modes.lam.imag,
        "overdamped": modes.overdamped,
        "residual": modes.residual,
        "error_rung": modes.error_rung,
        "energies": modes.energies.T.ravel(),
        SHAPES: np.ascontiguousarray(modes.shapes, dtype=np.complex64).tobytes(),
    }


COLUMNS = ("point_id", "status", "re", "im", "error_rung", "overdamped")


def read_roots(
    store: Store,
    wanted_ids: Collection[str],
    overdamped: bool = False,
    tolerance: float | None = None,
    largest_error: float = np.inf,
) -> dict[str, np.ndarray | None]:
    """Roots of the finished points among the wanted ones; None for failed and inaccurate points.

    Returns
    -------
    dict of id -> ndarray (m,) complex or None
        Roots, rad/s: the oscillating ones, and real ones that grow; with `overdamped` all. With a
        `tolerance`, growth that is within its error is set to zero (`settled`). A point is
        inaccurate where a root's estimated error exceeds `largest_error` (`worst_errors`).
    """
    ids = set(wanted_ids)
    roots_of: dict[str, np.ndarray | None] = {}
    for table in store.chunks(SCHEMA, COLUMNS):
        for batch in table.to_batches():
            roots_of.update(_batch_roots(batch, ids, overdamped, tolerance, largest_error))
    return roots_of


def _batch_roots(
    batch: pa.RecordBatch,
    ids: set[str],
    with_overdamped: bool,
    tolerance: float | None,
    largest_error: float,
) -> dict[str, np.ndarray | None]:
    """Roots of the wanted points in one batch of chunk rows, as in `read_roots`."""
    names = batch.column("point_id").to_pylist()
    ok = [status == "ok" for status in batch.column("status").to_pylist()]
    re, im, error, real = (batch.column(name) for name in COLUMNS[2:])
    ends = np.append(0, np.cumsum(re.value_lengths().to_numpy()))
    lam = re.flatten().to_numpy() + 1j * im.flatten().to_numpy()
    point = np.repeat(np.arange(len(names)), np.diff(ends))
    worst, _ = worst_errors(lam, error.flatten().to_numpy(), point, len(names))
    if tolerance is not None:
        lam = settled(lam, error.flatten().to_numpy(), tolerance)
    is_counted = (
        ~real.flatten().to_numpy(zero_copy_only=False).astype(bool)
        | (lam.real > 0)
        | with_overdamped
    )
    roots_of: dict[str, np.ndarray | None] = {}
    for i, name in enumerate(names):
        if name in ids:
            part = slice(ends[i], ends[i + 1])
            roots_of[name] = (
                lam[part][is_counted[part]] if ok[i] and worst[i] <= largest_error else None
            )
    return roots_of


@dataclass(frozen=True)
class ModeColumns:
    """Results of the points of a study, in the order of its design.

    Attributes
    ----------
    points : pa.Table (n rows)
        Columns POINT_FIELDS.
    counts : ndarray (n,) of int
        Number of modes of each point.
    lam : ndarray (N,) complex
        Roots of all points, one point after the other, rad/s.
    overdamped : ndarray (N,) of bool
        Whether a root is real.
    residual : ndarray (N,)
        Residual of each mode.
    error_rung : ndarray (N,)
        Error of each root that the method estimates for itself, rad/s; NaN without an estimate.
    energies : ndarray (N, n_components + 1) or (N, 0)
        Shares of elastic energy of each mode; no columns where the model has none.
    shapes : ShapeFile or None
        Mode shapes; None where they were not asked for.
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

    def oscillating(self) -> Ragged:
        """Roots of the oscillating modes of each point, which stand before its real roots."""
        oscillates = ~self.overdamped
        return Ragged(
            self.lam[oscillates], np.bincount(self.point[oscillates], minlength=len(self.counts))
        )


def read_columns(
    store: Store,
    ids: Sequence[str] | np.ndarray,
    shapes: bool = True,
    largest_error: float = np.inf,
) -> ModeColumns:
    """Read the results of a study's points from all chunk files.

    Parameters
    ----------
    store : Store
        Store with the chunk files.
    ids : sequence of str or ndarray (n,)
        Identities of the points in the order that is wanted.
    shapes : bool
        Copy the shapes to a temporary file in the directory, which the caller must remove.
    largest_error : float
        A point gets the status `inaccurate` if a root's estimated error, relative to ``|lam|``, is
        larger (`worst_errors`). Chunk files do not say so: another tolerance needs no new solution.

    Raises
    ------
    MachineError
        Where a point is in no chunk.
    """
    names = [name for name, _ in (*POINT_FIELDS, *MODE_FIELDS)]
    chunk_columns: dict[str, list[pa.Array]] = {name: [] for name in names}
    writer = ShapeWriter(store.directory) if shapes else None
    for table in store.chunks(SCHEMA, None if shapes else names):
        for name, parts in chunk_columns.items():
            parts += table[name].chunks
        if writer is not None:
            writer.write(table[SHAPES])

    def column(name: str) -> pa.ChunkedArray:
        """All values of a column, whose chunks are dropped to save memory."""
        return pa.chunked_array(chunk_columns.pop(name), SCHEMA.field(name).type)

    point_ids = column("point_id")
    order = rows_of(point_ids, ids)
    if missing := int((order < 0).sum()):
        if writer is not None:
            writer.discard()
        raise store.unsolved(missing, len(ids))
    points = [point_ids.take(order), *(column(n).take(order) for n, _ in POINT_FIELDS[1:])]
    counts, positions = _lengths(chunk_columns["re"], order)
    shares = _lengths(chunk_columns["energies"], order)
    energies = _flat(column("energies"), *shares)
    lam = _flat(column("re"), counts, positions) + 1j * _flat(column("im"), counts, positions)
    error = _flat(column("error_rung"), counts, positions)
    table = pa.Table.from_arrays(points, schema=pa.schema(list(SCHEMA)[: len(POINT_FIELDS)]))
    return ModeColumns(
        points=_with_inaccurate(table, counts, lam, error, largest_error),
        counts=counts,
        lam=lam,
        overdamped=_flat(column("overdamped"), counts, positions).astype(bool),
        residual=_flat(column("residual"), counts, positions),
        error_rung=error,
        energies=energies.reshape(len(lam), energies.size // max(len(lam), 1)),
        shapes=None if writer is None else writer.close(order, counts),
    )


def _lengths(parts: list[pa.Array], order: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Length of each list of a column, and the position of its first value, in the wanted order."""
    lengths = [part.value_lengths().to_numpy(zero_copy_only=False) for part in parts]
    counts = np.concatenate([np.zeros(0, dtype=np.int64), *lengths]).astype(np.int64)
    return counts[order], (np.cumsum(counts) - counts)[order]


def _flat(column: pa.ChunkedArray, counts: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """All values of a list column as one array, in the order that `_lengths` gives."""
    parts = [part.flatten().to_numpy(zero_copy_only=False) for part in column.chunks]
    values = np.concatenate([np.zeros(0, dtype=column.type.value_type.to_pandas_dtype()), *parts])
    rows = np.repeat(positions - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())
    ordered: np.ndarray = values[rows]
    return ordered


def _with_inaccurate(
    points: pa.Table, counts: np.ndarray, lam: np.ndarray, error: np.ndarray, largest: float
) -> pa.Table:
    """The points table, with status and message of points whose roots are inaccurate."""
    point = np.repeat(np.arange(len(counts)), counts)
    worst, worst_modes = worst_errors(lam, error, point, len(counts))
    inaccurate = worst > largest
    if not inaccurate.any():
        return points
    messages = [
        f"the mode at {np.abs(lam[worst_modes[i]]) / (2 * np.pi):.5g} Hz may be wrong by "
        f"{f'{worst[i]:.1e}' if worst[i] < 1.0 else 'more than the whole'} of its frequency or in "
        f"its damping ratio, more than the tolerance {largest:g} of [modes]"
        for i in np.flatnonzero(inaccurate)
    ]
    changes = {"status": [INACCURATE] * len(messages), "message": messages}
    for name, texts in changes.items():
        number = points.schema.get_field_index(name)
        column = points[name].combine_chunks()
        changed = pc.replace_with_mask(column, pa.array(inaccurate), pa.array(texts, pa.string()))
        points = points.set_column(number, points.schema.field(number), changed)
    return points
