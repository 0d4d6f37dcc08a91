"""Chunk rows of work-precision studies: one a method, knob value and round."""

from __future__ import annotations

import json
from typing import Any

import pyarrow as pa

from squealstudy.engine.measurement import Measurement
from squealstudy.engine.rows import HEAD, REAL, TEXT, WHOLE, head

MEASURED = (  # attributes of a Measurement
    ("seconds", REAL),
    ("setup_seconds", REAL),
    ("reduction_seconds", REAL),
    ("memory_mb", REAL),
    ("iterations", REAL),
    ("n_coordinates", WHOLE),
    ("n_failed", WHOLE),
    ("onset_seconds", REAL),
    ("line_points", REAL),
)
# findings are JSON: measured point -> what was found there
FIELDS = (("variant", TEXT), ("round", WHOLE), *MEASURED, ("findings", TEXT))
SCHEMA = pa.schema([pa.field(n, t, nullable=False) for n, t in (*HEAD, *FIELDS)])


def row(name: str, variant: str, number: int, wall_s: float, made: Measurement) -> dict[str, Any]:
    """Chunk row of a measurement."""
    failed = [f for f in made.findings.values() if f["status"] != "ok"]
    status = "ok" if not failed else str(failed[0]["status"])
    message = "" if not failed else str(failed[0].get("message", ""))
    measured = {name: getattr(made, name) for name, _ in MEASURED}
    own = {"variant": variant, "round": number, "findings": json.dumps(made.findings)}
    return head(name, wall_s, status, message) | measured | own


def failed_row(
    name: str, variant: str, number: int, wall_s: float, status: str, message: str
) -> dict[str, Any]:
    """Chunk row of a method that could not run at all."""
    nothing = row(name, variant, number, wall_s, Measurement())
    return nothing | {"status": status, "message": message}
