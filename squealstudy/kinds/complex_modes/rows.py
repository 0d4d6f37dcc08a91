"""Chunk rows of complex-mode studies: the modes of a point are lists, side by side."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa

from squealstudy.engine.rows import HEAD, head
from squealstudy.modes.point import PointModes

DENSE = "dense"
POINT_FIELDS = (
    *HEAD,
    ("method", pa.string()),
    ("working_point_residual", pa.float64()),
    ("open_share", pa.float64()),
)
MODE_FIELDS = (
    ("re", pa.list_(pa.float64())),
    ("im", pa.list_(pa.float64())),
    ("overdamped", pa.list_(pa.bool_())),
    ("residual", pa.list_(pa.float64())),
    ("error_rung", pa.list_(pa.float64())),  # 1/s; NaN where it is not estimated
    ("energies", pa.list_(pa.float64())),  # (m, components + 1) by rows; may be empty
)
SHAPES = "shapes"  # (m, k) complex64 by rows
SCHEMA = pa.schema(
    [pa.field(n, t, nullable=False) for n, t in (*POINT_FIELDS, *MODE_FIELDS)]
    + [pa.field(SHAPES, pa.binary(), nullable=False)]
)


def solved_row(point_id: str, wall_s: float, modes: PointModes) -> dict[str, Any]:
    """Chunk row of a solved point; models without a working point have none of its figures."""
    point = modes.working_point
    return head(point_id, wall_s) | {
        "method": modes.method,
        "working_point_residual": np.nan if point is None else point.residual,
        "open_share": np.nan if point is None else point.open_share,
        "re": modes.lam.real,
        "im": modes.lam.imag,
        "overdamped": modes.overdamped,
        "residual": modes.residual,
        "error_rung": modes.error_rung,
        "energies": modes.energies.T.ravel(),
        SHAPES: np.ascontiguousarray(modes.shapes, dtype=np.complex64).tobytes(),
    }


def failed_row(point_id: str, wall_s: float, status: str, message: str) -> dict[str, Any]:
    """Chunk row of a point that has no modes."""
    return head(point_id, wall_s, status, message) | {
        "method": "",
        "working_point_residual": np.nan,
        "open_share": np.nan,
        **{name: [] for name, _ in MODE_FIELDS},
        SHAPES: b"",
    }
