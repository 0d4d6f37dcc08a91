"""The two tables of a sensitivity study, built from its chunk files: points and sensitivities."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import FLAG, REAL, TEXT, WHOLE, planned_rows, points_table
from squealstudy.engine.store import POINTS, SENSITIVITIES, write_parquet
from squealstudy.engine.validity import validity_arrow
from squealstudy.kinds.sensitivity.rows import SCHEMA, WORKING_POINT_FIELDS
from squealstudy.modes.sensitivity.mode_sensitivities import figure_slopes, figures

PERCENT = 0.01
NOISE = 1e-12  # of |lambda|: finite changes below are round-off, nothing is compared with them
MODE_OF = re.compile(r"(?P<component>\w+)\.modes\[(?P<mode>\d+)\]\.\w+")
SUMMARY_FIELDS = (("n_modes", WHOLE), ("max_growth_rate", REAL))
TYPES = {
    **dict.fromkeys(("point_id", "main_component", "parameter", "component", "unit"), TEXT),
    "reason": TEXT,
    **dict.fromkeys(("mode", "component_mode"), WHOLE),
    **dict.fromkeys(("unstable", "near_coalescence"), FLAG),
}


def build_tables(plan: Plan, directory: Path) -> pd.DataFrame:
    """Read all chunks, write both tables, return that of the points.

    Raises
    ------
    ResultsError
        Where a point of the plan is in no chunk.
    """
    rows = planned_rows(plan, directory, SCHEMA)
    points = _points(plan, rows)
    write_parquet(directory / POINTS, points)
    write_parquet(directory / SENSITIVITIES, _arrow(_sensitivities(plan, rows)))
    frame: pd.DataFrame = points.to_pandas()
    return frame


def _points(plan: Plan, rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    filled = []
    for row in rows:
        growth = max((m["re"] for m in row["modes"]), default=np.nan)
        count = len(row["modes"]) if row["status"] == "ok" else None
        filled.append({**row, "n_modes": count, "max_growth_rate": growth})
    return validity_arrow(
        plan, points_table(plan, filled, (*SUMMARY_FIELDS, *WORKING_POINT_FIELDS))
    )


def _sensitivities(plan: Plan, rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    names = [*plan.study.model.components, "interfaces"]
    units = {p.name: p.unit for p in plan.study.model.parameters}
    flat: list[dict[str, Any]] = []
    for row in rows:
        for number, mode in enumerate(row["modes"], start=1):
            head = {k: mode[k] for k in ("re", "im", "condition", "residual", "biorthogonality")}
            head |= {"point_id": row["point_id"], "mode": number}
            head["main_component"] = names[int(np.argmax(mode["energies"]))]
            flat.extend({**head, **s} for s in mode["sensitivities"])
    frame = pd.DataFrame(flat, columns=None if flat else _raw_columns())
    return _columns(frame, units, plan.study.definition.modes.stability_tolerance)


def _raw_columns() -> list[str]:
    mode = ["re", "im", "condition", "residual", "biorthogonality", "point_id", "mode"]
    nested = SCHEMA.field("modes").type.value_type.field("sensitivities").type.value_type
    return [*mode, "main_component", *(field.name for field in nested)]


def _columns(raw: pd.DataFrame, units: Mapping[str, str], tolerance: float) -> pd.DataFrame:
    """The table's columns from roots, slopes and finite changes."""
    lam, slope, finite = (
        raw[f"{a}re"].to_numpy(float) + 1j * raw[f"{a}im"].to_numpy(float)
        for a in ("", "slope_", "finite_")
    )
    change, reference = raw["change"].to_numpy(float), raw["reference"].to_numpy(float)
    growth, frequency, zeta = figures(lam)
    owners = [MODE_OF.fullmatch(name) for name in raw["parameter"]]
    table = pd.DataFrame(
        {
            "point_id": raw["point_id"],
            "mode": raw["mode"],
            "frequency_hz": frequency,
            "growth_rate": growth,
            "damping_ratio": zeta,
            "unstable": zeta < -tolerance,
            "main_component": raw["main_component"],
            **{k: raw[k] for k in ("condition", "residual", "biorthogonality", "parameter")},
            "component": [m["component"] if m else "" for m in owners],
            "component_mode": [int(m["mode"]) if m else 0 for m in owners],
            "component_frequency_hz": raw["component_frequency_hz"],
            "value": raw["value"],
            "unit": [units.get(name, "") for name in raw["parameter"]],
        }
    )
    quantities = ("growth", "frequency", "damping")
    slopes = figure_slopes(lam, slope)
    moved = [b - a for a, b in zip((growth, frequency, zeta), figures(lam + finite), strict=True)]
    for name, d in zip(("growth_rate", "frequency_hz", "damping_ratio"), slopes, strict=True):
        table[f"d_{name}"] = d
    for name, d in zip(quantities, slopes, strict=True):
        table[f"{name}_per_percent"] = d * reference * PERCENT
    table["change"] = change
    for name, d, actual in zip(quantities, slopes, moved, strict=True):
        table[f"predicted_{name}_change"] = d * change
        table[f"finite_{name}_change"] = actual
    table["disagreement"] = _disagreement(lam, slope * change, finite)
    for name in ("match", "validity_range", "near_coalescence", "reason"):
        table[name] = raw[name]
    return table


def _disagreement(lam: np.ndarray, predicted: np.ndarray, finite: np.ndarray) -> np.ndarray:
    """|predicted - finite| / |finite| of the change of lambda; NaN where nothing changes."""
    size = np.abs(finite)
    seen = size > NOISE * np.abs(lam)
    return np.where(seen, np.abs(predicted - finite) / np.where(seen, size, 1.0), np.nan)


def _arrow(table: pd.DataFrame) -> pa.Table:
    schema = pa.schema([(name, TYPES.get(name, REAL)) for name in table.columns])
    return pa.Table.from_pandas(table, schema=schema, preserve_index=False)
