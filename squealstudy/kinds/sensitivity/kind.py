"""Sensitivity studies as a kind, and what a worker does at their design points."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pyarrow as pa
from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import is_prepared, known_gap, load_prepared, prepared_model
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.keys import source_hash
from squealstudy.engine.model_kind import OFTEN_CHANGED, ModelKind
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import failed_row
from squealstudy.engine.store import POINTS, SENSITIVITIES, Store
from squealstudy.engine.workers import Solved, Workers
from squealstudy.errors import ParameterError
from squealstudy.kinds.sensitivity.parameters import asked_parameters, error_at_name, mode_choice
from squealstudy.kinds.sensitivity.section import SensitivityDefinition
from squealstudy.kinds.sensitivity.tables import SCHEMA, build_tables, solved_row
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.mechanics.sensitivity_parameters import (
    RequestedParameter,
    design_structure,
    state_parameters,
    structural_names,
)
from squealstudy.modes.sensitivity.mode_sensitivities import ModeSensitivities, with_more
from squealstudy.modes.sensitivity.reduced import ModeChoice, point_sensitivities, solve_families
from squealstudy.modes.sensitivity.structural import (
    check_structural,
    structural_sensitivities,
)
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.study.design import DesignPoint
from squealstudy.system.linearise import component_frequencies

if TYPE_CHECKING:
    import pandas as pd


SOURCES = ("kinds/sensitivity",)  # the code that decides them, beside that of all numbers


TIMED = 3  # parameters that stand for all in a forecast


class Sensitivities(ModelKind):
    """Derivatives of complex modes by parameters, each beside a finite change.

    The finite change is the check: nothing is solved again at full order.
    """

    name = "sensitivity"
    description = "sensitivities of complex modes"
    section = "sensitivity"
    definition = SensitivityDefinition
    tables: tuple[str, ...] = (POINTS, SENSITIVITIES)
    schema: pa.Schema = SCHEMA
    start: Mapping[str, Any] = {"sweep": {"num": 3}}
    short: Mapping[str, Sequence[str]] = {**OFTEN_CHANGED, "sensitivity": ("modes", "parameters")}

    def identity(self, plan: Plan) -> list[Any]:
        """What is asked; StudyFileError for a name unknown."""
        asked = asked_parameters(plan.study, plan.first)
        section = plan.study.section.model_dump(mode="json", exclude={"parameters"})
        tolerance = plan.study.definition.modes.stability_tolerance
        return [section, [item.name for item in asked], tolerance, source_hash(SOURCES)]

    def check(self, plan: Plan) -> None:
        """Parameters must be held by every basis, modes of one name equal, geometry left out."""
        asked = request(plan).asked
        try:
            for key, point in plan.structures.items():
                if is_prepared(key):
                    plan.check_assembly_modes(load_prepared(key).model.n)
                    _check_state(point, asked)
            names = structural_names(asked)
            if names:
                check_structural(design_structure(plan.tasks[0], plan.settings), names)
        except ParameterError as error:
            raise error_at_name(plan.study, error) from None

    def reads_meshes(self, plan: Plan) -> bool:
        """Derivatives by what a structure is assembled of."""
        return bool(structural_names(request(plan).asked))

    def tasks(
        self, plan: Plan, points: DesignPoints, workers: Workers
    ) -> Iterator[SensitivityTask]:
        """Tasks of consecutive design points."""
        asked = request(plan)
        return (SensitivityTask(asked, part) for part in workers.pace.parts(points, workers.jobs))

    def solve(self, task: SensitivityTask) -> Solved:
        """Solve one chunk in a worker."""
        known = sum(known_gap(p.structure, p) is not None for p in task.points)
        return Solved([_row(point, task.request) for point in task.points], known=known)

    def build_tables(
        self, plan: Plan, store: Store, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write the tables of points and of sensitivities from the chunk files."""
        section = plan.study.section
        return build_tables(plan, store), {"sensitivity": section.model_dump(mode="json")}

    def time_point(self, plan: Plan, task: DesignPoint) -> float | None:
        """Seconds of one design point, from a few of its parameters."""
        with threadpool_limits(1):
            try:
                return point_seconds(task, request(plan))
            except FAILURES:
                return None


def _check_state(point: DesignPoint, asked: Sequence[RequestedParameter]) -> None:
    """Raise ParameterError for modes that a basis does not hold, or that differ in one name."""
    model = load_prepared(point.structure).model
    for parameter in state_parameters(asked, component_frequencies(model)):
        parameter.value(point.state())
        if not parameter.component and max(parameter.modes, default=1) > model.n:
            raise ParameterError(parameter.name, f"the assembly has modes 1 to {model.n} here")


def request(plan: Plan) -> SensitivityRequest:
    """What the study asks of every design point."""
    definition = plan.study.definition
    return SensitivityRequest(
        asked_parameters(plan.study, plan.first),
        mode_choice(plan.study.section, definition.modes.stability_tolerance),
        plan.study.section.change,
        plan.band_hz,
        plan.settings,
    )


@dataclass(frozen=True)
class SensitivityRequest:
    """What is asked of every design point.

    Attributes
    ----------
    asked : tuple of RequestedParameter
    choice : ModeChoice
    change : float
        Relative finite change.
    band_hz : (low, high)
    settings : ReductionSettings
    """

    asked: tuple[RequestedParameter, ...]
    choice: ModeChoice
    change: float
    band_hz: tuple[float, float]
    settings: ReductionSettings


@dataclass(frozen=True)
class SensitivityTask:
    """Design points that one worker solves and writes together."""

    request: SensitivityRequest
    points: DesignPoints


def _row(point: DesignPoint, request: SensitivityRequest) -> dict[str, Any]:
    started = time.perf_counter()
    try:
        found, modes = design_sensitivities(point, request)
    except FAILURES as error:
        wall_s = time.perf_counter() - started
        return failed_row(SCHEMA, point.point_id, *reason(error), wall_s)
    return solved_row(point.point_id, time.perf_counter() - started, found, modes)


def design_sensitivities(
    point: DesignPoint, request: SensitivityRequest
) -> tuple[WorkingPoint, list[ModeSensitivities]]:
    """Working point and sensitivities of one design point; SquealstudyError."""
    prepared = prepared_model(point.structure)
    gap = known_gap(point.structure, point)
    state = point.state()
    solved = solve_families(prepared, state, request.band_hz, request.choice, gap)
    parameters = state_parameters(request.asked, component_frequencies(prepared.model))
    modes = point_sensitivities(solved, parameters, request.change, request.band_hz[1])
    structure = design_structure(point, request.settings)
    names = structural_names(request.asked)
    more = structural_sensitivities(solved, structure, names, request.change)
    return solved.point, [with_more(m, s) for m, s in zip(modes, more, strict=True)]


def point_seconds(point: DesignPoint, request: SensitivityRequest) -> float:
    """Expected seconds: modes, a few parameters of the state and one of the structure, scaled.

    Raises
    ------
    ConvergenceError
        Where there is no working point.
    """
    prepared = prepared_model(point.structure)
    started = time.perf_counter()
    solved = solve_families(prepared, point.state(), request.band_hz, request.choice)
    total = time.perf_counter() - started
    parameters = state_parameters(request.asked, component_frequencies(prepared.model))
    if parameters:
        started, few = time.perf_counter(), parameters[:TIMED]
        point_sensitivities(solved, few, request.change, request.band_hz[1])
        total += (time.perf_counter() - started) * len(parameters) / len(few)
    names = structural_names(request.asked)
    if names:
        started = time.perf_counter()
        structure = design_structure(point, request.settings)
        structural_sensitivities(solved, structure, names[:1], request.change)
        total += (time.perf_counter() - started) * len(names)
    return total


KIND = Sensitivities()
