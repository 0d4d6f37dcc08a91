"""Sensitivity studies as a kind."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import is_prepared, load_prepared
from squealstudy.engine.keys import source_hash
from squealstudy.engine.model_kind import ModelKind
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import FAILURES
from squealstudy.engine.store import POINTS, SENSITIVITIES
from squealstudy.engine.workers import Solved, Workers, split_chunks
from squealstudy.errors import ParameterError
from squealstudy.kinds.sensitivity.parameters import (
    Asked,
    asked_parameters,
    error_at_name,
    mode_choice,
    state_parameters,
    structural_names,
)
from squealstudy.kinds.sensitivity.section import SensitivityDefinition
from squealstudy.kinds.sensitivity.tables import SCHEMA, build_tables
from squealstudy.kinds.sensitivity.worker import (
    Request,
    SensitivityTask,
    design_structure,
    point_seconds,
    solve_sensitivities,
)
from squealstudy.modes.sensitivity.structural import check_structural
from squealstudy.study.design import DesignPoint
from squealstudy.system.linearise import component_frequencies

if TYPE_CHECKING:
    import pandas as pd

SOURCES = ("kinds/sensitivity",)  # the code that decides them, beside that of all numbers


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

    def identity(self, plan: Plan) -> list[Any]:
        """What is asked; StudyFileError for a name unknown."""
        asked = asked_parameters(plan.study, plan.designs[0])
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

    def tasks(
        self, plan: Plan, points: Sequence[DesignPoint], workers: Workers
    ) -> list[SensitivityTask]:
        """Chunks of consecutive points."""
        asked = request(plan)
        return [SensitivityTask(asked, tuple(part)) for part in split_chunks(points, workers.jobs)]

    def solve(self, task: SensitivityTask) -> Solved:
        """Solve one chunk in a worker."""
        return solve_sensitivities(task)

    def build_tables(
        self, plan: Plan, directory: Path, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write points and sensitivities."""
        section = plan.study.section
        return build_tables(plan, directory), {"sensitivity": section.model_dump(mode="json")}

    def time_point(self, plan: Plan, task: DesignPoint) -> float | None:
        """Seconds of one design point, from a few of its parameters."""
        with threadpool_limits(1):
            try:
                return point_seconds(task, request(plan))
            except FAILURES:
                return None


def _check_state(point: DesignPoint, asked: Sequence[Asked]) -> None:
    """Raise ParameterError for modes that a basis does not hold, or that differ in one name."""
    model = load_prepared(point.structure).model
    for parameter in state_parameters(asked, component_frequencies(model)):
        parameter.value(point.state())
        if not parameter.component and max(parameter.modes, default=1) > model.n:
            raise ParameterError(parameter.name, f"the assembly has modes 1 to {model.n} here")


def request(plan: Plan) -> Request:
    """What the study asks of every design point."""
    definition = plan.study.definition
    return Request(
        asked_parameters(plan.study, plan.designs[0]),
        mode_choice(plan.study.section, definition.modes.stability_tolerance),
        plan.study.section.change,
        plan.band_hz,
        plan.settings,
    )


KIND = Sensitivities()
