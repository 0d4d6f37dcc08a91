"""Files of a results directory: their names, the manifest, chunk files of rows, histories.

Each is whole or absent: written under a temporary name, flushed, renamed. A chunk file has one row
a design point with its findings in lists, under an explicit schema.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from squealstudy.engine.keys import chunk_id
from squealstudy.engine.workers import ChunkRows
from squealstudy.errors import ResultsError

if TYPE_CHECKING:
    import pandas as pd

POINTS, MODES, GROWTH = "points.parquet", "modes.parquet", "growth.parquet"
ONSETS = "onsets.parquet"
SENSITIVITIES = "sensitivities.parquet"
MEASUREMENTS, ERRORS = "measurements.parquet", "errors.parquet"
CELLS = "cells.parquet"
HISTORIES, STATES = "histories", "states"
ONSET_PARAMETER = "friction"
PICTURES = "pictures"  # key of the manifest: those drawn beside the tables
INACCURATE = "inaccurate"  # status of a point whose roots are there, with too large an error
MANIFEST = "manifest.json"
CHUNKS = "chunks"


def write_atomic(path: Path, write: Callable[[Path], None]) -> None:
    """Call `write` on a temporary file beside `path`, flush it to disk and rename it.

    A crash leaves the old file or the new one, and at most a ``.tmp`` that readers never look at.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        _sync(temporary)
        temporary.replace(path)
        _sync(path.parent)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_parquet(path: Path, table: pa.Table) -> None:
    """Write a table to a Parquet file that is whole or absent."""
    write_atomic(path, lambda p: pq.write_table(table, p, compression="zstd"))


def write_arrays(path: Path, arrays: Mapping[str, Any]) -> None:
    """Write arrays by name to an npz file atomically."""

    def write(temporary: Path) -> None:
        with temporary.open("wb") as handle:
            np.savez(handle, **arrays)

    write_atomic(path, write)


def write_json(path: Path, content: Any) -> None:
    """Write a value to a JSON file that is whole or absent."""
    write_text(path, json.dumps(content, indent=2, default=str) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text atomically."""

    def write(temporary: Path) -> None:
        temporary.write_text(text, encoding="utf-8")

    write_atomic(path, write)


def remove_leftovers(directory: Path) -> None:
    """Remove temporary files that a killed run left below `directory` (hold its lock)."""
    for path in directory.rglob(".*.tmp"):
        path.unlink(missing_ok=True)


def onset_parameter(swept: Sequence[str]) -> str | None:
    """The parameter along which onsets are sought: friction if swept, else the first sweep."""
    if ONSET_PARAMETER in swept:
        return ONSET_PARAMETER
    return swept[0] if swept else None


def read_manifest(directory: Path) -> dict[str, Any] | None:
    """The manifest of a results directory, None where there is none; ResultsError if damaged."""
    path = directory / MANIFEST
    if not path.is_file():
        return None
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ResultsError(f"{path}: not a readable manifest ({error})") from error
    if not isinstance(content, dict) or not {"name", "kind", "model"} <= set(content):
        raise ResultsError(f"{path}: not a manifest of squealstudy")
    return content


def version_of(manifest: dict[str, Any]) -> str:
    """The version of squealstudy that wrote a manifest."""
    return str(manifest.get("versions", {}).get("squealstudy", "0"))


def write_manifest(directory: Path, manifest: dict[str, Any]) -> None:
    """Write the manifest of a results directory, whole or not at all."""
    write_json(directory / MANIFEST, manifest)


def write_rows(directory: Path, rows: Sequence[dict[str, Any]], schema: pa.Schema) -> None:
    """Write rows as one chunk file, whole or not at all, named by its points."""
    _write_table(directory, pa.Table.from_pylist(list(rows), schema=schema))


def write_chunk(directory: Path, chunk: ChunkRows) -> None:
    """Write what a worker found: the files beside the tables first, then its rows."""
    for name, content in chunk.files.items():
        if isinstance(content, pa.Table):
            write_parquet(directory / name, content)
        else:
            write_arrays(directory / name, content)
    _write_table(directory, chunk.table)


def _write_table(directory: Path, table: pa.Table) -> None:
    name = chunk_id(table["point_id"].to_pylist())
    write_parquet(directory / CHUNKS / f"{name}.parquet", table)


def read_tables(
    directory: Path, schema: pa.Schema, columns: Sequence[str] | None = None
) -> Iterator[pa.Table]:
    """Tables of the chunk files one after the other; files of another schema are passed over."""
    chosen = None if columns is None else list(columns)
    for path in sorted((directory / CHUNKS).glob("*.parquet")):
        with pq.ParquetFile(path) as file:
            if file.schema_arrow.equals(schema):
                yield file.read(columns=chosen, use_threads=False)


def finished_points(directory: Path, schema: pa.Schema) -> set[str]:
    """Ids of all points in whole chunk files."""
    found: set[str] = set()
    for table in read_tables(directory, schema, ["point_id"]):
        found.update(table["point_id"].to_pylist())
    return found


def read_chunks(directory: Path, wanted: set[str], schema: pa.Schema) -> dict[str, dict[str, Any]]:
    """Rows of the wanted points by id; a point that stands twice is taken once."""
    rows: dict[str, dict[str, Any]] = {}
    for table in read_tables(directory, schema):
        for row in table.to_pylist():
            if row["point_id"] in wanted:
                rows[row["point_id"]] = row
    return rows


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
