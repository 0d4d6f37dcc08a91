"""Chunk rows of work-precision studies: one a method, knob value and round."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pyarrow as pa

from squealstudy.engine.measurement import Measurement
from squealstudy.engine.rows import HEAD, REAL, TEXT, WHOLE, head

FIELDS = (
    ("variant", TEXT),
    ("round", WHOLE),
    ("seconds", REAL),
    ("setup_seconds", REAL),
    ("reduction_seconds", REAL),
    ("memory_mb", REAL),
    ("iterations", REAL),
    ("n_coordinates", WHOLE),
    ("n_failed", WHOLE),
    ("onset_seconds", REAL),
    ("line_points", REAL),
    ("findings", TEXT),  # JSON: measured point -> what was found there
)
SCHEMA = pa.schema([pa.field(n, t, nullable=False) for n, t in (*HEAD, *FIELDS)])


def row(name: str, variant: str, number: int, wall_s: float, made: Measurement) -> dict[str, Any]:
    """Chunk row of a measurement."""
    failed = [f for f in made.findings.values() if f["status"] != "ok"]
    status = "ok" if not failed else str(failed[0]["status"])
    message = "" if not failed else str(failed[0].get("message", ""))
    return head(name, wall_s, status, message) | {
        "variant": variant,
        "round": number,
        "seconds": made.seconds,
        "setup_seconds": made.setup_seconds,
        "reduction_seconds": made.reduction_seconds,
        "memory_mb": made.memory_mb,
        "iterations": made.iterations,
        "n_coordinates": made.n_coordinates,
        "n_failed": made.n_failed,
        "onset_seconds": made.onset_seconds,
        "line_points": made.line_points,
        "findings": json.dumps(made.findings),
    }


def failed_row(
    name: str, variant: str, number: int, wall_s: float, status: str, message: str
) -> dict[str, Any]:
    """Chunk row of a method that could not run at all."""
    empty = Measurement(
        seconds=np.nan,
        setup_seconds=np.nan,
        reduction_seconds=np.nan,
        memory_mb=np.nan,
        iterations=np.nan,
        n_coordinates=0,
        findings={},
    )
    return row(name, variant, number, wall_s, empty) | {"status": status, "message": message}
