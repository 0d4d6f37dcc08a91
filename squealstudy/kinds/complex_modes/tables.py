"""The tables of a complex-mode study, built from its chunk files: points, modes and onsets."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import COUNT, HEAD, REAL
from squealstudy.engine.store import MODES, ONSETS, Store
from squealstudy.engine.validity import write_points
from squealstudy.engine.workers import Workers
from squealstudy.kinds.complex_modes.errors import ModeErrors, mode_errors
from squealstudy.kinds.complex_modes.outside_band import Outside, look_outside, outside_facts
from squealstudy.kinds.complex_modes.reduction_errors import ReductionErrors
from squealstudy.kinds.complex_modes.rows import POINT_FIELDS, ModeColumns, read_columns
from squealstudy.kinds.complex_modes.tracked_modes import follow_modes
from squealstudy.kinds.complex_modes.turning_check import turning_facts
from squealstudy.modes.judged_roots import damping_ratios, settled, stability_names, uncertain_roots
from squealstudy.modes.tracking.labels import Tracks

# columns: numbers of modes; _low without and _high with those whose stability is uncertain
COUNTS = ("n_modes", "n_unstable", "n_unstable_low", "n_unstable_high", "n_overdamped")
# columns: number of unstable modes below and above the band; missing where none were sought
OUTSIDE = ("n_unstable_below", "n_unstable_above")
# columns: the unstable mode outside the band that grows fastest
GROWTH_OUTSIDE = ("growth_outside", "frequency_outside_hz")
ERRORS = ("reference_frequency_error", "reference_damping_error")
POINT_COLUMNS = (
    *((name, COUNT) for name in COUNTS),
    *(field for field in POINT_FIELDS if field not in HEAD),
    *((name, COUNT) for name in OUTSIDE),
    *((name, REAL) for name in GROWTH_OUTSIDE),
    *((name, REAL) for name in ERRORS),
)
UNTRACKED = -1  # in place of a track number

Labels = tuple[np.ndarray, np.ndarray, np.ndarray]  # of all modes: track, MAC, ambiguous


def build_tables(
    plan: Plan,
    store: Store,
    workers: Workers,
    samples: Sequence[tuple[int, ReductionErrors]] = (),
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Read all chunks, track the modes and write the tables.

    Returns the points' table, and facts for the manifest. `samples` are errors of the reduction at
    some of the points (`make_samples`).

    Raises
    ------
    MachineError
        Where a point of the plan is in no chunk.
    """
    section = plan.study.definition.modes
    columns = read_columns(store, plan.tasks.ids, section.track, plan.method.largest_error)
    references = store.references()
    errors, facts = mode_errors(plan, columns, samples, references)
    # an approximate method moves neutral roots to either side: growth within its error is none
    judged = settled(columns.lam, columns.error_rung, plan.method.tolerance)
    unstable = damping_ratios(judged) < -section.stability_tolerance
    uncertain = uncertain_roots(columns.lam, errors.total, section.stability_tolerance)
    started = time.perf_counter()
    searched = look_outside(plan, columns, workers)
    outside = outside_facts(plan, searched, started)
    turning = turning_facts(plan, columns, workers)  # effect of gyroscopic terms left out
    point_results = _point_results(columns, unstable, uncertain, references, searched)
    points = write_points(plan, store, point_results)
    tracks, onsets = None, None
    names = [f"energy_{part}" for part in plan.study.model.energy_parts]
    summary: dict[str, Any] = {}
    try:
        if columns.shapes is not None:
            followed = follow_modes(plan, columns, points, judged, errors.total, workers)
            tracks, onsets = followed.tracks, followed.onsets
            summary = {**followed.summary, "seconds": followed.seconds}
            del followed
    finally:
        if columns.shapes is not None:
            columns.shapes.remove()  # a temporary file, for tracking alone
    store.write_table(ONSETS, onsets_arrow(onsets))
    labels = mode_labels(columns.overdamped, tracks)
    del judged, tracks  # large, and not needed any more

    def modes(rows: slice) -> pa.Table:
        return modes_table(columns, errors, labels, unstable, uncertain, names, rows)

    store.write_parts(MODES, len(columns.lam), modes)
    return points, {**summary, "errors": facts, "outside_band": outside, "turning": turning}


def modes_table(
    columns: ModeColumns,
    errors: ModeErrors,
    labels: Labels,
    unstable: np.ndarray,
    uncertain: np.ndarray,
    energies: Sequence[str],
    rows: slice = slice(None),
) -> pa.Table:
    """The table of modes with one row for each, or the `rows` of it that are wanted.

    `energies` are the names of the energy columns; a model may have none.
    """
    label, mac, ambiguous = labels
    point, lam = columns.point[rows], columns.lam[rows]
    first_mode = np.cumsum(columns.counts) - columns.counts  # of each point, in the whole table
    number = np.arange(len(columns.point))[rows] - first_mode[point] + 1  # from 1 at each point
    table = {
        "point_id": columns.points["point_id"].take(point),
        "mode": number.astype(np.int32),
        "track": label[rows],
        "track_mac": mac[rows],
        "track_ambiguous": ambiguous[rows],
        "frequency_hz": np.abs(lam) / (2 * np.pi),
        "growth_rate": lam.real,
        "damping_ratio": damping_ratios(lam),
        "unstable": unstable[rows],
        "stability": pa.array(stability_names(unstable[rows], uncertain[rows]), pa.string()),
        "overdamped": columns.overdamped[rows],
        "residual": columns.residual[rows],
        "error_rung": errors.rung[rows],
        "error_reduction": errors.reduction[rows],
        "error_estimate": errors.total[rows],
        "method": columns.points["method"].take(point),
    }
    shares = dict(zip(energies, columns.energies[rows].T, strict=False))
    return pa.table(table | shares)


def mode_labels(overdamped: np.ndarray, tracks: Tracks | None) -> Labels:
    """Track, MAC and ambiguity (N,) of every mode; overdamped roots are UNTRACKED."""
    n = len(overdamped)
    label = np.full(n, UNTRACKED, dtype=np.int32)
    mac, ambiguous = np.full(n, np.nan), np.zeros(n, dtype=bool)
    if tracks is not None:
        tracked = ~overdamped
        label[tracked] = tracks.labels.flat
        mac[tracked] = tracks.macs.flat
        ambiguous[tracked] = tracks.ambiguous.flat
    return label, mac, ambiguous


def _point_results(
    columns: ModeColumns,
    unstable: np.ndarray,
    uncertain: np.ndarray,
    references: Mapping[str, Mapping[str, Any]],
    searched: Sequence[Outside],
) -> pa.Table:
    """The columns HEAD and POINT_COLUMNS: a row for each point, failed ones too."""
    points = columns.points
    failed = pc.not_equal(points["status"], "ok").to_numpy()
    counted_modes = (  # in the order of COUNTS
        np.ones(len(unstable), dtype=bool),
        unstable,
        unstable & ~uncertain,
        unstable | uncertain,
        columns.overdamped,
    )
    table = {name: points[name] for name in points.column_names}
    for name, is_counted in zip(COUNTS, counted_modes, strict=True):
        number = np.bincount(columns.point[is_counted], minlength=len(failed))
        table[name] = pa.array(number, COUNT, mask=failed)  # missing, not zero
    table |= _outside_columns(searched, len(failed))
    for name in ERRORS:
        key = name.removeprefix("reference_")  # its name in a full-order check
        error_of = {i: check[key] for i, check in references.items() if check.get(key) is not None}
        rows = pc.index_in(pa.array(list(error_of), pa.string()), value_set=points["point_id"])
        rows = rows.fill_null(-1).to_numpy()  # -1: a check of a point that is not in this study
        values, missing = np.full(len(failed), np.nan), np.ones_like(failed)
        values[rows[rows >= 0]] = np.array(list(error_of.values()), float)[rows >= 0]
        missing[rows[rows >= 0]] = False
        table[name] = pa.array(values, REAL, mask=missing)
    schema = pa.schema([*HEAD, *POINT_COLUMNS])
    return pa.Table.from_arrays([table[name] for name in schema.names], schema=schema)


def _outside_columns(searched: Sequence[Outside], count: int) -> dict[str, pa.Array]:
    """Columns of modes that grow outside the band; missing at points where none were sought."""
    values = np.full((4, count), np.nan)  # rows: OUTSIDE, then GROWTH_OUTSIDE
    for point in searched:
        lam = np.concatenate([point.below, point.above])
        values[:2, point.row] = len(point.below), len(point.above)
        if len(lam):
            root = lam[np.argmax(lam.real)]
            values[2:, point.row] = root.real, abs(root) / (2 * np.pi)
    missing = np.isnan(values)
    counts = [
        pa.array(np.nan_to_num(row).astype(int), COUNT, mask=mask)
        for row, mask in zip(values[:2], missing[:2], strict=True)
    ]
    growth = [
        pa.array(row, REAL, mask=mask) for row, mask in zip(values[2:], missing[2:], strict=True)
    ]
    return dict(zip((*OUTSIDE, *GROWTH_OUTSIDE), (*counts, *growth), strict=True))


def onsets_arrow(table: pd.DataFrame | None) -> pa.Table:
    """The table of onsets with its explicit schema; an empty one where there is none."""
    types = {
        "track": pa.int32(),
        "onset": REAL,
        "bracket_low": REAL,
        "bracket_high": REAL,
        "frequency_hz": REAL,
        "direction": pa.string(),
        "status": pa.string(),
        "error_estimate": REAL,
        "evaluations": pa.int32(),
        "point_before": pa.string(),
        "point_after": pa.string(),
    }
    if table is None:
        return pa.schema(types).empty_table()
    schema = pa.schema([(name, types.get(name, REAL)) for name in table.columns])
    return pa.Table.from_pandas(table, schema=schema, preserve_index=False)
