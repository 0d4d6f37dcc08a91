"""The tables of a transient study, built from its chunk files: points, modes and growth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa

from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import REAL, TEXT, Fields, planned_rows, points_table
from squealstudy.engine.store import GROWTH, HISTORIES, MODES, POINTS, STATES, write_parquet
from squealstudy.engine.validity import validity_arrow
from squealstudy.kinds.transient.rows import GROWTH_FIELDS, MODE_FIELDS, SCHEMA, SUMMARY_FIELDS
from squealstudy.motion.outcome.settling import DECAYED, SETTLED


def build_tables(plan: Plan, directory: Path) -> pd.DataFrame:
    """Read all chunks, write the three tables, return that of the points.

    Raises
    ------
    ResultsError
        Where a point of the plan is in no chunk.
    """
    rows = planned_rows(plan, directory, SCHEMA)
    _remove_unplanned(directory, {row["point_id"] for row in rows})
    points = validity_arrow(plan, points_table(plan, rows, SUMMARY_FIELDS))
    write_parquet(directory / POINTS, points)
    write_parquet(directory / MODES, _modes(plan, rows))
    write_parquet(directory / GROWTH, _growth(rows))
    frame: pd.DataFrame = points.to_pandas()
    return frame


def simulated_time(points: pd.DataFrame, duration: float) -> dict[str, float]:
    """How many runs ended before their `duration` [s] as settled or decayed, and what that saved.

    Returns
    -------
    dict
        ``settled``, ``decayed``: number of runs; ``asked_s``, ``saved_s``: simulated time of the
        runs that did not fail, s.
    """
    early = points[points["stop_reason"].isin([SETTLED, DECAYED])]
    return {
        **{name: int((early["stop_reason"] == name).sum()) for name in (SETTLED, DECAYED)},
        "asked_s": float(duration * (points["status"] == "ok").sum()),
        "saved_s": float((duration - early["time_reached"]).sum()),
    }


def _remove_unplanned(directory: Path, ids: set[str]) -> None:
    """Histories and final states of points that the study no longer has."""
    for name in (HISTORIES, STATES):
        for path in (directory / name).glob("*"):
            if path.stem not in ids:
                path.unlink()


def _modes(plan: Plan, rows: Sequence[dict[str, Any]]) -> pa.Table:
    names = [f"energy_{c}" for c in (*plan.study.model.components, "interfaces")]
    fields: Fields = (*MODE_FIELDS, *((name, REAL) for name in names))
    spread = [
        {**row, "modes": [m | dict(zip(names, m["energies"], strict=True)) for m in row["modes"]]}
        for row in rows
    ]
    return _nested(spread, "modes", fields)


def _growth(rows: Sequence[dict[str, Any]]) -> pa.Table:
    """Rows of all followed modes; `expressed` is missing where it cannot be told."""
    table = _nested(rows, "growth", GROWTH_FIELDS)
    frame = table.to_pandas().astype({"expressed": "boolean"})
    return pa.Table.from_pandas(frame, schema=table.schema, preserve_index=False)


def _nested(rows: Sequence[dict[str, Any]], name: str, fields: Fields) -> pa.Table:
    flat = [{"point_id": row["point_id"], **item} for row in rows for item in row[name]]
    return pa.Table.from_pylist(flat, schema=pa.schema([("point_id", TEXT), *fields]))
