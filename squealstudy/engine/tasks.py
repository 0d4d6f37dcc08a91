"""What passes between a run and its workers, whatever is computed at a design point."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from squealstudy.engine.process import peak_memory_mb

if TYPE_CHECKING:
    from squealstudy.engine.kind import Kind


@dataclass(frozen=True)
class Solved:
    """What a kind of study found at some design points.

    Attributes
    ----------
    rows : sequence of dict
        One a design point, with the columns of the kind's chunk files.
    files : mapping of str -> Table, or mapping of names to arrays
        What belongs beside the tables, by its path in the results directory: Parquet or npz.
    known : int
        Points whose working point an earlier study had found.
    """

    rows: Sequence[dict[str, Any]]
    files: Mapping[str, pa.Table | Mapping[str, Any]] = field(default_factory=dict)
    known: int = 0


@dataclass(frozen=True)
class Chunk:
    """Rows that are written as one file, and what they took: seconds, MB of the worker."""

    table: pa.Table
    files: Mapping[str, pa.Table | Mapping[str, Any]]
    known: int
    wall_s: float
    peak_mb: float

    @property
    def point_ids(self) -> list[str]:
        """Of its rows."""
        ids: list[str] = self.table["point_id"].to_pylist()
        return ids


@dataclass(frozen=True)
class Work:
    """A task of a kind of study, as a worker gets it."""

    kind: Kind
    task: Any

    def done(self) -> Chunk:
        """Solve the task; nothing is written here."""
        started = time.perf_counter()
        found = self.kind.solve(self.task)
        table = pa.Table.from_pylist(list(found.rows), schema=self.kind.schema)
        wall_s = time.perf_counter() - started
        return Chunk(table, found.files, found.known, wall_s, peak_memory_mb())
