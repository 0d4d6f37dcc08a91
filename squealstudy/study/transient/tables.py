"""The tables of a transient study, built from its chunk files: points, modes and growth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa

from squealstudy.errors import ResultsError
from squealstudy.study.chunks import read_chunks
from squealstudy.study.files import write_parquet
from squealstudy.study.names import GROWTH, HISTORIES, MODES, POINTS, STATES
from squealstudy.study.plan import Plan
from squealstudy.study.transient.rows import (
    GROWTH_FIELDS,
    MODE_FIELDS,
    POINT_FIELDS,
    REAL,
    SCHEMA,
    SUMMARY_FIELDS,
    TEXT,
)

Fields = Sequence[tuple[str, pa.DataType]]


def build_tables(plan: Plan, directory: Path) -> pd.DataFrame:
    """Read all chunks, write the three tables, return that of the points.

    Raises
    ------
    ResultsError
        Where a point of the plan is in no chunk.
    """
    ids = [task.point_id for task in plan.tasks]
    found = read_chunks(directory, set(ids), SCHEMA)
    missing = sum(i not in found for i in ids)
    if missing:
        raise ResultsError(f"{directory}: {missing} of {len(ids)} design points are not solved")
    rows = [found[i] for i in ids]
    _remove_unplanned(directory, set(ids))
    points = _points(plan, rows)
    write_parquet(directory / POINTS, points)
    write_parquet(directory / MODES, _modes(plan, rows))
    write_parquet(directory / GROWTH, _nested(rows, "growth", GROWTH_FIELDS))
    frame: pd.DataFrame = points.to_pandas()
    return frame


def _remove_unplanned(directory: Path, ids: set[str]) -> None:
    """Histories and final states of points that the study no longer has."""
    for name in (HISTORIES, STATES):
        for path in (directory / name).glob("*"):
            if path.stem not in ids:
                path.unlink()


def _points(plan: Plan, rows: Sequence[dict[str, Any]]) -> pa.Table:
    parameters = plan.study.shown_parameters
    filled = [
        {**row, **{p: float(values[p]) for p in parameters}}
        for row, values in zip(rows, plan.shown_values, strict=True)
    ]
    fields: Fields = (*POINT_FIELDS, *((p, REAL) for p in parameters), *SUMMARY_FIELDS)
    return pa.Table.from_pylist(filled, schema=pa.schema(list(fields)))


def _modes(plan: Plan, rows: Sequence[dict[str, Any]]) -> pa.Table:
    names = [f"energy_{c}" for c in (*plan.study.model.components, "interfaces")]
    fields: Fields = (*MODE_FIELDS, *((name, REAL) for name in names))
    spread = [
        {**row, "modes": [m | dict(zip(names, m["energies"], strict=True)) for m in row["modes"]]}
        for row in rows
    ]
    return _nested(spread, "modes", fields)


def _nested(rows: Sequence[dict[str, Any]], name: str, fields: Fields) -> pa.Table:
    flat = [{"point_id": row["point_id"], **item} for row in rows for item in row[name]]
    return pa.Table.from_pylist(flat, schema=pa.schema([("point_id", TEXT), *fields]))
