"""Rows of large tables, read batch by batch: the rows that are wanted, with the columns that are.

A table of modes has millions of rows. Rankings, statistics and pictures ask for some of its
columns, and for the rows that count in them; of the rest only a batch is there at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Protocol

import numpy as np
import pandas as pd

from squealstudy.engine.store import Store
from squealstudy.errors import ResultsError
from squealstudy.tables import point_rows
from squealstudy.tables.mode_ranking import RANKED, energy_columns
from squealstudy.tables.point_rows import ROW, point_codes, row_parts
from squealstudy.tables.ranking_query import query
from squealstudy.tables.stability import is_uncertain

Keep = Callable[[pd.DataFrame], np.ndarray]  # rows of a batch -> which are wanted (n,) of bool


class Tables(Protocol):
    """Tables that are read by columns and rows: `ResultTables`."""

    def columns(self, name: str) -> list[str]:
        """Names of the columns of a table."""
        ...

    def batches(self, name: str, columns: Sequence[str]) -> Iterator[pd.DataFrame]:
        """Columns of a table, some thousand rows at a time."""
        ...

    def rows(self, name: str, columns: Sequence[str], keep: Keep | None = ...) -> pd.DataFrame:
        """Some columns of those rows of a table that are wanted."""
        ...


def batches(
    table: pd.DataFrame | None, store: Store, file: str, columns: Sequence[str]
) -> Iterator[pd.DataFrame]:
    """Columns of a table, some thousand rows at a time, indexed by the rows' numbers.

    Of a frame that is there already, else of its file.
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
    """The rows of some batches that are wanted, as one table (`ResultTables.rows`)."""
    chosen = [
        part if keep is None else part[np.asarray(keep(part), dtype=bool)] for part in batches
    ]
    names = [str(name) for name in chosen[0]]  # one after the other: all would be there twice else
    return pd.DataFrame({name: pd.concat([part.pop(name) for part in chosen]) for name in names})


def mode_points(points: pd.DataFrame, modes: Iterable[pd.DataFrame]) -> np.ndarray:
    """Row in `points` of each row of `modes` (n_modes,) of int32, of batches of these.

    ResultsError where one has none.
    """
    ids, first = points[["point_id"]], 0
    batch_rows = [np.zeros(0, dtype=np.int32)]
    for batch in modes:
        try:  # modes stand in the order of their points
            rows = first + point_codes(
                ids.iloc[first : first + 2 * point_rows.ROWS_PER_BATCH], batch
            )
        except ResultsError:  # in tables of other making they need not
            rows = point_codes(ids, batch)
        batch_rows.append(rows.astype(np.int32))
        first = int(rows[-1]) if len(rows) else first
    return np.concatenate(batch_rows)


def ranked_modes(results: Tables, where: str | None = None) -> pd.DataFrame:
    """The modes that count in a ranking, with the columns that do, and those of a query.

    These are unstable ones, those of tracks that are unstable somewhere, and uncertain ones.
    """
    names, tracks = results.columns("modes"), np.zeros(0, dtype=np.int64)
    for batch in results.batches("modes", ["track", "unstable"]):
        tracks = np.union1d(tracks, batch["track"].to_numpy()[batch["unstable"].to_numpy(bool)])
    tracks = tracks[tracks > 0]
    in_query = set().union(*(c.columns for c in query(where, results.columns("points"), names)))

    def counts(batch: pd.DataFrame) -> np.ndarray:
        is_ranked_track = np.isin(batch["track"].to_numpy(), tracks)
        return is_ranked_track | batch["unstable"].to_numpy(bool) | is_uncertain(batch)

    columns = {*RANKED, *energy_columns(names), *in_query}
    return results.rows("modes", [ROW, *(c for c in names if c in columns)], counts)
