"""Sensitivities of small models, all design points of a task at once: rows as one Arrow table.

Their structures are not kept in the cache (`Plan.stacked`). A design point that arrays cannot serve
is solved by itself.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pyarrow as pa

from squealstudy.engine.batches import MIN_BATCH_POINTS
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import WORKING_POINT_FIELDS, failed_row
from squealstudy.engine.workers import Solved
from squealstudy.kinds.complex_modes.prepared_point import prepared_of
from squealstudy.kinds.sensitivity.points import SensitivityRequest, point_row
from squealstudy.kinds.sensitivity.tables import MODE_FIELDS, SCHEMA, SENSITIVITY_FIELDS
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.mechanics.sensitivity_batch import batch_sensitivities
from squealstudy.stacked.sensitivities import StackedSensitivities
from squealstudy.study.design import DesignPoint


@dataclass(frozen=True, eq=False)
class BatchTask:
    """Design points for a worker to solve at once, and the request for each of them."""

    points: DesignPoints
    request: SensitivityRequest


def solve_batch(task: BatchTask) -> Solved:
    """Rows of the points of a task, in their order.

    Where a batch of several points fails as a whole its error is raised: the points are then solved
    one by one. A single point that fails has a row with its error.
    """
    started, points = time.perf_counter(), task.points
    tables, numbers = [], []
    try:
        parts = batch_sensitivities(
            points.model, points.options, points.columns, len(points), task.request.of_batch
        )
        for rows, batch_part in parts:
            tables.append(_table(points.at(rows), batch_part, len(rows), len(points), started))
            numbers.append(rows)
            unserved = rows[batch_part.left]
            if len(unserved):
                alone_rows = [_alone(points[int(i)], task.request) for i in unserved]
                served = tables[-1].filter(pa.array(~batch_part.left))
                tables[-1] = pa.concat_tables(
                    [served, pa.Table.from_pylist(alone_rows, schema=SCHEMA)]
                )
                numbers[-1] = np.concatenate([rows[~batch_part.left], unserved])
    except FAILURES as error:
        if len(points) > 1:
            raise
        row = failed_row(SCHEMA, points[0].point_id, *reason(error))
        return Solved([], table=pa.Table.from_pylist([row], schema=SCHEMA))
    order = np.argsort(np.concatenate(numbers), kind="stable")
    return Solved([], table=pa.concat_tables(tables).take(order))


def _alone(point: DesignPoint, request: SensitivityRequest) -> dict[str, Any]:
    return point_row(point, request, partial(prepared_of, point))


def seconds_a_point(plan: Plan, request: SensitivityRequest) -> float | None:
    """Seconds for each point of a first batch, timed for a forecast; None where none is solved."""
    points = plan.tasks.at(slice(0, MIN_BATCH_POINTS))
    started, failed = time.perf_counter(), 0
    try:
        parts = batch_sensitivities(
            points.model, points.options, points.columns, len(points), request.of_batch
        )
        for _, batch_part in parts:
            failed += len(batch_part.system.failures)
    except FAILURES:
        return None
    seconds = (time.perf_counter() - started) / len(points)
    return seconds if failed < len(points) else None


def _table(
    points: DesignPoints,
    sensitivities: StackedSensitivities,
    count: int,
    all_points: int,
    started: float,
) -> pa.Table:
    """Rows of `count` design points; rows of points that arrays cannot serve have no modes."""
    system, sliding = sensitivities.system, sensitivities.system.sliding
    solved = np.ones(count, dtype=bool)
    solved[list(system.failures)] = False
    outcomes = [system.failures.get(i, ("ok", "")) for i in range(count)]
    figures = (
        sliding.residual,
        sliding.open_share,
        sliding.pressure.min(axis=1),
        sliding.pressure.max(axis=1),
    )
    named = zip((name for name, _ in WORKING_POINT_FIELDS), figures, strict=True)
    columns = {
        "point_id": pa.array(points.ids.astype(str)),
        "status": pa.array([status for status, _ in outcomes]),
        "message": pa.array([message for _, message in outcomes]),
        "wall_s": pa.array(np.full(count, (time.perf_counter() - started) / all_points)),
        **{name: pa.array(np.where(solved, values, np.nan)) for name, values in named},
        "modes": _lists(_modes(sensitivities), np.bincount(sensitivities.owner, minlength=count)),
    }
    return pa.Table.from_arrays([columns[name] for name in SCHEMA.names], schema=SCHEMA)


def _modes(sensitivities: StackedSensitivities) -> pa.StructArray:
    """Modes of all points, one after the other, with the fields of MODE_FIELDS."""
    n, parts = sensitivities.energies.shape
    columns = {
        "re": pa.array(sensitivities.lam.real),
        "im": pa.array(sensitivities.lam.imag),
        "condition": pa.array(sensitivities.condition),
        "residual": pa.array(sensitivities.residual),
        "biorthogonality": pa.array(sensitivities.biorthogonality),
        "energies": _lists(pa.array(sensitivities.energies.ravel()), np.full(n, parts)),
        "sensitivities": _lists(
            _sensitivities(sensitivities), np.full(n, len(sensitivities.names))
        ),
    }
    return _structs(columns, MODE_FIELDS)


def _sensitivities(sensitivities: StackedSensitivities) -> pa.StructArray:
    """Sensitivities of all modes, one after the other, with the fields of SENSITIVITY_FIELDS."""
    names = pa.array(sensitivities.names, pa.string())
    values = {
        "value": sensitivities.value,
        "reference": sensitivities.reference,
        "change": sensitivities.change,
        "component_frequency_hz": sensitivities.component_hz,
        "slope_re": sensitivities.derivative.real,
        "slope_im": sensitivities.derivative.imag,
        "finite_re": sensitivities.finite.real,
        "finite_im": sensitivities.finite.imag,
        "match": sensitivities.match,
        "validity_range": sensitivities.validity,
        "near_coalescence": sensitivities.near_coalescence,
    }
    columns = {name: pa.array(np.ravel(column)) for name, column in values.items()}
    columns["parameter"] = names.take(np.tile(np.arange(len(names)), len(sensitivities.lam)))
    columns["reason"] = pa.array(sensitivities.reason.ravel(), pa.string())
    return _structs(columns, SENSITIVITY_FIELDS)


def _structs(columns: dict[str, pa.Array], fields: Any) -> pa.StructArray:
    arrays = [columns[name].cast(kind) for name, kind in fields]
    return pa.StructArray.from_arrays(arrays, fields=[pa.field(n, t) for n, t in fields])


def _lists(values: pa.Array, count: np.ndarray) -> pa.ListArray:
    """Consecutive lists of the values; `count` has the length of each."""
    return pa.ListArray.from_arrays(pa.array(np.append(0, np.cumsum(count)), pa.int32()), values)
