"""The kind of limit-cycle studies, and what a worker does at their design points."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from threadpoolctl import threadpool_limits

from squealstudy.cycles.families import families
from squealstudy.cycles.kicked import decided_in_time, kicks
from squealstudy.cycles.verdicts import Followed
from squealstudy.engine.cache import NewGaps, is_prepared, load_prepared
from squealstudy.engine.cycle_states import cycle_file
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.keys import source_hash
from squealstudy.engine.model_kind import OFTEN_CHANGED, Columns, ModelKind, Solves
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import failed_row
from squealstudy.engine.store import (
    BORDERS,
    BRANCHES,
    CURVES,
    CYCLES,
    POINTS,
    VELOCITIES,
    VERDICTS,
    Store,
)
from squealstudy.engine.workers import Solved, Workers
from squealstudy.errors import ParameterError
from squealstudy.kinds.limit_cycles.designs import (
    MAX_COORDINATES,
    CyclesRequest,
    request,
    too_large,
)
from squealstudy.kinds.limit_cycles.observed import not_observed
from squealstudy.kinds.limit_cycles.section import (
    ALL,
    AUTO,
    SCREENED,
    LimitCyclesDefinition,
    LimitCyclesSection,
)
from squealstudy.kinds.limit_cycles.tables import SCHEMA, solved_row
from squealstudy.kinds.transient.plan_facts import slowest_speed
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.mechanics.regularisation import with_speed
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.design import DesignPoint
from squealstudy.study.sampling import design_points, grid_shape
from squealstudy.study.source import SourceText

if TYPE_CHECKING:
    import pandas as pd

# keys that do not change the row of a design point
CONTINUED = (
    "borders_over",
    "follow",
    "neighbours",
    "points",
    "radiating",
)
POINTS_PER_TASK, MIN_TASKS = 8, 6  # most design points of a task; fewer if tasks would be too few
MOST_ORDERED = 5000  # most design points that are ordered: the time grows with the square
# time of a design point over the forecast, at least and at most: families of 66 brakes took .6 to
# 2.1 times the median's CPU time
LEAST_OF_POINTS, MOST_OF_POINTS = 0.6, 2.0
# largest cost, in design points, of the branches of a line and of the borders of a plane
# (a line of cycles_from_onset 5, kicked_squeal 10, verdict_map 8; a plane of verdict_map 20)
BRANCH_POINTS, BORDER_POINTS = 10.0, 25.0
SOURCES = ("kinds/limit_cycles", "kinds/transient", "cycles")  # the code that decides rows


class LimitCycles(ModelKind):
    """Limit cycles of every mode family of a design point, and a verdict: does it squeal?

    Runs in time decide where cycles leave it open; nothing is checked at full order.
    """

    name = "limit_cycles"
    description = "limit cycles, without time stepping"
    section = "limit_cycles"
    definition = LimitCyclesDefinition
    tables: tuple[str, ...] = (
        POINTS,
        VERDICTS,
        CYCLES,
        BRANCHES,
        BORDERS,
        CURVES,
        VELOCITIES,
    )
    schema: pa.Schema = SCHEMA
    tells_reduction = False
    begins_with: Mapping[str, float] = {"damping_ratio": 0.005}  # an undamped mode has no cycle
    start: Mapping[str, Any] = {"sweep": {"num": 4}}
    short: Mapping[str, Sequence[str]] = {
        **OFTEN_CHANGED,
        "limit_cycles": ("families", "reach", "follow"),
    }

    def read(self, source: SourceText, tables: Mapping[str, Any]) -> ResolvedStudy:
        """The study; StudyFileError also for what cannot be followed or observed."""
        study = super().read(source, tables)
        if why := _not_followed(study, study.section.follow):
            raise study.error(("limit_cycles", "follow"), why)
        if why := _not_bordered(study):
            raise study.error(("limit_cycles", "borders_over"), why)
        keys, why = not_observed(study)
        if why:
            raise study.error(("limit_cycles", *keys), why)
        return study

    def resolver(self, study: ResolvedStudy) -> Callable[[Columns], Columns]:
        """Fills in the speed at which friction saturates, as in studies in time."""
        return partial(with_speed, slowest=slowest_speed(study))

    def identity(self, plan: Plan) -> list[Any]:
        """Settings that decide the row of a design point."""
        tolerance = plan.study.definition.modes.stability_tolerance
        section = plan.study.section.model_dump(mode="json", exclude=set(CONTINUED))
        return [section, tolerance, list(plan.band_hz), source_hash(SOURCES)]

    def manifest(self, plan: Plan) -> dict[str, Any]:
        """Settings of the search, and the unit of torques."""
        facts = super().manifest(plan)
        facts["units"] |= {"torque": plan.study.model.torque_unit}
        return facts | {"limit_cycles": plan.study.section.model_dump(mode="json")}

    def warnings(self, plan: Plan) -> list[str]:
        """Models that are too large for a dense balance."""
        sizes = [load_prepared(key).model.n for key in plan.structures if is_prepared(key)]
        return [too_large(n) for n in sorted(set(sizes)) if n > MAX_COORDINATES]

    def tasks(self, plan: Plan, points: DesignPoints, workers: Workers) -> Iterator[CyclesTask]:
        """Tasks of neighbouring design points, whose curves may serve each other."""
        cycles_request, points = request(plan), points.at(by_nearness(points))
        together = min(POINTS_PER_TASK, math.ceil(len(points) / MIN_TASKS))
        parts = workers.pace.parts(points, workers.jobs, max(together, 1))
        return (CyclesTask(cycles_request, part) for part in parts)

    def solve(self, task: CyclesTask) -> Solved:
        """Solve one chunk in a worker."""
        gaps, rows_and_files, near = NewGaps(), list[tuple[dict[str, Any], dict[str, Any]]](), None
        for point in task.points:
            row, row_files, followed = cycles_row(point, task.request, gaps, near)
            near = followed or near
            rows_and_files.append((row, row_files))
        gaps.save()
        files = {
            name: content for _, row_files in rows_and_files for name, content in row_files.items()
        }
        return Solved([row for row, _ in rows_and_files], files)

    def build_tables(
        self, plan: Plan, store: Store, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Continue cycles to other designs; write points, verdicts, cycles, branches and curves."""
        from squealstudy.kinds.limit_cycles.continuing import build_tables  # needs pandas

        return build_tables(plan, store, workers)

    def settings(self, plan: Plan) -> list[tuple[str, str]]:
        """The method in words."""
        section: LimitCyclesSection = plan.study.section
        count = "as many harmonics as needed" if section.harmonics == AUTO else section.harmonics
        text = f"harmonic balance, {count}, levels to {100 * section.tolerance:g} %"
        return [("method", text)]

    def solves(self, plan: Plan) -> Solves:
        """Range of the time of designs, with that of branches and borders if they are followed."""
        section: LimitCyclesSection = plan.study.section
        further = 0.0
        if section.follow is not None:
            n_lines = len(_lines(plan, section.follow))
            further = BRANCH_POINTS * n_lines
        if section.borders_over is not None:
            n_planes = len(_lines(plan, section.follow, section.borders_over))
            further += BORDER_POINTS * n_planes
        longest = MOST_OF_POINTS + further / len(plan.tasks)
        return Solves(least=LEAST_OF_POINTS, longest=longest)

    def time_point(self, plan: Plan, task: DesignPoint) -> float | None:
        """Time of one design point alone, s; None where it cannot be solved."""
        cycles_row(task, request(plan), NewGaps())  # kernels are compiled
        started = time.perf_counter()
        with threadpool_limits(1):
            row, *_ = cycles_row(task, request(plan), NewGaps())
        return None if row["status"] != "ok" else time.perf_counter() - started


@dataclass(frozen=True)
class CyclesTask:
    """Design points that one worker solves and writes together."""

    request: CyclesRequest
    points: DesignPoints


def by_nearness(points: DesignPoints) -> np.ndarray:
    """Order (n,) of design points in which each is followed by the nearest remaining one.

    Distances are those of the parameters that vary, each over its range. Structures come one after
    the other.
    """
    order = np.arange(len(points))
    if not (2 < len(points) <= MOST_ORDERED and points.varied):
        return order
    x = np.column_stack([points.column(name) for name in points.varied])
    width = np.ptp(x, axis=0)
    x = (x - x.min(axis=0)) / np.where(width > 0.0, width, 1.0)
    sequence = list[int]()
    for _, rows in points.of_structures():
        remaining = rows.copy()
        current, remaining = remaining[0], remaining[1:]
        sequence.append(int(current))
        while len(remaining):
            k = int(np.argmin(((x[remaining] - x[current]) ** 2).sum(axis=1).round(12)))
            current, remaining = remaining[k], np.delete(remaining, k)
            sequence.append(int(current))
    return np.array(sequence)


def _lines(plan: Plan, *along: str | None) -> np.ndarray:
    """Values that are constant on each line or plane of design points along these parameters."""
    columns = [k for k, sweep in enumerate(plan.study.sweeps) if sweep.name not in along]
    constant = np.column_stack([plan.swept[:, columns], plan.tasks.structure_index])
    distinct: np.ndarray = np.unique(constant, axis=0)
    return distinct


def _not_followed(study: ResolvedStudy, name: str | None) -> str:
    """Why a parameter cannot be followed; empty where it can be, or none is."""
    if name is None:
        return ""
    swept = {sweep.name: k for k, sweep in enumerate(study.sweeps)}
    if name not in swept:
        names = ", ".join(f"'{n}'" for n in swept) or "none"
        return f"expected a swept parameter ({names}), got '{name}'"
    if study.sweeps[swept[name]].parameter.structural:
        return f"'{name}' changes the structure: cycles are followed within one"
    if grid_shape(study) is None:
        return "cycles are followed along the lines of a grid, which this design is not"
    values = design_points(study)[:, swept[name]]
    return "" if values.min() < values.max() else f"'{name}' has one value alone"


def _not_bordered(study: ResolvedStudy) -> str:
    """Why borders cannot be continued over a parameter; empty where they can be, or none is."""
    follow, over = study.section.follow, study.section.borders_over
    if over is None:
        return ""
    if follow is None:
        return "folds and Hopf points are those of branches: 'follow' names no parameter"
    if follow == over:
        return f"'{over}' is the parameter that is followed: expected another one"
    return _not_followed(study, over)


def cycles_row(
    point: DesignPoint, request: CyclesRequest, gaps: NewGaps, near: Followed | None = None
) -> tuple[dict[str, Any], dict[str, Any], Followed | None]:
    """Row of a design point; the file with the series of its cycles; its families before runs.

    `near` are the families of a design nearby. In a failed row the reason is given, and there are
    no families.
    """
    started, section = time.perf_counter(), request.section
    try:
        steady, contact = request.contact(point, gaps)
        followed_families = families(
            contact,
            request.band,
            None if section.families in (ALL, SCREENED) else section.families,  # type: ignore[arg-type]
            request.tolerance,
            request.search(contact),
            section.screen if section.families == SCREENED else np.inf,
            near if section.share_curves else None,
        )
        followed = followed_families._replace(name=point.point_id)
        reach = request.search(contact).reach
        if section.undecided_in_time:
            followed_families = decided_in_time(contact, followed_families, request.band, reach)
        kicked = kicks(contact, followed_families, reach) if section.kick_along_mode else {}
    except ParameterError as error:
        why = f"{error.key}: {error.message}"
        return failed_row(SCHEMA, point.point_id, "parameter", why), {}, None
    except FAILURES as error:
        wall_s = time.perf_counter() - started
        return failed_row(SCHEMA, point.point_id, *reason(error), wall_s), {}, None
    wall_s = time.perf_counter() - started
    row = solved_row(point.point_id, wall_s, steady, point.law_kind, followed_families, kicked)
    motions = (cycle.motion for _, family in followed_families.families for cycle in family.cycles)
    phi = request.shared_modes(point.structure).phi
    cycle_series = {
        cycle["cycle_id"]: (motion.Q @ phi.T, motion.omega)
        for cycle, motion in zip(row["cycles"], motions, strict=True)
        if not cycle["same_as"]
    }
    return (
        row,
        cycle_file(point.point_id, point.structure, cycle_series) if cycle_series else {},
        followed,
    )


KIND = LimitCycles()
