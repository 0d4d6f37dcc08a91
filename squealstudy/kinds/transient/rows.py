"""Chunk rows of transient studies, and the columns of their tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from squealstudy.engine.rows import FLAG, HEAD, REAL, TEXT, WHOLE, Fields, head
from squealstudy.wording import FAILED

EMPTY = {TEXT: "", REAL: np.nan, WHOLE: None, FLAG: None}

SUMMARY_FIELDS = (
    ("class", TEXT),
    ("undecided_until", REAL),
    ("n_unstable", WHOLE),
    ("n_unstable_above", WHOLE),
    ("predicted_frequency_hz", REAL),
    ("predicted_growth_rate", REAL),
    ("growth_rate", REAL),
    ("growth_rate_low", REAL),
    ("growth_rate_high", REAL),
    ("growth_method", TEXT),
    ("onset_time", REAL),
    ("settled", FLAG),
    ("settled_time", REAL),
    ("torque_static", REAL),
    ("torque_mean", REAL),
    ("torque_mean_low", REAL),
    ("torque_mean_high", REAL),
    ("torque_rms", REAL),
    ("torque_rms_low", REAL),
    ("torque_rms_high", REAL),
    ("torque_peak_to_peak", REAL),
    ("dominant_frequency_hz", REAL),
    ("dominant_level", REAL),
    ("harmonic_2_level", REAL),
    ("harmonic_3_level", REAL),
    ("dominant_mode", WHOLE),
    ("dominant_share", REAL),
    ("transfer_from", WHOLE),
    ("transfer_to", WHOLE),
    ("transfer_time", REAL),
    ("energy_outside_share", REAL),
    ("energy_balance", REAL),
    ("stick_share", REAL),
    ("stick_share_max", REAL),
    ("stick_creep", REAL),
    ("open_share", REAL),
    ("open_share_max", REAL),
    ("iterations_mean", REAL),
    ("iterations_max", WHOLE),
    ("halvings", WHOLE),
    ("newton_steps", WHOLE),
    ("contraction", REAL),
    ("stick_number", REAL),
    ("time_reached", REAL),
    ("stop_reason", TEXT),
    ("n_coordinates", WHOLE),
    ("n_contact_points", WHOLE),
    ("perturbation", REAL),
    ("invalid_reason", TEXT),
)
MODE_FIELDS = (
    ("mode", WHOLE),
    ("frequency_hz", REAL),
    ("energy_share", REAL),
    ("energy_share_low", REAL),
    ("energy_share_high", REAL),
    ("energy_mean", REAL),
    ("first_share", REAL),
)
GROWTH_FIELDS = (
    ("mode", WHOLE),
    ("frequency_hz", REAL),
    ("growth_rate", REAL),
    ("damping_ratio", REAL),
    ("unstable", FLAG),
    ("fitted_growth_rate", REAL),
    ("fitted_low", REAL),
    ("fitted_high", REAL),
    ("fit_start", REAL),
    ("fit_stop", REAL),
    ("level_share", REAL),
    ("expressed", FLAG),
)


def _structs(fields: Fields) -> pa.DataType:
    return pa.list_(pa.struct([pa.field(n, t) for n, t in fields]))


SCHEMA = pa.schema(
    [pa.field(n, t, nullable=EMPTY[t] is None) for n, t in (*HEAD, *SUMMARY_FIELDS)]
    + [
        pa.field("modes", _structs((*MODE_FIELDS, ("energies", pa.list_(REAL))))),
        pa.field("growth", _structs(GROWTH_FIELDS)),
    ]
)


def row(
    point_id: str,
    wall_s: float,
    status: str,
    message: str,
    summary: Mapping[str, Any],
    modes: Sequence[Mapping[str, Any]] = (),
    growth: Sequence[Mapping[str, Any]] = (),
) -> dict[str, Any]:
    """Chunk row of a design point; what the summary does not say is empty."""
    known = {name: summary.get(name, EMPTY[kind]) for name, kind in SUMMARY_FIELDS}
    return {
        **head(point_id, wall_s, status, message),
        **known,
        "modes": [dict(m) for m in modes],
        "growth": [dict(g) for g in growth],
    }


def failed_row(point_id: str, wall_s: float, status: str, message: str) -> dict[str, Any]:
    """Chunk row of a point that has no motion."""
    return row(point_id, wall_s, status, message, {"class": FAILED, "stop_reason": FAILED})
