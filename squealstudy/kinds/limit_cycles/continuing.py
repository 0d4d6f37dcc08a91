"""The tables of a study of limit cycles: rows of its design points, and cycles continued to others.

A design point's stored row depends on that point only. Cycles that are continued from one point to
another are added to the tables, not to stored rows.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from squealstudy.cycles.cycle import LEVELS, are_one_cycle
from squealstudy.engine.cycle_states import cycle_file, stored_cycles
from squealstudy.engine.keys import content_hash
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import (
    FLAG,
    REAL,
    TEXT,
    WHOLE_NUMBER,
    WORKING_POINT_FIELDS,
    nested,
    planned_rows,
    tabled,
)
from squealstudy.engine.store import BORDERS, BRANCHES, CURVES, CYCLES, VELOCITIES, VERDICTS, Store
from squealstudy.engine.validity import write_points
from squealstudy.engine.workers import Workers
from squealstudy.kinds.limit_cycles.bordering import BORDER_FIELDS, follow_borders, planes
from squealstudy.kinds.limit_cycles.continued import (
    Continued,
    LineTask,
    Mark,
    Start,
    StepTask,
    follow_line,
    step_to_neighbour,
)
from squealstudy.kinds.limit_cycles.designs import request
from squealstudy.kinds.limit_cycles.judged_again import judge_again
from squealstudy.kinds.limit_cycles.observed import VELOCITY_FIELDS, Observers
from squealstudy.kinds.limit_cycles.tables import (
    CURVE_FIELDS,
    CYCLE_FIELDS,
    SCHEMA,
    SUMMARY_FIELDS,
    VERDICT_FIELDS,
    cycle_row,
)
from squealstudy.modes.tracking.tree import grid_places

N_NEAREST_DESIGNS = 3  # number of neighbours of a design that is on no grid
BRANCH_FIELDS = (
    ("cycle_id", TEXT),
    ("mode", WHOLE_NUMBER),
    ("n_step", WHOLE_NUMBER),
    ("along", TEXT),
    ("value", REAL),
    ("value_error", REAL),
    ("event", TEXT),
    ("criticality", TEXT),
    ("branch_end", TEXT),
    ("frequency_hz", REAL),
    *((n, REAL) for n in ("torque_rms", "level_error", "contact_velocity", "open_share_max")),
    ("stable", FLAG),
    ("n_unstable", WHOLE_NUMBER),
    ("multiplier", REAL),
    ("multiplier_error", REAL),
    ("n_harmonics", WHOLE_NUMBER),
    ("harmonic_tail", REAL),
    ("basis_error", REAL),
    ("balance_residual", REAL),
)


def build_tables(plan: Plan, store: Store, workers: Workers) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Continue cycles and write the tables; returns that of the points, and facts.

    Raises
    ------
    MachineError
        Where a point of the plan is in no chunk.
    """
    rows = planned_rows(plan, store, SCHEMA)
    started = time.perf_counter()
    work = Continuation(plan, store, rows, workers)
    if plan.study.section.follow is not None:
        work.follow(plan.study.section.follow)
    if plan.study.section.borders_over is not None:
        work.continue_borders(plan.study.section.follow, plan.study.section.borders_over)
    if plan.study.section.neighbours:
        work.try_neighbours()
    work.keep()
    observers = Observers(plan)
    velocities = work.observed(observers) if observers.has_requests else []
    seconds = time.perf_counter() - started
    store.write_table(VERDICTS, nested(rows, "verdicts", VERDICT_FIELDS))
    cycles = nested(rows, "cycles", CYCLE_FIELDS)
    frame = cycles.to_pandas().astype({"stable": "boolean"})
    store.write_table(CYCLES, pa.Table.from_pandas(frame, cycles.schema, preserve_index=False))
    store.write_table(CURVES, nested(rows, "curves", CURVE_FIELDS))
    schema = pa.schema([("point_id", TEXT), *BRANCH_FIELDS])
    branches = pa.Table.from_pylist(work.branches, schema)
    frame = branches.to_pandas().astype({"stable": "boolean"})
    store.write_table(BRANCHES, pa.Table.from_pandas(frame, schema, preserve_index=False))
    schema = pa.schema([("point_id", TEXT), *BORDER_FIELDS])
    store.write_table(BORDERS, pa.Table.from_pylist(work.borders, schema=schema))
    schema = pa.schema([("point_id", TEXT), *VELOCITY_FIELDS])
    store.write_table(VELOCITIES, pa.Table.from_pylist(velocities, schema=schema))
    points = write_points(plan, store, tabled(rows, (*SUMMARY_FIELDS, *WORKING_POINT_FIELDS)))
    facts = {"seconds": {"continued_s": seconds}, "continued": work.facts}
    unobserved = {"not_observed": sorted(changed)} if (changed := observers.changed_bases) else {}
    return points, unobserved | (facts if work.facts["tried"] else {"seconds": {}})


class Continuation:
    """Continues the cycles of a study's design points to others.

    Parameters
    ----------
    plan : Plan
    store : Store
    rows : list of dict
        Chunk rows of all design points in the plan's order; new cycles are added to them.
    workers : Workers

    Attributes
    ----------
    branches, borders : list of dict
        Rows of these tables.
    facts : dict
        Numbers of cycles ``tried``, and ``found`` at designs; list of those ``lost``, with reasons.
    """

    def __init__(
        self, plan: Plan, store: Store, rows: list[dict[str, Any]], workers: Workers
    ) -> None:
        self._plan, self._store, self._rows, self._workers = plan, store, rows, workers
        self._request = request(plan)
        self._numbers = {row["point_id"]: k for k, row in enumerate(rows)}
        self._new: dict[str, tuple[np.ndarray, float]] = {}
        self._structure: dict[str, str] = {}
        self._marks: list[Mark] = []
        self.branches: list[dict[str, Any]] = []
        self.borders: list[dict[str, Any]] = []
        self.facts: dict[str, Any] = {"tried": 0, "found": 0, "lost": []}

    # -- what is known --------------------------------------------------------------------------
    def _starts(self) -> dict[str, Start]:
        """All cycles of the study's design points, by id."""
        cycle_rows = {
            c["cycle_id"]: c for row in self._rows for c in row["cycles"] if c["same_as"] == ""
        }
        starts = {}
        for series in stored_cycles(self._store):
            if series.cycle_id in cycle_rows:
                mode = cycle_rows[series.cycle_id]["mode"]
                phi = self._request.shared_modes(series.prepared_key).phi
                starts[series.cycle_id] = Start(
                    series.cycle_id, mode, 0.0, series.Q @ phi, series.omega
                )
        for name, (Q, omega) in self._new.items():
            starts[name] = Start(name, cycle_rows[name]["mode"], 0.0, Q, omega)
        return starts

    # -- along a parameter ----------------------------------------------------------------------
    def follow(self, along: str) -> None:
        """Follow branches along a parameter, on all lines of design points."""
        tasks = list(self._lines(along))
        if not tasks:
            return
        self.facts["tried"] += sum(len(task.starts) for task in tasks)
        for continuation in self._workers.each(follow_line, tasks, stage="branches"):
            self.branches += continuation.branches
            self._marks += continuation.marks
            self._join(continuation.cycles, continuation.lost)

    def continue_borders(self, along: str, over: str) -> None:
        """Continue folds and Hopf points of the branches over a second parameter, on all planes."""
        tasks = list(planes(self._plan, self._request, along, over, self._marks))
        for rows, lost in self._workers.each(follow_borders, tasks, stage="borders"):
            self.borders += rows
            self.facts["lost"] += lost

    def _lines(self, along: str) -> Iterator[LineTask]:
        """Tasks that continue cycles along the lines of one parameter."""
        plan, starts = self._plan, self._starts()
        column = [s.name for s in plan.study.sweeps].index(along)
        others = np.delete(plan.swept, column, axis=1)
        keys = np.column_stack([others, plan.tasks.structure_index])
        ok = np.array([row["status"] == "ok" for row in self._rows])
        _, line = np.unique(keys, axis=0, return_inverse=True)
        for number in range(int(line.max(initial=-1)) + 1):
            on_line = np.flatnonzero((line == number) & ok)
            on_line = on_line[np.argsort(plan.swept[on_line, column], kind="stable")]
            if len(np.unique(plan.swept[on_line, column])) < 2:
                continue
            chosen = []
            for k in on_line.tolist():
                parameter_value = float(plan.tasks.column(along)[k])
                chosen += [
                    (c["contact_velocity"], replace(starts[c["cycle_id"]], value=parameter_value))
                    for c in self._rows[k]["cycles"]
                    if c["cycle_id"] in starts
                ]
            chosen.sort(key=lambda item: -item[0])
            if chosen:
                points = plan.tasks.at(on_line)
                yield LineTask(self._request, points, along, tuple(s for _, s in chosen))

    # -- to neighbours --------------------------------------------------------------------------
    def try_neighbours(self) -> None:
        """Continue stable cycles to neighbours without one, again while new ones are found."""
        tried: set[tuple[int, str]] = set()
        while True:
            tasks = list(self._steps(tried))
            if not tasks:
                return
            self.facts["tried"] += len(tasks)
            before = self.facts["found"]
            for continuation in self._workers.each(step_to_neighbour, tasks, stage="neighbours"):
                self._join(continuation.cycles, continuation.lost)
            if self.facts["found"] == before:
                return

    def _steps(self, tried: set[tuple[int, str]]) -> Iterator[StepTask]:
        """Tasks that continue the stable cycles of neighbours to designs without a stable cycle."""
        if all(map(_has_stable, self._rows)) or not any(map(_has_stable, self._rows)):
            return
        starts, tasks = self._starts(), self._plan.tasks
        for k, row in enumerate(self._rows):
            if row["status"] != "ok" or _has_stable(row):
                continue
            for other in self._neighbours(k):
                for cycle in self._rows[other]["cycles"]:
                    name = cycle["cycle_id"]
                    if not cycle["stable"] or name not in starts or (k, name) in tried:
                        continue
                    tried.add((k, name))
                    yield StepTask(self._request, tasks.at(np.array([other, k])), starts[name])

    def _neighbours(self, k: int) -> list[int]:
        """Design points of the same structure one step away on a grid; else the nearest."""
        plan = self._plan
        x, shape = plan.coordinates, plan.grid_shape
        same = plan.tasks.structure_index == plan.tasks.structure_index[k]
        if shape is not None:
            grid_index = grid_places(x, shape)
            distance = np.abs(grid_index - grid_index[k]).sum(axis=1)
            return [int(i) for i in np.flatnonzero((distance == 1) & same)]
        width = np.ptp(x, axis=0)
        distance = (((x - x[k]) / np.where(width > 0, width, 1.0)) ** 2).sum(axis=1)
        distance[~same] = np.inf
        distance[k] = np.inf
        nearest = np.argsort(distance, kind="stable")[:N_NEAREST_DESIGNS]
        return [int(i) for i in nearest if np.isfinite(distance[i]) and distance[i] > 0]

    # -- what is found --------------------------------------------------------------------------
    def _join(self, cycles: list[Continued], lost: list[str]) -> None:
        """Enter continued cycles in the rows of their designs, and judge these again."""
        self.facts["lost"] += lost
        for continued in cycles:
            k = self._numbers[continued.point_id]
            row, point = self._rows[k], self._plan.tasks[k]
            mode = _family(row, self._rows[self._numbers[continued.origin.point_id]], continued)
            came = f"a cycle continued from {continued.origin.cycle_id}"
            if continued.cycle is None:
                self.facts["lost"].append(f"{continued.origin.cycle_id}: at {continued.point_id}")
                judge_again(row, mode, f"{came} could not be confirmed")
                continue
            number = 1 + sum(c["mode"] == mode for c in row["cycles"])
            name = f"{continued.point_id}-{mode}-{number}"
            new_row = cycle_row(name, mode, continued.cycle, point.law_kind)
            new_row["continued_from"] = continued.origin.cycle_id
            if any(_is_same_row(new_row, cycle_there) for cycle_there in row["cycles"]):
                continue
            row["cycles"].append(new_row)
            self._new[name] = (continued.cycle.motion.Q, continued.cycle.motion.omega)
            self._structure[name] = point.structure
            self.facts["found"] += 1
            judge_again(row, mode, came, new_row)

    def keep(self) -> None:
        """Write the series of the new cycles."""
        files: dict[str, Any] = {}
        for key in sorted(set(self._structure.values())):
            phi = self._request.shared_modes(key).phi
            new_series = {
                name: (Q @ phi.T, omega)
                for name, (Q, omega) in self._new.items()
                if self._structure[name] == key
            }
            files |= cycle_file(
                content_hash(["continued", key, self._plan.study_hash]), key, new_series
            )
        if files:
            self._store.write_files(files)

    def observed(self, observers: Observers) -> list[dict[str, Any]]:
        """Add radiated powers to the cycles; rows of the velocities of points in all cycles."""
        cycle_of = {c["cycle_id"]: c for row in self._rows for c in row["cycles"]}
        rows = {}
        for series in stored_cycles(self._store):
            if series.cycle_id in cycle_of:
                power, rows[series.cycle_id] = observers.observe(series)
                cycle_of[series.cycle_id]["radiated_power"] = power
        velocity_rows = []
        for name, cycle in cycle_of.items():  # the same cycle of another family, too
            same = cycle["same_as"] or name
            cycle["radiated_power"] = cycle_of[same]["radiated_power"]
            identity = {"point_id": name.partition("-")[0], "cycle_id": name, "mode": cycle["mode"]}
            velocity_rows += [row | identity for row in rows.get(same, [])]
        return velocity_rows


def _has_stable(row: dict[str, Any]) -> bool:
    return any(c["stable"] for c in row["cycles"])


def _is_same_row(cycle_row: dict[str, Any], other_row: dict[str, Any]) -> bool:
    """Whether two rows are of one cycle of a design, within the errors of both."""
    a, b = ([row["frequency_hz"], *(row[n] for n in LEVELS)] for row in (cycle_row, other_row))
    errors = (max(row["level_error"], row["velocity_error"]) for row in (cycle_row, other_row))
    return are_one_cycle(a, b, sum(errors))


def _family(row: dict[str, Any], origin: dict[str, Any], continued: Continued) -> int:
    """Mode of a design to whose verdict a cycle from another design is added.

    It is nearest in frequency to the mode of the cycle's family at the other design. If that is
    unstable it is an unstable one, where there is any: two modes that lock in have one frequency.
    """
    of_origin = {v["mode"]: v for v in origin["verdicts"]}.get(continued.origin.mode)
    hz = continued.origin.omega / (2 * np.pi) if of_origin is None else of_origin["frequency_hz"]
    unstable = [v for v in row["verdicts"] if v["unstable"]]
    candidates = unstable if unstable and of_origin and of_origin["unstable"] else row["verdicts"]
    nearest = min(candidates, key=lambda v: abs(v["frequency_hz"] - hz), default=None)
    return continued.origin.mode if nearest is None else int(nearest["mode"])
