"""Rows of a sensitivity study, and the two tables built from them: points and sensitivities."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import (
    FLAG,
    HEAD,
    REAL,
    TEXT,
    WHOLE_NUMBER,
    WORKING_POINT_FIELDS,
    head,
    planned_table,
    working_point_cells,
)
from squealstudy.engine.store import SENSITIVITIES, Store
from squealstudy.engine.validity import write_points
from squealstudy.modes.sensitivity.mode_sensitivities import (
    ModeSensitivities,
    Sensitivity,
    figure_slopes,
    figures,
)
from squealstudy.reduction.working_point import WorkingPoint

SENSITIVITY_FIELDS = (  # of one mode to one parameter: `Step`, `Sensitivity`, `FiniteChange`
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
ROOT_FIELDS = (
    ("re", REAL),
    ("im", REAL),
    ("condition", REAL),
    ("residual", REAL),
    ("biorthogonality", REAL),
)
MODE_FIELDS = (
    *ROOT_FIELDS,
    ("energies", pa.list_(REAL)),
    ("sensitivities", pa.list_(pa.struct(list(SENSITIVITY_FIELDS)))),
)
MODE_HEAD = (("point_id", TEXT), ("mode", WHOLE_NUMBER), ("main_component", TEXT))
SCHEMA = pa.schema(
    [pa.field(n, t, nullable=False) for n, t in (*HEAD, *WORKING_POINT_FIELDS)]
    + [pa.field("modes", pa.list_(pa.struct(list(MODE_FIELDS))))]
)
RAW = pa.schema([*ROOT_FIELDS, *MODE_HEAD, *SENSITIVITY_FIELDS])  # a row for each sensitivity
PERCENT = 0.01
# share of ``|lambda|`` below which a finite change is round-off: no prediction is compared with it
CHANGE_ROUND_OFF = 1e-12
# name of a parameter of one component mode, such as pad.modes[3].frequency_scale
MODE_PARAMETER = re.compile(r"(?P<component>\w+)\.modes\[(?P<mode>\d+)\]\.\w+")
SUMMARY_FIELDS = (("n_modes", WHOLE_NUMBER), ("max_growth_rate", REAL))
TYPES = {
    **dict.fromkeys(("point_id", "main_component", "parameter", "component", "unit"), TEXT),
    "reason": TEXT,
    **dict.fromkeys(("mode", "component_mode"), WHOLE_NUMBER),
    **dict.fromkeys(("unstable", "near_coalescence"), FLAG),
}


def build_tables(plan: Plan, store: Store) -> pd.DataFrame:
    """Read all chunks, write both tables, return that of the points.

    Raises
    ------
    MachineError
        Where a point of the plan is in no chunk.
    """
    rows = planned_table(plan, store, SCHEMA)
    store.write_table(SENSITIVITIES, _arrow(_sensitivities(plan, rows)))
    point, _, modes = _items(rows["modes"].combine_chunks())
    growth = np.full(len(rows), np.nan)  # the largest of each point; fmax passes over NaN
    np.fmax.at(growth, point, modes.field("re").to_numpy(zero_copy_only=False))
    failed = pc.not_equal(rows["status"], "ok").to_numpy()
    counts = np.bincount(point, minlength=len(rows)).astype(np.int32)
    columns = {name: rows[name] for name, _ in (*HEAD, *WORKING_POINT_FIELDS)}
    columns["n_modes"] = pa.array(counts, WHOLE_NUMBER, mask=failed)
    columns["max_growth_rate"] = pa.array(growth)
    schema = pa.schema([*HEAD, *SUMMARY_FIELDS, *WORKING_POINT_FIELDS])
    return write_points(plan, store, pa.table([columns[n] for n in schema.names], schema=schema))


def _items(lists: pa.ListArray) -> tuple[np.ndarray, np.ndarray, pa.Array]:
    """Row of each item of a column of lists, its index in its list, and the items."""
    counts = lists.value_lengths().fill_null(0).to_numpy(zero_copy_only=False)
    row_of_item = np.repeat(np.arange(len(counts)), counts)
    index_in_list = np.arange(len(row_of_item)) - np.repeat(np.cumsum(counts) - counts, counts)
    return row_of_item, index_in_list, lists.flatten()


def _sensitivities(plan: Plan, rows: pa.Table) -> pd.DataFrame:
    """The table of sensitivities from chunk rows, whose nested lists are made flat."""
    names = pa.array([*plan.study.model.components, "interfaces"])
    units = {p.name: p.unit for p in plan.study.model.parameters}
    point_of_mode, index_of_mode, modes = _items(rows["modes"].combine_chunks())
    mode_of_share, part, energies = _items(modes.field("energies"))
    n_parts = max(len(names), int(part.max(initial=0)) + 1)
    shares = np.full((len(modes), n_parts), -np.inf)  # never the largest where there is none
    shares[mode_of_share, part] = energies.to_numpy(zero_copy_only=False)
    mode, _, fields = _items(modes.field("sensitivities"))
    mode_columns = {  # in the order of RAW
        **{name: modes.field(name) for name, _ in ROOT_FIELDS},
        "point_id": rows["point_id"].combine_chunks().take(point_of_mode),
        "mode": pa.array(index_of_mode + 1, WHOLE_NUMBER),
        "main_component": names.take(shares.argmax(axis=1)),
    }
    columns = [column.take(mode) for column in mode_columns.values()]
    columns += [fields.field(name) for name, _ in SENSITIVITY_FIELDS]
    frame = pa.table(columns, schema=RAW).to_pandas()
    return _columns(frame, units, plan.study.definition.modes.stability_tolerance)


def _columns(raw: pd.DataFrame, units: Mapping[str, str], tolerance: float) -> pd.DataFrame:
    """The table of sensitivities, from roots, slopes and finite changes."""
    lam, slope, finite_change = (
        raw[f"{prefix}re"].to_numpy(float) + 1j * raw[f"{prefix}im"].to_numpy(float)
        for prefix in ("", "slope_", "finite_")
    )
    change, reference = raw["change"].to_numpy(float), raw["reference"].to_numpy(float)
    growth, frequency, zeta = figures(lam)
    mode_of = {name: MODE_PARAMETER.fullmatch(name) for name in raw["parameter"].unique()}
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
            "component": [m["component"] if (m := mode_of[n]) else "" for n in raw["parameter"]],
            "component_mode": [
                int(m["mode"]) if (m := mode_of[n]) else 0 for n in raw["parameter"]
            ],
            "component_frequency_hz": raw["component_frequency_hz"],
            "value": raw["value"],
            "unit": [units.get(name, "") for name in raw["parameter"]],
        }
    )
    quantities = ("growth", "frequency", "damping")
    slopes = figure_slopes(lam, slope)
    before, after = (growth, frequency, zeta), figures(lam + finite_change)
    for name, d in zip(("growth_rate", "frequency_hz", "damping_ratio"), slopes, strict=True):
        table[f"d_{name}"] = d
    for name, d in zip(quantities, slopes, strict=True):
        table[f"{name}_per_percent"] = d * reference * PERCENT
    table["change"] = change
    for name, d, old, new in zip(quantities, slopes, before, after, strict=True):
        table[f"predicted_{name}_change"] = d * change
        table[f"finite_{name}_change"] = new - old
    table["disagreement"] = _disagreement(lam, slope * change, finite_change)
    for name in ("match", "validity_range", "near_coalescence", "reason"):
        table[name] = raw[name]
    return table


def _disagreement(lam: np.ndarray, predicted: np.ndarray, finite: np.ndarray) -> np.ndarray:
    """``|predicted - finite| / |finite|`` of the change of lambda; NaN where nothing changes."""
    size = np.abs(finite)
    above_round_off = size > CHANGE_ROUND_OFF * np.abs(lam)
    return np.where(
        above_round_off, np.abs(predicted - finite) / np.where(above_round_off, size, 1.0), np.nan
    )


def _arrow(table: pd.DataFrame) -> pa.Table:
    schema = pa.schema([(name, TYPES.get(name, REAL)) for name in table.columns])
    return pa.Table.from_pandas(table, schema=schema, preserve_index=False)


def solved_row(
    point_id: str, wall_s: float, point: WorkingPoint, modes: Sequence[ModeSensitivities]
) -> dict[str, Any]:
    """Chunk row of a solved point."""
    return {
        **head(point_id, wall_s),
        **working_point_cells(point),
        "modes": [_mode(mode) for mode in modes],
    }


def _mode(mode: ModeSensitivities) -> dict[str, Any]:
    """Chunk entry of a mode with its sensitivities."""
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
    """Chunk entry of a sensitivity; NaN where the changed model was not solved."""
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
