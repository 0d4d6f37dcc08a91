"""Histories of design points: one Parquet file each."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from squealstudy.engine.names import HISTORIES
from squealstudy.errors import ResultsError


def history_file(point_id: str, frame: pd.DataFrame) -> dict[str, pa.Table]:
    """A history by its path in the results; time in double precision, the rest in single."""
    kept = frame.astype({name: "float32" for name in frame.columns if name != "time"})
    table = pa.Table.from_pandas(kept, preserve_index=False)
    return {f"{HISTORIES}/{point_id}.parquet": table}


def kept_histories(directory: Path) -> set[str]:
    """Ids of the design points whose histories were kept."""
    return {path.stem for path in (directory / HISTORIES).glob("*.parquet")}


def read_history(directory: Path, point_id: str, status: str = "ok") -> pd.DataFrame:
    """The history of a design point; `status` is that of its row.

    Raises
    ------
    ResultsError
        Where none was kept.
    """
    path = directory / HISTORIES / f"{point_id}.parquet"
    if not path.is_file():
        if status != "ok":
            raise ResultsError(f"{path}: no history, for the point failed: {status}")
        if kept := len(kept_histories(directory)):
            raise ResultsError(f"{path}: no history of this point, but of {kept} others")
        raise ResultsError(
            f"{path}: the study kept no histories; [transient] save_every above 0 keeps them"
        )
    frame: pd.DataFrame = pq.read_table(path).to_pandas()
    return frame
