"""Gathers the rows of finished tasks into chunk files that are neither tiny nor late.

A chunk file closes at 4,096 points or before its first row is 5 s old, whichever is first: a kill
loses no more than that.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from types import TracebackType

import pyarrow as pa

from squealstudy.engine.chunk_rows import ChunkRows
from squealstudy.engine.store import Store
from squealstudy.engine.workers import MOST_POINTS
from squealstudy.errors import SquealstudyError

MAX_CHUNK_AGE_S = 5.0  # s


class ChunkWriter:
    """Writes chunk files of a store; at the end of its ``with`` block what is left too.

    Parameters
    ----------
    store : Store
    clock : callable
        Seconds.
    """

    def __init__(self, store: Store, clock: Callable[[], float] = time.monotonic) -> None:
        self._store, self._clock = store, clock
        self._tables: list[pa.Table] = []
        self._points, self._since = 0, 0.0

    def add(self, chunk: ChunkRows) -> None:
        """Take in what a worker found; write where the chunk is full, or would grow old.

        Rows with files of their own, as histories, are written at once, and belong together.
        """
        if chunk.files:
            self._store.write_chunk(chunk.table, chunk.files)
            return
        if self._points + len(chunk.table) > MOST_POINTS:
            self.write()
        if not self._tables:
            self._since = self._clock()
        self._tables.append(chunk.table)
        self._points += len(chunk.table)
        # the next row may come as late as this one came
        if (
            self._points >= MOST_POINTS
            or self._clock() - self._since + chunk.wall_s >= MAX_CHUNK_AGE_S
        ):
            self.write()

    def write(self) -> None:
        """Close the chunk."""
        if self._tables:
            self._store.write_chunk(pa.concat_tables(self._tables))
        self._tables, self._points = [], 0

    def __enter__(self) -> ChunkWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Keep what is finished, whatever ended the block; its error is the one that is told."""
        with contextlib.suppress(*(() if kind is None else (OSError, SquealstudyError))):
            self.write()
