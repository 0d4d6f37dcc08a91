"""Chunk files: one row a design point with its modes nested, explicit schema."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from squealstudy.analysis.point import PointModes
from squealstudy.study.files import write_parquet

DIRECTORY = "chunks"
POINT_FIELDS = (
    ("point_id", pa.string()),
    ("status", pa.string()),
    ("message", pa.string()),
    ("wall_s", pa.float64()),
    ("working_point_residual", pa.float64()),
    ("open_share", pa.float64()),
)
MODE_FIELDS = (
    ("re", pa.float64()),
    ("im", pa.float64()),
    ("overdamped", pa.bool_()),
    ("residual", pa.float64()),
    ("energies", pa.list_(pa.float64())),
    ("shape", pa.binary()),
)
SCHEMA = pa.schema(
    [pa.field(n, t, nullable=False) for n, t in POINT_FIELDS]
    + [pa.field("modes", pa.list_(pa.struct([pa.field(n, t) for n, t in MODE_FIELDS])))]
)


def solved_row(point_id: str, wall_s: float, modes: PointModes) -> dict[str, Any]:
    """Chunk row of a solved point."""
    return {
        "point_id": point_id,
        "status": "ok",
        "message": "",
        "wall_s": wall_s,
        "working_point_residual": modes.working_point.residual,
        "open_share": modes.working_point.open_share,
        "modes": [
            {
                "re": float(lam.real),
                "im": float(lam.imag),
                "overdamped": bool(overdamped),
                "residual": float(residual),
                "energies": energies.tolist(),
                "shape": shape.tobytes(),
            }
            for lam, overdamped, residual, energies, shape in zip(
                modes.lam,
                modes.overdamped,
                modes.residual,
                modes.energies.T,
                modes.shapes,
                strict=True,
            )
        ],
    }


def failed_row(point_id: str, wall_s: float, status: str, message: str) -> dict[str, Any]:
    """Chunk row of a point that has no modes."""
    return {
        "point_id": point_id,
        "status": status,
        "message": message,
        "wall_s": wall_s,
        "working_point_residual": np.nan,
        "open_share": np.nan,
        "modes": [],
    }


def write_chunk(directory: Path, name: str, rows: Sequence[dict[str, Any]]) -> None:
    """Write one chunk file atomically."""
    table = pa.Table.from_pylist(list(rows), schema=SCHEMA)
    write_parquet(directory / DIRECTORY / f"{name}.parquet", table)


def finished_points(directory: Path) -> set[str]:
    """Ids of all points in whole chunk files; files of another schema are passed over."""
    found: set[str] = set()
    for path in sorted((directory / DIRECTORY).glob("*.parquet")):
        if pq.read_schema(path).equals(SCHEMA):
            found.update(pq.read_table(path, columns=["point_id"])["point_id"].to_pylist())
    return found


def read_chunks(directory: Path, wanted: set[str]) -> dict[str, dict[str, Any]]:
    """Rows of the wanted points by id; a point that stands twice is taken once."""
    rows: dict[str, dict[str, Any]] = {}
    for path in sorted((directory / DIRECTORY).glob("*.parquet")):
        if not pq.read_schema(path).equals(SCHEMA):
            continue
        for row in pq.read_table(path).to_pylist():
            if row["point_id"] in wanted:
                rows[row["point_id"]] = row
    return rows
