"""The kind of sensitivity studies, and what a worker does at their design points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import pyarrow as pa
from threadpoolctl import threadpool_limits

from squealstudy.engine.batches import batch_parts, stacks
from squealstudy.engine.cache import is_prepared, load_prepared
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.keys import source_hash
from squealstudy.engine.model_kind import OFTEN_CHANGED, ModelKind
from squealstudy.engine.plan import Plan
from squealstudy.engine.store import POINTS, SENSITIVITIES, Store
from squealstudy.engine.workers import Solved, Workers
from squealstudy.errors import ConvergenceError, ParameterError
from squealstudy.kinds.complex_modes.prepared_point import prepared_of
from squealstudy.kinds.sensitivity.batch import BatchTask, seconds_a_point, solve_batch
from squealstudy.kinds.sensitivity.parameters import asked_parameters, error_at_name, mode_choice
from squealstudy.kinds.sensitivity.points import (
    SensitivityRequest,
    SensitivityTask,
    point_seconds,
    solve_points,
)
from squealstudy.kinds.sensitivity.section import SensitivityDefinition
from squealstudy.kinds.sensitivity.tables import SCHEMA, build_tables
from squealstudy.mechanics.failures import FAILURES
from squealstudy.mechanics.sensitivity_parameters import (
    RequestedParameter,
    design_structure,
    state_parameters,
    structural_names,
)
from squealstudy.modes.sensitivity.structural import check_structural
from squealstudy.reduction.cmt import ReducedModel
from squealstudy.study.design import DesignPoint
from squealstudy.system.linearise import component_frequencies

if TYPE_CHECKING:
    import pandas as pd

SOURCES = ("kinds/sensitivity",)  # code on which rows depend, beside that of the library


class Sensitivities(ModelKind):
    """Derivatives of complex modes by parameters, each with the effect of a finite change.

    The finite change checks the derivative: nothing is solved again at full order.
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
        """Requested modes and parameters; StudyFileError for an unknown name."""
        parameters = asked_parameters(plan.study, plan.first)
        section = plan.study.section.model_dump(mode="json", exclude={"parameters"})
        tolerance = plan.study.definition.modes.stability_tolerance
        return [
            section,
            [parameter.name for parameter in parameters],
            tolerance,
            source_hash(SOURCES),
        ]

    def check(self, plan: Plan) -> None:
        """Check that the bases hold the modes of all parameters, and these have derivatives."""
        parameters = request(plan).asked
        try:
            for model, point in _prepared(plan):
                plan.check_assembly_modes(model.n)
                _check_state(point, model, parameters)
            names = structural_names(parameters)
            if names:
                check_structural(design_structure(plan.tasks[0], plan.settings), names)
        except ParameterError as error:
            raise error_at_name(plan.study, error) from None

    def reads_meshes(self, plan: Plan) -> bool:
        """Whether meshes are needed: for derivatives by structural parameters."""
        return bool(structural_names(request(plan).asked))

    def stacks(self, plan: Plan) -> bool:
        """Whether points are solved in batches: small models, by this class's `solve`."""
        return type(self).solve is Sensitivities.solve and stacks(plan)

    def tasks(
        self, plan: Plan, points: DesignPoints, workers: Workers
    ) -> Iterator[SensitivityTask | BatchTask]:
        """Tasks of consecutive design points; batches of a small model."""
        sensitivity_request = request(plan)
        if plan.stacked:
            return (
                BatchTask(part, sensitivity_request) for part in batch_parts(points, workers.jobs)
            )
        return (
            SensitivityTask(sensitivity_request, part)
            for part in workers.pace.parts(points, workers.jobs)
        )

    def solve(self, task: SensitivityTask | BatchTask) -> Solved:
        """Solve the points of a task in a worker."""
        if isinstance(task, BatchTask):
            return solve_batch(task)
        return solve_points(task)

    def build_tables(
        self, plan: Plan, store: Store, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write the tables of points and sensitivities; the points' table, and facts."""
        section = plan.study.section
        return build_tables(plan, store), {"sensitivity": section.model_dump(mode="json")}

    def time_point(self, plan: Plan, task: DesignPoint) -> float | None:
        """Seconds of a design point, estimated from a few parameters (in a batch if small).

        None where it fails.
        """
        if plan.stacked:
            return seconds_a_point(plan, request(plan))
        with threadpool_limits(1):
            try:
                return point_seconds(task, request(plan))
            except FAILURES:
                return None


def _prepared(plan: Plan) -> Iterator[tuple[ReducedModel, DesignPoint]]:
    """Reduced models in the cache, each with its first design point; for a batch the first one."""
    if plan.stacked:
        with suppress(ConvergenceError):  # no steady sliding: its row says so
            yield prepared_of(plan.first).model, plan.first
        return
    for key, point in plan.structures.items():
        if is_prepared(key):
            yield load_prepared(key).model, point


def _check_state(
    point: DesignPoint, model: ReducedModel, requested: Sequence[RequestedParameter]
) -> None:
    """Raise ParameterError where a basis lacks a parameter's modes, or their values differ."""
    for parameter in state_parameters(requested, component_frequencies(model)):
        parameter.value(point.state())
        if not parameter.component and max(parameter.modes, default=1) > model.n:
            raise ParameterError(parameter.name, f"the assembly has modes 1 to {model.n} here")


def request(plan: Plan) -> SensitivityRequest:
    """The study's request for every design point."""
    definition = plan.study.definition
    return SensitivityRequest(
        asked_parameters(plan.study, plan.first),
        mode_choice(plan.study.section, definition.modes.stability_tolerance),
        plan.study.section.change,
        plan.band_hz,
        plan.settings,
    )


KIND = Sensitivities()
