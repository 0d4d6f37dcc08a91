"""Chunk rows of sensitivity studies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from squealstudy.engine.rows import FLAG, HEAD, REAL, TEXT, head
from squealstudy.modes.sensitivity.mode_sensitivities import ModeSensitivities, Sensitivity
from squealstudy.reduction.working_point import WorkingPoint

WORKING_POINT_FIELDS = (("working_point_residual", REAL), ("open_share", REAL))
SENSITIVITY_FIELDS = (
    ("parameter", TEXT),
    ("value", REAL),
    ("reference", REAL),
    ("change", REAL),
    ("component_frequency_hz", REAL),
    ("slope_re", REAL),
    ("slope_im", REAL),
    ("finite_re", REAL),
    ("finite_im", REAL),
    ("match", REAL),
    ("validity_range", REAL),
    ("near_coalescence", FLAG),
    ("reason", TEXT),
)
MODE_FIELDS = (
    ("re", REAL),
    ("im", REAL),
    ("condition", REAL),
    ("residual", REAL),
    ("biorthogonality", REAL),
    ("energies", pa.list_(REAL)),
    ("sensitivities", pa.list_(pa.struct(list(SENSITIVITY_FIELDS)))),
)
SCHEMA = pa.schema(
    [pa.field(n, t, nullable=False) for n, t in (*HEAD, *WORKING_POINT_FIELDS)]
    + [pa.field("modes", pa.list_(pa.struct(list(MODE_FIELDS))))]
)


def solved_row(
    point_id: str, wall_s: float, point: WorkingPoint, modes: Sequence[ModeSensitivities]
) -> dict[str, Any]:
    """Chunk row of a solved point."""
    return {
        **head(point_id, wall_s),
        "working_point_residual": point.residual,
        "open_share": point.open_share,
        "modes": [_mode(mode) for mode in modes],
    }


def _mode(mode: ModeSensitivities) -> dict[str, Any]:
    return {
        "re": mode.lam.real,
        "im": mode.lam.imag,
        "condition": mode.family.condition,
        "residual": mode.family.residual,
        "biorthogonality": mode.biorthogonality,
        "energies": mode.energies.tolist(),
        "sensitivities": [_sensitivity(s, mode.near_coalescence(s)) for s in mode.sensitivities],
    }


def _sensitivity(s: Sensitivity, near_coalescence: bool) -> dict[str, Any]:
    finite = complex(np.nan, np.nan) if s.finite is None else s.finite.change
    return {
        "parameter": s.step.name,
        "value": s.step.value,
        "reference": s.step.reference,
        "change": s.step.size,
        "component_frequency_hz": s.step.component_hz,
        "slope_re": s.derivative.real,
        "slope_im": s.derivative.imag,
        "finite_re": finite.real,
        "finite_im": finite.imag,
        "match": np.nan if s.finite is None else s.finite.match,
        "validity_range": s.validity,
        "near_coalescence": near_coalescence,
        "reason": s.reason,
    }


def failed_row(point_id: str, wall_s: float, status: str, message: str) -> dict[str, Any]:
    """Chunk row of a point that has no modes."""
    return {
        **head(point_id, wall_s, status, message),
        "working_point_residual": np.nan,
        "open_share": np.nan,
        "modes": [],
    }
