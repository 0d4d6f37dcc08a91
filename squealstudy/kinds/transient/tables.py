"""Chunk rows of transient studies; their tables of points, modes, growth and windows."""

from __future__ import annotations

from typing import Any

import pandas as pd
import pyarrow as pa

from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import (
    FLAG,
    HEAD,
    REAL,
    TEXT,
    WHOLE_NUMBER,
    failed_row,
    items,
    planned_table,
    structs,
)
from squealstudy.engine.store import GROWTH, MODES, WINDOWS, Store
from squealstudy.engine.validity import write_points
from squealstudy.motion.outcome.settling import DECAYED, SETTLED
from squealstudy.wording import FAILED

SCHEDULED = ("sliding_speed", "pressure")
SUMMARY_FIELDS = (
    ("class", TEXT),
    ("undecided_until", REAL),
    ("n_unstable", WHOLE_NUMBER),
    ("n_unstable_above", WHOLE_NUMBER),
    ("n_unstable_below", WHOLE_NUMBER),
    ("predicted_frequency_hz", REAL),
    ("predicted_growth_rate", REAL),
    ("growth_rate", REAL),
    ("growth_rate_low", REAL),
    ("growth_rate_high", REAL),
    ("growth_rate_step_error", REAL),
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
    ("torque_rms_window", REAL),
    ("torque_rms_step", REAL),
    ("torque_rms_rows", REAL),
    ("torque_peak_to_peak", REAL),
    ("torque_peak_to_peak_low", REAL),
    ("torque_peak_to_peak_high", REAL),
    ("swing_spread", REAL),
    ("bounds_reason", TEXT),
    ("frequency_hz", REAL),
    ("frequency_error", REAL),
    ("torque_line_hz", REAL),
    ("dominant_level", REAL),
    ("harmonic_2_level", REAL),
    ("harmonic_3_level", REAL),
    ("dominant_mode", WHOLE_NUMBER),
    ("dominant_share", REAL),
    ("transfer_from", WHOLE_NUMBER),
    ("transfer_to", WHOLE_NUMBER),
    ("transfer_time", REAL),
    ("energy_outside_share", REAL),
    ("energy_balance", REAL),
    ("stick_share", REAL),
    ("stick_share_max", REAL),
    ("stick_creep", REAL),
    ("open_share", REAL),
    ("open_share_max", REAL),
    ("iterations_mean", REAL),
    ("iterations_max", WHOLE_NUMBER),
    ("halvings", WHOLE_NUMBER),
    ("newton_steps", WHOLE_NUMBER),
    ("contraction", REAL),
    ("stick_number", REAL),
    ("time_reached", REAL),
    ("stop_reason", TEXT),
    ("n_coordinates", WHOLE_NUMBER),
    ("n_contact_points", WHOLE_NUMBER),
    ("perturbation", REAL),
    ("invalid_reason", TEXT),
)
MODE_FIELDS = (
    ("mode", WHOLE_NUMBER),
    ("frequency_hz", REAL),
    ("energy_share", REAL),
    ("energy_share_low", REAL),
    ("energy_share_high", REAL),
    ("energy_mean", REAL),
    ("first_share", REAL),
)
ENERGIES = ("energies", pa.list_(REAL))  # shares of each component, then of the interfaces
GROWTH_FIELDS = (
    ("mode", WHOLE_NUMBER),
    ("frequency_hz", REAL),
    ("growth_rate", REAL),
    ("damping_ratio", REAL),
    ("unstable", FLAG),
    ("fitted_growth_rate", REAL),
    ("fitted_low", REAL),
    ("fitted_high", REAL),
    ("fit_start", REAL),
    ("fit_stop", REAL),
    ("fit_status", TEXT),
    ("step_error", REAL),
    ("level_share", REAL),
    ("expressed", FLAG),
)
LEVEL_NAMES = ("torque_mean", "torque_rms", "torque_peak_to_peak")
WINDOW_FIELDS = (
    ("window", WHOLE_NUMBER),
    *((f"{name}_{end}", REAL) for name in ("time", *SCHEDULED) for end in ("start", "stop")),
    ("class", TEXT),
    *((f"{name}{end}", REAL) for name in LEVEL_NAMES for end in ("", "_low", "_high")),
    ("frequency_hz", REAL),
    ("torque_line_hz", REAL),
    ("dominant_level", REAL),
    ("energy_mean", REAL),
    ("stick_share", REAL),
    ("stick_share_max", REAL),
    ("open_share", REAL),
    ("open_share_max", REAL),
)


def build_tables(plan: Plan, store: Store) -> pd.DataFrame:
    """Read all chunks, write the tables, return that of the points.

    Raises
    ------
    MachineError
        Where a point of the plan is in no chunk.
    """
    found = planned_table(plan, store, SCHEMA)
    store.write_table(MODES, _modes(plan, found))
    store.write_table(GROWTH, _growth(found))
    store.write_table(WINDOWS, items(found, "windows", WINDOW_FIELDS))
    fields = pa.schema([*HEAD, *SUMMARY_FIELDS])
    return write_points(plan, store, found.select(fields.names).cast(fields))


def simulated_time(points: pd.DataFrame, duration: float) -> dict[str, float]:
    """How many runs ended before their `duration` [s], settled or decayed, and the time saved.

    Returns
    -------
    dict
        ``settled``, ``decayed``: number of runs that ended early; ``asked_s``: duration of all runs
        that are ok, s; ``saved_s``: time that was not simulated, s.
    """
    early = points[points["stop_reason"].isin([SETTLED, DECAYED])]
    return {
        **{name: int((early["stop_reason"] == name).sum()) for name in (SETTLED, DECAYED)},
        "asked_s": float(duration * (points["status"] == "ok").sum()),
        "saved_s": float((duration - early["time_reached"]).sum()),
    }


def _modes(plan: Plan, findings: pa.Table) -> pa.Table:
    """Table of all sensed modes, with the energy share of each component and of the interfaces."""
    names = [f"energy_{c}" for c in (*plan.study.model.components, "interfaces")]
    table = items(findings, "modes", (*MODE_FIELDS, ENERGIES))
    shares = table[ENERGIES[0]].combine_chunks().flatten().to_numpy().reshape(-1, len(names))
    table = table.drop_columns(ENERGIES[0])
    for name, share in zip(names, shares.T, strict=True):
        table = table.append_column(name, pa.array(share, REAL))
    return table


def _growth(findings: pa.Table) -> pa.Table:
    """Table of all followed modes; `expressed` is missing where it cannot be told."""
    table = items(findings, "growth", GROWTH_FIELDS)
    frame = table.to_pandas().astype({"expressed": "boolean"})
    return pa.Table.from_pandas(frame, schema=table.schema, preserve_index=False)


SCHEMA = pa.schema(
    [pa.field(n, t, nullable=t in (WHOLE_NUMBER, FLAG)) for n, t in (*HEAD, *SUMMARY_FIELDS)]
    + [
        pa.field("modes", structs((*MODE_FIELDS, ENERGIES))),
        pa.field("growth", structs(GROWTH_FIELDS)),
        pa.field("windows", structs(WINDOW_FIELDS)),
    ]
)


def row(point_id: str, wall_s: float, status: str, message: str, **cells: Any) -> dict[str, Any]:
    """Chunk row of a design point with these cells; in others numbers are NaN and texts empty."""
    return failed_row(SCHEMA, point_id, status, message, wall_s) | cells


def lost_row(point_id: str, status: str, message: str) -> dict[str, Any]:
    """Chunk row of a point that was not integrated."""
    return failed_row(SCHEMA, point_id, status, message) | {"class": FAILED, "stop_reason": FAILED}
