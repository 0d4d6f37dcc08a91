"""Chunk files: one row a design point with its findings nested, under an explicit schema."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from squealstudy.study.files import write_parquet

DIRECTORY = "chunks"


def write_chunk(
    directory: Path, name: str, rows: Sequence[dict[str, Any]], schema: pa.Schema
) -> None:
    """Write one chunk file atomically."""
    table = pa.Table.from_pylist(list(rows), schema=schema)
    write_parquet(directory / DIRECTORY / f"{name}.parquet", table)


def finished_points(directory: Path, schema: pa.Schema) -> set[str]:
    """Ids of all points in whole chunk files; files of another schema are passed over."""
    found: set[str] = set()
    for path in sorted((directory / DIRECTORY).glob("*.parquet")):
        if pq.read_schema(path).equals(schema):
            found.update(pq.read_table(path, columns=["point_id"])["point_id"].to_pylist())
    return found


def read_chunks(directory: Path, wanted: set[str], schema: pa.Schema) -> dict[str, dict[str, Any]]:
    """Rows of the wanted points by id; a point that stands twice is taken once."""
    rows: dict[str, dict[str, Any]] = {}
    for path in sorted((directory / DIRECTORY).glob("*.parquet")):
        if not pq.read_schema(path).equals(schema):
            continue
        for row in pq.read_table(path).to_pylist():
            if row["point_id"] in wanted:
                rows[row["point_id"]] = row
    return rows
