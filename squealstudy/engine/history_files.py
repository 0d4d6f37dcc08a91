"""Histories of runs in time as files of the results."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pyarrow as pa

from squealstudy.engine.result_names import (
    HISTORIES,
)

if TYPE_CHECKING:
    import pandas as pd


def history_file(point_id: str, frame: pd.DataFrame) -> dict[str, pa.Table]:
    """A history by its path in the results; time in double precision, the rest in single."""
    single_precision = frame.astype({name: "float32" for name in frame.columns if name != "time"})
    table = pa.Table.from_pandas(single_precision, preserve_index=False)
    return {f"{HISTORIES}/{point_id}.parquet": table}
