"""Chunk files: one row a design point with its findings in lists, under an explicit schema."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from squealstudy.engine.files import write_arrays, write_parquet
from squealstudy.engine.keys import chunk_id
from squealstudy.engine.tasks import Chunk

DIRECTORY = "chunks"


def write_rows(directory: Path, rows: Sequence[dict[str, Any]], schema: pa.Schema) -> None:
    """Write rows as one chunk file, whole or not at all, named by its points."""
    _write_table(directory, pa.Table.from_pylist(list(rows), schema=schema))


def write_chunk(directory: Path, chunk: Chunk) -> None:
    """Write what a worker found: the files beside the tables first, then its rows."""
    for name, content in chunk.files.items():
        if isinstance(content, pa.Table):
            write_parquet(directory / name, content)
        else:
            write_arrays(directory / name, content)
    _write_table(directory, chunk.table)


def _write_table(directory: Path, table: pa.Table) -> None:
    name = chunk_id(table["point_id"].to_pylist())
    write_parquet(directory / DIRECTORY / f"{name}.parquet", table)


def read_tables(
    directory: Path, schema: pa.Schema, columns: Sequence[str] | None = None
) -> Iterator[pa.Table]:
    """Tables of the chunk files one after the other; files of another schema are passed over."""
    chosen = None if columns is None else list(columns)
    for path in sorted((directory / DIRECTORY).glob("*.parquet")):
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
