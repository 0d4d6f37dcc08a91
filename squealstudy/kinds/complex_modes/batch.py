"""Complex modes of small models, all design points of a task at once: rows as one Arrow table.

Structures of a few coordinates take microseconds to make. They are made together with their points
and are not kept in the cache (`Plan.stacked`). The prepared model of a single design point is made
when it is asked for (`prepared_point`).
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from squealstudy.engine.batches import MIN_BATCH_POINTS, batch_parts
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import failed_row
from squealstudy.engine.workers import Solved
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.complex_modes.rows import SCHEMA
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.modes.point import DENSE
from squealstudy.modes.tracking.refinement import Modes
from squealstudy.stacked.modes import StackedSystem, stacked_system
from squealstudy.stacked.roots import StackedRoots
from squealstudy.study.design import DesignPoint


@dataclass(frozen=True, eq=False)
class BatchTask:
    """Design points for a worker to solve at once.

    Attributes
    ----------
    points : DesignPoints
        Points of a small model.
    band_hz : (low, high)
        Frequency band of the modes, Hz.
    """

    points: DesignPoints
    band_hz: tuple[float, float]


def batch_tasks(plan: Plan, points: DesignPoints, jobs: int) -> Iterator[BatchTask]:
    """Tasks of consecutive points, as `batch_parts` cuts them."""
    return (BatchTask(part, plan.band_hz) for part in batch_parts(points, jobs))


def solve_batch(task: BatchTask) -> Solved:
    """Rows of the points of a task, in their order.

    Where a batch of several points fails as a whole its error is raised: the points are then solved
    one by one. A single point that fails has a row with its error.
    """
    started = time.perf_counter()
    points = task.points
    try:
        system = system_of(points)
    except FAILURES as error:
        if len(points) > 1:
            raise
        return Solved([], table=_failed_table(points, *reason(error)))
    roots = system.roots(task.band_hz)
    return Solved([], table=_table(points, system, roots, started))


def system_of(points: DesignPoints) -> StackedSystem:
    """The linearised systems of design points; SquealstudyError where none can be assembled."""
    return stacked_system(points.model, points.options, points.columns, len(points))


def modes_at(design: DesignPoint, band_hz: tuple[float, float]) -> Modes:
    """Oscillating modes of one design point in the band; ConvergenceError where it fails."""
    system = _alone(design)
    roots = system.roots(band_hz)
    oscillating = np.flatnonzero(roots.held[0] & (roots.lam[0].imag != 0))
    return Modes(roots.lam[0, oscillating], system.shapes(roots.psi)[0, oscillating])


def _alone(design: DesignPoint) -> StackedSystem:
    values = {name: np.array([number]) for name, number in design.values.items()}
    system = stacked_system(design.model, design.options, values, 1)
    if system.failures:
        raise ConvergenceError(*system.failures[0])
    return system


def seconds_a_point(plan: Plan) -> float | None:
    """Seconds for each point of a first batch, timed for a forecast; None where none is solved."""
    points = plan.tasks.at(slice(0, MIN_BATCH_POINTS))
    started = time.perf_counter()
    try:
        system = system_of(points)
        system.roots(plan.band_hz)
    except FAILURES:
        return None
    solved = len(system.failures) < len(points)
    return (time.perf_counter() - started) / len(points) if solved else None


def wider_roots(
    points: DesignPoints, band_hz: tuple[float, float]
) -> list[tuple[np.ndarray, np.ndarray] | None]:
    """Roots (k,) and their errors, rad/s, of each design point in a band; None where it failed."""
    try:
        system = system_of(points)
    except FAILURES:
        if len(points) == 1:
            return [None]
        each = (points.at(np.array([i])) for i in range(len(points)))
        return [point_roots for one in each for point_roots in wider_roots(one, band_hz)]
    roots = system.roots(band_hz)
    return [
        None if i in system.failures else (roots.lam[i, :n], roots.error[i, :n])
        for i, n in enumerate(roots.count.tolist())
    ]


def _table(
    points: DesignPoints, system: StackedSystem, roots: StackedRoots, started: float
) -> pa.Table:
    """Chunk table of a batch of small models: one row for each design point."""
    count, is_root, sliding = roots.count, roots.held, system.sliding
    m = len(count)
    solved = np.ones(m, dtype=bool)
    solved[list(system.failures)] = False
    failures = [system.failures.get(i, ("ok", "")) for i in range(m)]
    lam = roots.lam[is_root]
    energies = system.energies(roots.psi).swapaxes(1, 2)[is_root]
    shapes = np.ascontiguousarray(system.shapes(roots.psi)[is_root])
    springs = system.structures.spring_points.shape[1]
    pressed = sliding.pressure[:, : sliding.pressure.shape[1] - springs]

    def figures(values: np.ndarray) -> np.ndarray:
        return np.where(solved, values, np.nan)

    lists = {
        "re": lam.real,
        "im": lam.imag,
        "overdamped": lam.imag == 0,
        "residual": roots.residual[is_root],
        "error_rung": roots.error[is_root],
    }
    columns: dict[str, pa.Array] = {
        "point_id": pa.array(points.ids.astype(str)),
        "status": pa.array([status for status, _ in failures]),
        "message": pa.array([message for _, message in failures]),
        "method": pa.array([DENSE if ok else "" for ok in solved.tolist()]),
        "working_point_residual": pa.array(figures(sliding.residual)),
        "open_share": pa.array(figures(sliding.open_share)),
        "contact_pressure_min": pa.array(figures(pressed.min(axis=1))),
        "contact_pressure_max": pa.array(figures(pressed.max(axis=1))),
        **{name: _lists(values, count) for name, values in lists.items()},
        "energies": _lists(energies.ravel(), count * energies.shape[1]),
        "shapes": _binaries(shapes, count),
    }
    columns["wall_s"] = pa.array(np.full(m, (time.perf_counter() - started) / m))
    return pa.Table.from_arrays([columns[name] for name in SCHEMA.names], schema=SCHEMA)


def _failed_table(points: DesignPoints, status: str, message: str) -> pa.Table:
    rows = [failed_row(SCHEMA, name, status, message) for name in points.ids.astype(str).tolist()]
    return pa.Table.from_pylist(rows, schema=SCHEMA)


def _ends(count: np.ndarray) -> pa.Array:
    return pa.array(np.append(0, np.cumsum(count)).astype(np.int32))


def _lists(values: np.ndarray, count: np.ndarray) -> pa.Array:
    return pa.ListArray.from_arrays(_ends(count), pa.array(values))


def _binaries(rows: np.ndarray, count: np.ndarray) -> pa.Array:
    """One binary value for each point: the bytes of its `count` rows."""
    ends = _ends(count * rows.shape[1] * rows.itemsize)
    buffers = [None, ends.buffers()[1], pa.py_buffer(rows.tobytes())]
    return pa.Array.from_buffers(pa.binary(), len(count), buffers)
