"""Studies of limit cycles as a kind, and what a worker does at their design points."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from threadpoolctl import threadpool_limits

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.families import Search, families
from squealstudy.engine.cache import NewGaps, is_prepared, load_prepared
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.keys import source_hash
from squealstudy.engine.model_kind import Columns, ModelKind
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import FAILURES, failed_row, reason
from squealstudy.engine.store import BRANCHES, CYCLES, POINTS, VERDICTS, Store
from squealstudy.engine.workers import Solved, Workers
from squealstudy.errors import ConvergenceError, ParameterError
from squealstudy.kinds.limit_cycles.section import (
    ALL,
    AUTO,
    SCREENED,
    LimitCyclesDefinition,
    LimitCyclesSection,
)
from squealstudy.kinds.limit_cycles.tables import SCHEMA, build_tables, solved_row
from squealstudy.kinds.transient.batch import ALL_MODES, mode_keys, shared_reference
from squealstudy.kinds.transient.plan_facts import slowest_speed, with_speed
from squealstudy.kinds.transient.worker import steady_motion
from squealstudy.models.operating import ModeKey, OperatingPoint
from squealstudy.modes.point import angular_band
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.design import DesignPoint

if TYPE_CHECKING:
    import pandas as pd

SOURCES = ("kinds/limit_cycles", "kinds/transient", "cycles")  # the code that decides rows
MOST = 2000  # coordinates: matrices of this size are factorised for every harmonic


class LimitCycles(ModelKind):
    """Limit cycles of every mode family of a design point, and a verdict: does it squeal?

    Nothing is run in time, and nothing is checked at full order.
    """

    name = "limit_cycles"
    description = "limit cycles, without time stepping"
    section = "limit_cycles"
    definition = LimitCyclesDefinition
    tables: tuple[str, ...] = (POINTS, VERDICTS, CYCLES, BRANCHES)
    schema: pa.Schema = SCHEMA
    tells_reduction = False

    def resolver(self, study: ResolvedStudy) -> Callable[[Columns], Columns]:
        """Fills in the speed at which friction saturates, as in studies in time."""
        return partial(with_speed, slowest=slowest_speed(study))

    def identity(self, plan: Plan) -> list[Any]:
        """What is looked for."""
        tolerance = plan.study.definition.modes.stability_tolerance
        section = plan.study.section.model_dump(mode="json")
        return [section, tolerance, list(plan.band_hz), source_hash(SOURCES)]

    def manifest(self, plan: Plan) -> dict[str, Any]:
        """What is looked for; the unit of torques."""
        facts = super().manifest(plan)
        facts["units"] |= {"torque": plan.study.model.torque_unit}
        return facts | {"limit_cycles": plan.study.section.model_dump(mode="json")}

    def warnings(self, plan: Plan) -> list[str]:
        """Models that are too large for a dense balance."""
        sizes = [load_prepared(key).model.n for key in plan.structures if is_prepared(key)]
        return [_too_large(n) for n in sorted(set(sizes)) if n > MOST]

    def tasks(self, plan: Plan, points: DesignPoints, workers: Workers) -> Iterator[CyclesTask]:
        """Tasks of consecutive design points."""
        asked = request(plan)
        return (CyclesTask(asked, part) for part in workers.pace.parts(points, workers.jobs))

    def solve(self, task: CyclesTask) -> Solved:
        """Solve one chunk in a worker."""
        gaps = NewGaps()
        rows = [cycles_row(point, task.request, gaps) for point in task.points]
        gaps.save()
        return Solved(rows)

    def build_tables(
        self, plan: Plan, store: Store, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write points, verdicts, cycles and branches."""
        return build_tables(plan, store), {}

    def settings(self, plan: Plan) -> list[tuple[str, str]]:
        """How cycles are found."""
        section: LimitCyclesSection = plan.study.section
        count = "as many harmonics as needed" if section.harmonics == AUTO else section.harmonics
        text = f"harmonic balance, {count}, levels to {100 * section.tolerance:g} %"
        return [("method", text)]

    def time_point(self, plan: Plan, task: DesignPoint) -> float | None:
        """Seconds of one design point alone."""
        cycles_row(task, request(plan), NewGaps())  # kernels are compiled
        started = time.perf_counter()
        with threadpool_limits(1):
            found = cycles_row(task, request(plan), NewGaps())
        return None if found["status"] != "ok" else time.perf_counter() - started


@dataclass(frozen=True)
class CyclesRequest:
    """What is asked of every design point.

    Attributes
    ----------
    section : LimitCyclesSection
    operating : OperatingPoint
        Of the study's [parameters]: where the shared modes are made.
    component_modes : tuple of (component, mode)
    band_hz : (low, high)
    tolerance : float
        Damping ratio below minus which a mode is unstable.
    """

    section: LimitCyclesSection
    operating: OperatingPoint
    component_modes: tuple[ModeKey, ...]
    band_hz: tuple[float, float]
    tolerance: float


@dataclass(frozen=True)
class CyclesTask:
    """Design points that one worker solves and writes together."""

    request: CyclesRequest
    points: DesignPoints


def request(plan: Plan) -> CyclesRequest:
    """What the study asks of every design point."""
    return CyclesRequest(
        section=plan.study.section,
        operating=plan.nominal,
        component_modes=mode_keys(plan),
        band_hz=plan.band_hz,
        tolerance=plan.study.definition.modes.stability_tolerance,
    )


def _too_large(n: int) -> str:
    return f"the model has {n} coordinates, limit cycles are for {MOST} at most"


def cycles_row(point: DesignPoint, asked: CyclesRequest, gaps: NewGaps) -> dict[str, Any]:
    """Row of a design point: its families followed, or why not."""
    started, section = time.perf_counter(), asked.section
    try:
        reference = shared_reference(
            point.structure, asked.operating, asked.component_modes, ALL_MODES
        )
        if reference.system.n > MOST:
            raise ConvergenceError("too_large", _too_large(reference.system.n))
        steady, made = steady_motion(
            reference, point, section.friction, asked.band_hz, asked.tolerance, gaps
        )
        contact = ContactOscillator(reference.system, made)
        found = families(
            contact,
            angular_band(asked.band_hz),
            None if section.families in (ALL, SCREENED) else section.families,  # type: ignore[arg-type]
            asked.tolerance,
            Search(
                None if section.harmonics == AUTO else int(section.harmonics),
                section.tolerance,
                section.reach * abs(made.speed),
                angular_band(asked.band_hz)[1],
            ),
            section.screen if section.families == SCREENED else np.inf,
        )
    except ParameterError as error:
        return failed_row(SCHEMA, point.point_id, "parameter", f"{error.key}: {error.message}")
    except FAILURES as error:
        wall_s = time.perf_counter() - started
        return failed_row(SCHEMA, point.point_id, *reason(error), wall_s)
    wall_s = time.perf_counter() - started
    return solved_row(point.point_id, wall_s, steady, point.law_kind, found)


KIND = LimitCycles()
