"""Times a method of complex-mode studies and reads its results, for work-precision studies."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import is_prepared, load_any, prepared_model
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.measurement import Measurement, MeasurementRequest, Measuring
from squealstudy.engine.method import RungChoice
from squealstudy.engine.plan import Plan
from squealstudy.engine.store import Store
from squealstudy.engine.workers import Workers
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.complex_modes.kind import ComplexModes
from squealstudy.kinds.complex_modes.onsets import UNREFINED
from squealstudy.kinds.complex_modes.problems import problem_of
from squealstudy.kinds.complex_modes.rows import SCHEMA, read_columns
from squealstudy.kinds.complex_modes.solve_tasks import SolveTask
from squealstudy.kinds.complex_modes.tracked_modes import follow_modes
from squealstudy.machine.resources import memory_above
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.modes.full_order.finer_model import finer_modes
from squealstudy.modes.judged_roots import settled
from squealstudy.modes.rungs import rung_named
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.study.parameters import onset_parameter
from squealstudy.tables.families import RENUMBERED
from squealstudy.tables.method_quality import onset_errors, root_errors
from squealstudy.tables.stability import BROKEN, FIRST_SEEN, INTO

# s; imports and first reads from the cache may be a large part of a shorter time
MIN_RELIABLE_TIMING_S = 5.0


def measure_modes(plan: Plan, measured: Sequence[int], request: MeasurementRequest) -> Measurement:
    """Solve chosen points of a complex-mode study by its method, in a scratch directory.

    Parameters
    ----------
    plan : Plan
        Plan whose structures are in the cache: those of the chosen points, or of all points if the
        rung shares work between points.
    measured : sequence of int
        Positions of the points among the plan's.
    request : MeasurementRequest
        Lines on which onsets are sought.
    """
    kind = ComplexModes()
    chosen = [plan.tasks[i] for i in measured]
    lines = request.lines
    on_lines = [i for line in lines.values() for i in line]
    measured_points = plan.tasks.at(np.array(list(dict.fromkeys([*measured, *on_lines]))))
    solved = plan.tasks if plan.method.rung.shares_work else measured_points
    with tempfile.TemporaryDirectory() as scratch:
        all_tasks = kind.tasks(plan, solved, Workers())
        tasks = [task for task in all_tasks if isinstance(task, SolveTask)]
        loading_s = _load_problems(tasks)
        with memory_above() as memory, threadpool_limits(1):
            seconds, found_rows = _solved(kind, tasks)
        store = Store(Path(scratch))
        store.write_rows(found_rows, SCHEMA)
        seconds /= len(solved)
        rows = store.rows([t.point_id for t in chosen], SCHEMA)
        findings = {str(n): modes_finding(rows[t.point_id]) for n, t in enumerate(chosen)}
        onset_search_s = []
        for n, line in lines.items():
            onset, spent = onset_finding(LinePlan(plan, line), store)
            findings[str(n)] |= onset
            onset_search_s.append(spent)
    line_points = len(on_lines) / len(lines) if lines else np.nan
    onset_s = line_points * seconds + float(np.mean(onset_search_s)) if lines else np.nan
    used = {t.structure.path: t.structure for t in tasks if rung_named(t.rung).over_a_basis}
    return Measurement(
        seconds=seconds,
        setup_seconds=loading_s + float(sum(s.basis().seconds for s in used.values())),
        reduction_seconds=reduction_seconds(plan),
        memory_mb=memory.megabytes,
        n_coordinates=_n_coordinates(plan, chosen[0].structure),
        findings=findings,
        onset_seconds=onset_s,
        line_points=line_points,
    )


def _n_coordinates(plan: Plan, structure: str) -> int:
    """Number of coordinates of the model of a structure: degrees of freedom at full order."""
    prepared = load_any(structure)
    if plan.method.rung.unreduced and isinstance(prepared, PreparedModel):
        return prepared.n_dof
    return int(prepared.model.n)


def onset_finding(line: LinePlan, store: Store) -> tuple[dict[str, Any], float]:
    """The onset on a line of solved points as keys of a finding, and processor seconds for it.

    Without an onset the keys tell why.
    """
    started = time.process_time()
    try:
        with threadpool_limits(1):
            onset, width = find_onset(line, store)
    except FAILURES as error:
        status, message = reason(error)
        finding: dict[str, Any] = {"status": status, "message": f"on the line of onset: {message}"}
    else:
        finding = {"onset": list(onset), "onset_range": width}
    return finding, time.process_time() - started


def _load_problems(tasks: Sequence[SolveTask]) -> float:
    """Read problems and bases of the tasks into memory; return processor seconds."""
    started = time.process_time()
    for task in tasks:
        rung = rung_named(task.rung)
        problem = problem_of(task.structure, rung)
        if rung.over_a_basis:
            _ = problem.basis_reader
    return time.process_time() - started


def _solved(kind: ComplexModes, tasks: Sequence[SolveTask]) -> tuple[float, list[dict[str, Any]]]:
    """Solve the tasks; return processor seconds and the rows of the tasks.

    Tasks that take less than MIN_RELIABLE_TIMING_S are solved twice, and the shorter time counts.
    """
    spent: list[float] = []
    rows: list[dict[str, Any]] = []
    while not spent or (len(spent) == 1 and spent[0] < MIN_RELIABLE_TIMING_S):
        started = time.process_time()
        # working points are not stored: a second round must not start from those of the first
        forgetful = [replace(task, keep_gaps=False) for task in tasks]
        rows = [row for task in forgetful for row in kind.solve(task).rows]
        spent.append(time.process_time() - started)
    return min(spent), rows


def reduction_seconds(plan: Plan) -> float:
    """Seconds to reduce all structures of a study, estimated from those in the cache."""
    made_keys = [key for key in plan.structures if is_prepared(key)]
    spent = sum(sum(load_any(key).timings.values()) for key in made_keys)
    return float(spent) * len(plan.structures) / max(len(made_keys), 1)


def finer_finding(plan: Plan, point: int) -> dict[str, Any] | None:
    """Roots of the finer model at a point as a finding; None where there is no finer model.

    The error of a reduced model is estimated by the distance of its roots from the finer ones,
    times FINER_MODEL_SAFETY_FACTOR (modes/full_order/finer_model.py).
    """
    task = plan.tasks[point]
    prepared = prepared_model(task.structure)
    if prepared.finer is None:
        return None
    try:
        with threadpool_limits(1):
            modes = finer_modes(prepared, task.state(), plan.band_hz)
    except FAILURES as error:
        status, message = reason(error)
        return {"status": status, "message": message}
    lam = modes.lam[~modes.overdamped]
    roots = np.column_stack([lam.real, lam.imag]).tolist()
    return {"status": "ok", "message": "", "roots": roots}


def modes_finding(row: dict[str, Any]) -> dict[str, Any]:
    """Oscillating modes of a point as a finding, from its chunk row of a complex-mode study."""
    oscillates = ~np.array(row["overdamped"], dtype=bool)
    roots = np.column_stack([row["re"], row["im"]]).reshape(-1, 2)[oscillates]
    estimates = np.array(row["error_rung"], dtype=float)[oscillates]
    return {
        "status": row["status"],
        "message": row["message"],
        "served_by": row["method"],
        "roots": roots.tolist(),
        "estimates": [None if np.isnan(e) else float(e) for e in estimates],
    }


MEASURING = Measuring(
    quantities=(
        "frequency",
        "damping_ratio",
        "unstable_frequency",
        "unstable_damping_ratio",
        "growth_rate",
        "onset",
    ),
    judged=("frequency", "damping_ratio"),
    measure=measure_modes,
    comparisons=(root_errors, onset_errors),
    finding=modes_finding,
)


Interval = tuple[float | None, float | None, float | None]  # onset, its bounds; all None without


class LinePlan(Plan):
    """A plan of some design points that differ only in one parameter, to find an onset on the line.

    Their identities, structures and method are those of the whole plan.

    Parameters
    ----------
    whole : Plan
        The whole plan.
    rows : sequence of int
        Positions of the points among the whole plan's.
    """

    def __init__(self, whole: Plan, rows: Sequence[int]) -> None:
        super().__init__(whole.study, whole.swept[list(rows)], whole.enriched)
        self._whole, self._rows = whole, tuple(rows)

    @property
    def whole(self) -> Plan:
        """The plan that these points belong to."""
        return self._whole

    @property
    def along(self) -> str:
        """The parameter along which the onset is sought."""
        name = onset_parameter([sweep.name for sweep in self.study.sweeps])
        assert name is not None
        return name

    @cached_property
    def method(self) -> RungChoice:
        """The rung that solves the whole plan's points."""
        return self.whole.method

    @cached_property
    def tasks(self) -> DesignPoints:
        """The points, named as in the whole plan."""
        return self.whole.tasks.at(np.array(self._rows))

    @property
    def grid_shape(self) -> tuple[int, ...]:
        """Numbers of values of the sweeps: all points along the line, one across."""
        return tuple(
            len(self._rows) if sweep.name == self.along else 1 for sweep in self.study.sweeps
        )


def find_onset(plan: LinePlan, store: Store) -> tuple[Interval, float]:
    """The first onset on a line whose points are finished, and the range of the parameter on it.

    Raises
    ------
    ConvergenceError
        Where a point of the line is not ok: the onset may lie there.
    """
    columns = read_columns(store, [task.point_id for task in plan.tasks])
    points = columns.points.select(["point_id", "status", "message"]).to_pandas()
    try:
        bad = points[points["status"] != "ok"]
        if len(bad):
            raise ConvergenceError(bad["status"].iloc[0], bad["message"].iloc[0])
        for name in plan.study.shown_parameters:
            points[name] = plan.tasks.column(name)
        judged = settled(columns.lam, columns.error_rung, plan.method.tolerance)
        followed = follow_modes(plan, columns, points, judged, columns.error_rung, Workers())
    finally:
        if columns.shapes is not None:
            columns.shapes.remove()
    assert followed.onsets is not None
    x = np.sort(points[plan.along].to_numpy(float))
    return first_onset(followed.onsets, x), float(np.ptp(x))


def first_onset(onsets: pd.DataFrame, x: np.ndarray) -> Interval:
    """The smallest onset in a table of one line, with its bounds.

    It is the smallest value of the parameter at which an oscillating mode turns unstable, or the
    first value where one is unstable there already.

    Parameters
    ----------
    onsets : DataFrame
        As `OnsetSearch.table` makes it.
    x : ndarray (n,)
        Values of the parameter, ascending.
    """
    turning_unstable = onsets[(onsets["direction"] == INTO) & (onsets["status"] != RENUMBERED)]
    if not len(turning_unstable):
        return None, None, None
    # a mode that is unstable from the start counts as unstable at the first value of the range
    first_seen = turning_unstable["bracket_high"].where(
        turning_unstable["status"] == BROKEN, float(x[0])
    )
    values = turning_unstable["onset"].fillna(first_seen).to_numpy(float)
    row = turning_unstable.iloc[int(np.argmin(values))]
    onset = float(values.min())
    return onset, *_bounds(row, onset, x)


def _bounds(row: pd.Series, value: float, x: np.ndarray) -> tuple[float, float]:
    """Bounds of an onset: from its error estimate, else the points between which it lies."""
    if np.isfinite(row["error_estimate"]):
        error = float(row["error_estimate"])
        return value - error, value + error
    if row["status"] == UNREFINED[FIRST_SEEN]:
        return float(x[max(int(np.searchsorted(x, value)) - 1, 0)]), value
    if row["status"] == BROKEN:
        stable = float(row["bracket_low"])
        return float(x[0]) if np.isnan(stable) else stable, value
    low, high = row["bracket_low"], row["bracket_high"]
    return (float(low), float(high)) if np.isfinite(row["onset"]) else (value, value)
