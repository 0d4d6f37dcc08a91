"""Wanted rows and columns of large tables, read batch by batch.

A table of modes has millions of rows. Rankings, statistics and pictures need only some of its
columns and rows. Rows that are not wanted are in memory one batch at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Protocol

import numpy as np
import pandas as pd

from squealstudy.engine.store import Store
from squealstudy.errors import ResultsError
from squealstudy.tables import point_rows  # its ROWS_PER_BATCH may be changed
from squealstudy.tables.mode_ranking import RANKED, energy_columns
from squealstudy.tables.point_rows import ROW, point_codes, row_parts
from squealstudy.tables.ranking_query import query
from squealstudy.tables.stability import is_uncertain

# takes n rows of a table, returns which of them are wanted (n,) of bool
Keep = Callable[[pd.DataFrame], np.ndarray]


class Tables(Protocol):
    """Tables that are read by columns and rows: `ResultTables`."""

    def columns(self, name: str) -> list[str]:
        """Names of the columns of a table."""
        ...

    def batches(self, name: str, columns: Sequence[str]) -> Iterator[pd.DataFrame]:
        """Columns of a table, up to ROWS_PER_BATCH rows at a time."""
        ...

    def rows(self, name: str, columns: Sequence[str], keep: Keep | None = ...) -> pd.DataFrame:
        """Some columns of those rows of a table that are wanted."""
        ...


def batches(
    table: pd.DataFrame | None, store: Store, file: str, columns: Sequence[str]
) -> Iterator[pd.DataFrame]:
    """Yield columns of a table, up to ROWS_PER_BATCH rows at a time, indexed by the rows' numbers.

    They are taken from `table` where that is in memory already, else from `file`. A table without
    rows gives one batch without rows.
    """
    if table is not None:
        selected = table[list(columns)].reset_index(drop=True)
        yield from (selected.iloc[rows] for rows in row_parts(len(selected)))
        return
    first = 0
    for batch in store.batches(file, columns, point_rows.ROWS_PER_BATCH):
        frame = batch.to_pandas()
        frame.index = pd.RangeIndex(first, first + len(frame))
        first += len(frame)
        yield frame
    if not first:
        yield store.read_table(file, columns).to_pandas()


def chosen_rows(batches: Iterable[pd.DataFrame], keep: Keep | None) -> pd.DataFrame:
    """The wanted rows of all batches as one table (`ResultTables.rows`)."""
    chosen = [
        part if keep is None else part[np.asarray(keep(part), dtype=bool)] for part in batches
    ]
    # a column leaves the parts when it is joined, so that only one column is in memory twice
    names = [str(name) for name in chosen[0]]
    return pd.DataFrame({name: pd.concat([part.pop(name) for part in chosen]) for name in names})


def mode_points(points: pd.DataFrame, modes: Iterable[pd.DataFrame]) -> np.ndarray:
    """The row of `points` that each mode belongs to, (n_modes,) of int32.

    `modes` are batches of the modes table. ResultsError where a mode has no point.
    """
    ids, first = points[["point_id"]], 0
    batch_rows = [np.zeros(0, dtype=np.int32)]
    for batch in modes:
        try:  # modes are usually in the order of their points: few rows from the last one on
            rows = first + point_codes(
                ids.iloc[first : first + 2 * point_rows.ROWS_PER_BATCH], batch
            )
        except ResultsError:  # tables from elsewhere may have another order
            rows = point_codes(ids, batch)
        batch_rows.append(rows.astype(np.int32))
        first = int(rows[-1]) if len(rows) else first
    return np.concatenate(batch_rows)


def ranked_modes(results: Tables, where: str | None = None) -> pd.DataFrame:
    """The modes that may count in a ranking, with the columns that the ranking and a query need.

    These modes are unstable, or uncertain, or on a track that is unstable at some point. The query
    `where` adds its columns; it does not restrict the rows.
    """
    names, tracks = results.columns("modes"), np.zeros(0, dtype=np.int64)
    for batch in results.batches("modes", ["track", "unstable"]):
        tracks = np.union1d(tracks, batch["track"].to_numpy()[batch["unstable"].to_numpy(bool)])
    tracks = tracks[tracks > 0]  # modes without a track have negative numbers
    in_query: set[str] = set()
    for condition in query(where, results.columns("points"), names):
        in_query |= condition.columns

    def may_count(batch: pd.DataFrame) -> np.ndarray:
        is_ranked_track = np.isin(batch["track"].to_numpy(), tracks)
        return is_ranked_track | batch["unstable"].to_numpy(bool) | is_uncertain(batch)

    columns = {*RANKED, *energy_columns(names), *in_query}
    return results.rows("modes", [ROW, *(c for c in names if c in columns)], may_count)
