"""The row of the points table that each mode belongs to.

Ids are texts, and slow to look up. Modes of a point are next to each other in their table, so that
an id is looked up only once for each point.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from squealstudy.errors import ResultsError

ROWS_PER_BATCH = 2**17  # rows of a long table that are processed together
ROW = "point_row"  # column of a modes table that may hold each mode's row in the points table


def row_parts(count: int) -> Iterator[slice]:
    """Slices of ROWS_PER_BATCH of `count` rows; one empty slice where there are no rows."""
    return (
        slice(start, start + ROWS_PER_BATCH) for start in range(0, max(count, 1), ROWS_PER_BATCH)
    )


def point_codes(points: pd.DataFrame, modes: pd.DataFrame) -> np.ndarray:
    """Row in `points` of each row of `modes` (n_modes,); ResultsError where a point is missing."""
    if ROW in modes:
        point_rows: np.ndarray = modes[ROW].to_numpy()
        return point_rows
    if not len(modes):
        return np.zeros(0, dtype=np.int64)
    point_ids, index_of_id = _runs(_texts(modes["point_id"]))
    rows = pc.index_in(point_ids, value_set=_texts(points["point_id"]))
    if rows.null_count:
        raise ResultsError("the modes table has points that are not in the points table")
    codes: np.ndarray = rows.to_numpy(zero_copy_only=False).astype(np.int64)[index_of_id]
    return codes


def rows_in(table: pd.DataFrame, selected: pd.DataFrame) -> np.ndarray:
    """Positions (n,) in a table of the rows that were selected from it."""
    rows: np.ndarray = table.index.get_indexer(selected.index)
    return rows


def largest_by_code(values: np.ndarray, code: np.ndarray, count: int) -> np.ndarray:
    """Largest value (count,) of each code; NaN for a code without values."""
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
    """Texts without immediate repetitions, and the position (n,) of each text among them."""
    begins = np.ones(len(texts), dtype=bool)
    if len(texts) > 1:
        changed = pc.not_equal(texts.slice(1), texts.slice(0, len(texts) - 1))
        begins[1:] = changed.fill_null(True).to_numpy(zero_copy_only=False)
    return texts.take(np.flatnonzero(begins)), np.cumsum(begins) - 1
