"""Which row of the points table each mode belongs to, by arrays.

Ids are texts, and slow to look up. Modes of a point stand together in their table, so that an id is
looked up once a point.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from squealstudy.errors import ResultsError

ROWS_PER_BATCH = 2**17  # rows of a long table that are looked at together
ROW = "point_row"  # column: row in the points table of a mode, where that is known already


def row_parts(count: int) -> Iterator[slice]:
    """So many rows in parts of ROWS_PER_BATCH; one that is empty of none."""
    return (
        slice(start, start + ROWS_PER_BATCH) for start in range(0, max(count, 1), ROWS_PER_BATCH)
    )


def point_codes(points: pd.DataFrame, modes: pd.DataFrame) -> np.ndarray:
    """Row in `points` of each row of `modes` (n_modes,). ResultsError where one has none."""
    if ROW in modes:
        row_of: np.ndarray = modes[ROW].to_numpy()
        return row_of
    if not len(modes):
        return np.zeros(0, dtype=np.int64)
    heads, run = _runs(_texts(modes["point_id"]))
    rows = pc.index_in(heads, value_set=_texts(points["point_id"]))
    if rows.null_count:
        raise ResultsError("the modes table has points that are not in the points table")
    codes: np.ndarray = rows.to_numpy(zero_copy_only=False).astype(np.int64)[run]
    return codes


def rows_in(table: pd.DataFrame, part: pd.DataFrame) -> np.ndarray:
    """Places in a table of the rows of a part of it (n,)."""
    rows: np.ndarray = table.index.get_indexer(part.index)
    return rows


def largest_by_code(values: np.ndarray, code: np.ndarray, count: int) -> np.ndarray:
    """Largest value of each of `count` codes, NaN of one that has none."""
    largest = np.full(count, -np.inf)
    np.maximum.at(largest, code, values)
    has_value = np.zeros(count, dtype=bool)
    has_value[code] = True
    return np.where(has_value, largest, np.nan)


def _texts(column: pd.Series) -> pa.Array:
    texts = pa.array(column)
    if isinstance(texts, pa.ChunkedArray):
        texts = texts.combine_chunks()
    return texts.cast(pa.large_string())


def _runs(texts: pa.Array) -> tuple[pa.Array, np.ndarray]:
    """Texts without immediate repetition, and the place of each (n,) among them."""
    begins = np.ones(len(texts), dtype=bool)
    if len(texts) > 1:
        changed = pc.not_equal(texts.slice(1), texts.slice(0, len(texts) - 1))
        begins[1:] = changed.fill_null(True).to_numpy(zero_copy_only=False)
    return texts.take(np.flatnonzero(begins)), np.cumsum(begins) - 1
