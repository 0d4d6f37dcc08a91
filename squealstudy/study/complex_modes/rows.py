"""Chunk rows of complex-mode studies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa

from squealstudy.analysis.point import PointModes

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
