"""The kind of design studies: its plan grows with the designs that the search asks for."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import NewGaps, is_prepared, load_prepared, prepared_model
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.keys import source_hash
from squealstudy.engine.model_kind import OFTEN_CHANGED, Columns, ModelKind, Solves
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.engine.reduced import shared_key
from squealstudy.engine.store import (
    DESIGNS,
    MARGINS,
    POINTS,
    PROOF,
    SLOPES,
    VARIANTS,
    Store,
)
from squealstudy.engine.structures import check_component_modes
from squealstudy.engine.workers import Solved, Workers
from squealstudy.errors import ParameterError, StudyFileError
from squealstudy.kinds.design.design_search import DesignSearch
from squealstudy.kinds.design.plan import (
    IN_TIME,
    DesignPlan,
    first_plan,
    nominal_operation,
    today_values,
)
from squealstudy.kinds.design.rows import (
    SCHEMA,
    DesignRequest,
    design_row,
    uncoupled_modes,
)
from squealstudy.kinds.design.section import DesignStudyDefinition
from squealstudy.kinds.design.state import SearchCache
from squealstudy.kinds.design.study import DesignStudy, of_variant, read_study
from squealstudy.kinds.design.variants import plans
from squealstudy.kinds.limit_cycles.designs import MAX_COORDINATES, CyclesRequest
from squealstudy.kinds.transient.batch import mode_keys
from squealstudy.kinds.transient.plan_facts import slowest_speed
from squealstudy.mechanics.failures import FAILURES
from squealstudy.mechanics.regularisation import with_speed
from squealstudy.mechanics.sensitivity_parameters import (
    RequestedParameter,
    design_structure,
    state_parameters,
    structural_names,
)
from squealstudy.models.operating import DAMPING
from squealstudy.models.parameter_names import parse_parameter
from squealstudy.modes.sensitivity.structural import check_structural
from squealstudy.motion.warmup import begin_warming, warm_kernels
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.design import DesignPoint
from squealstudy.study.sampling import count_points
from squealstudy.study.source import SourceText
from squealstudy.system.linearise import component_frequencies

if TYPE_CHECKING:
    import pandas as pd

SOURCES = (
    "kinds/design/rows.py",
    "kinds/design/in_time.py",
    "kinds/limit_cycles",
    "kinds/transient",
    "cycles",
)
MAX_MODES_IN_WARNING = 3  # most modes that a warning names


class Design(ModelKind):
    """Squeal over a matrix of operation, its causes, and the least change that silences it."""

    name = "design"
    description = "which modes squeal, why, and the least change that silences them"
    section = "goal"
    definition = DesignStudyDefinition
    tables: tuple[str, ...] = (POINTS, DESIGNS, MARGINS, SLOPES, PROOF, VARIANTS)
    schema: pa.Schema = SCHEMA
    start: Mapping[str, Any] = {
        "sweep": {"num": 3},
        "variable": [{"parameter": "damping_ratio", "bounds": [0.0, 0.05]}],
        "goal": {"margin": {"damping_ratio": 0.001}},
    }
    short: Mapping[str, Sequence[str]] = {
        **OFTEN_CHANGED,
        "goal": ("starts", "cycles", "in_time", "full_order"),
    }

    def read(self, source: SourceText, tables: Mapping[str, Any]) -> DesignStudy:
        """The study with its variables, what scatters, and its variants."""
        return read_study(source, tables)

    def plan(self, study: ResolvedStudy) -> DesignPlan:
        """Plan of today's design; the search adds others once that is solved."""
        assert isinstance(study, DesignStudy)
        return first_plan(study)

    def n_points(self, study: ResolvedStudy) -> int:
        """Number of operating points, at which today's design is solved."""
        assert isinstance(study, DesignStudy)
        return count_points(study.operation)

    def resolver(self, study: ResolvedStudy) -> Callable[[Columns], Columns]:
        """Fills in the regularisation speed of friction, as in studies in time."""
        operation = study.operation if isinstance(study, DesignStudy) else study
        return partial(with_speed, slowest=slowest_speed(operation))

    def identity(self, plan: Plan) -> list[Any]:
        """All that decides which modes have sensitivities, and to which parameters."""
        names = [p.name for p in asked_parameters(_design_plan(plan).design_study)]
        tolerance = plan.study.definition.modes.stability_tolerance
        margin = _design_plan(plan).design_study.goal.margin.damping_ratio
        cycles = _design_plan(plan).design_study.limit_cycles.model_dump(mode="json")
        return [names, margin, tolerance, cycles, source_hash(SOURCES)]

    def table_identity(self, plan: Plan) -> list[Any]:
        """Folders and hashes of the variants' studies: their files count as the study's own."""
        return [[folder, other.study_hash] for folder, other in plans(_design_plan(plan)).items()]

    def side_studies(self, plan: Plan) -> dict[str, Plan]:
        """Plans of the variants by the folders of their results."""
        return dict(plans(_design_plan(plan)))

    def check(self, plan: Plan) -> None:
        """Refuse variables that a basis does not have or that change the mesh, of variants too."""
        study = _design_plan(plan).design_study
        for number, other in enumerate(plans(_design_plan(plan)).values()):
            try:
                check_component_modes(other)
                self.check(other)
            except StudyFileError as error:
                raise of_variant(study, number, error) from error
        parameters = asked_parameters(_design_plan(plan).design_study)
        try:
            for key, point in plan.structures.items():
                if is_prepared(key):
                    model = load_prepared(key).model
                    plan.check_assembly_modes(model.n)
                    for parameter in state_parameters(parameters, component_frequencies(model)):
                        parameter.value(point.state())
            if names := structural_names(parameters):
                structure = design_structure(plan.tasks[0], plan.settings, structural_ranges(study))
                check_structural(structure, names)
        except ParameterError as error:
            raise plan.error(error.key, error.message) from None

    def reads_meshes(self, plan: Plan) -> bool:
        """Sensitivities to materials and springs, and full order, need what is assembled."""
        return has_mesh(plan.study)

    def begin(self, plan: Plan) -> None:
        """Compile the kernels before workers start."""
        if _design_plan(plan).design_study.goal.in_time:
            begin_warming()

    def warnings(self, plan: Plan) -> list[str]:
        """Warning of modes with less damping than the margin without any coupling by friction."""
        margin = _design_plan(plan).design_study.goal.margin.damping_ratio
        first = plan.tasks[0]
        if not is_prepared(first.structure):
            return []
        try:
            hz, zeta = uncoupled_modes(first, plan.band_hz)
        except FAILURES:
            return []
        low = np.flatnonzero(zeta < margin)
        if not len(low):
            return []
        named = ", ".join(
            f"{hz[k]:.5g} Hz ({100 * zeta[k]:.3g} %)" for k in low[:MAX_MODES_IN_WARNING]
        )
        more = (
            f" and {len(low) - MAX_MODES_IN_WARNING} more"
            if len(low) > MAX_MODES_IN_WARNING
            else ""
        )
        return [
            f"the margin, {100 * margin:.3g} % of critical damping, is above what modes of today's "
            f"design have in steady sliding without any coupling by friction: {named}{more}; what "
            "separates modes cannot reach it, only damping can"
        ]

    def extended_plan(self, plan: Plan, store: Store) -> Plan:
        """The plan with the points that the search needs next; unchanged if some are unsolved."""
        design_plan = _design_plan(plan)
        while (search := self.search(design_plan, store)) is not None and search.pending:
            design_plan = DesignPlan(
                design_plan.design_study, [*design_plan.evaluations, *search.pending], design_plan
            )
        return design_plan

    def search(self, plan: DesignPlan, store: Store) -> DesignSearch | None:
        """The search with all rows so far; None while points of the plan are unsolved."""
        ids = plan.tasks.ids.astype(str).tolist()
        row_of = plan.row_of
        if any(name not in row_of for name in ids):
            for table in store.chunks(SCHEMA, read=plan.files_read):
                row_of.update({row["point_id"]: row for row in table.to_pylist()})
        if any(name not in row_of for name in ids):
            return None
        rows = {a: row_of[name] for a, name in zip(plan.evaluations, ids, strict=True)}
        cache = plan.caches.setdefault("search", SearchCache())
        return DesignSearch(
            plan.design_study, rows, has_mesh(plan.study), is_small_enough_for_cycles(plan), cache
        )

    def tasks(self, plan: Plan, points: DesignPoints, workers: Workers) -> Iterator[DesignTask]:
        """Tasks of consecutive design points."""
        design_request = request(plan)
        if any(a.analysis == IN_TIME for a in _design_plan(plan).evaluations):
            warm_kernels()
        analyses = dict(
            zip(
                plan.tasks.ids.tolist(),
                (a.analysis for a in _design_plan(plan).evaluations),
                strict=True,
            )
        )
        for part in workers.pace.parts(points, workers.jobs):
            yield DesignTask(
                design_request, part, tuple(analyses[name] for name in part.ids.tolist())
            )

    def solve(self, task: DesignTask) -> Solved:
        """Solve one chunk in a worker."""
        gaps = NewGaps()
        rows = [
            design_row(point, analysis, task.request, gaps)
            for point, analysis in zip(task.points, task.analyses, strict=True)
        ]
        gaps.save()
        return Solved(rows)

    def single_tasks(self, task: DesignTask) -> Iterator[DesignTask]:
        """Each point with its own analysis."""
        return (
            replace(task, points=task.points.at(np.array([k])), analyses=(analysis,))
            for k, analysis in enumerate(task.analyses)
        )

    def build_tables(
        self, plan: Plan, store: Store, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write the tables of the study; returns that of the points, and facts for the manifest."""
        from squealstudy.kinds.design.tables import build_tables

        design_plan = _design_plan(plan)
        search = self.search(design_plan, store)
        assert search is not None
        return build_tables(design_plan, store, search)

    def settings(self, plan: Plan) -> list[tuple[str, str]]:
        """The goal and the variants, in words."""
        margin = _design_plan(plan).design_study.goal.margin
        text = f"damping of {100 * margin.damping_ratio:g} % at every operating point"
        if margin.probability is not None:
            text += f", with probability {margin.probability:g}"
        names = [alternative.name for alternative in _design_plan(plan).design_study.alternatives]
        variants = [("variants", f"each searched and proven likewise: {', '.join(names)}")]
        return [("goal", text), *(variants if names else [])]

    def solves(self, plan: Plan) -> Solves:
        """Solves of the forecast, which counts today's design only."""
        goal = _design_plan(plan).design_study.goal
        return Solves(
            not_in_it=f"up to {goal.designs:,} designs of the search, and the proof of the one "
            "that is chosen,"
        )

    def time_point(self, plan: Plan, task: DesignPoint) -> float | None:
        """Time of one design point with sensitivities, s; None where it cannot be solved."""
        started = time.perf_counter()
        with threadpool_limits(1):
            row = design_row(
                task, _design_plan(plan).evaluations[0].analysis, request(plan), NewGaps()
            )
        return None if row["status"] != "ok" else time.perf_counter() - started


def _design_plan(plan: Plan) -> DesignPlan:
    assert isinstance(plan, DesignPlan)
    return plan


@dataclass(frozen=True)
class DesignTask:
    """Design points that one worker solves and writes together, and the analysis of each."""

    request: DesignRequest
    points: DesignPoints
    analyses: tuple[str, ...]


def asked_parameters(study: DesignStudy) -> tuple[RequestedParameter, ...]:
    """Variables, scattered parameters, and the uniform damping ratio if the model has it."""
    by_name = {s.name: s.parameter for s in study.sweeps[study.n_operating :]}
    if DAMPING.name in {p.name for p in study.model.parameters}:
        by_name.setdefault(DAMPING.name, parse_parameter(DAMPING.name, study.model))
    return tuple(RequestedParameter(name, p, every=False) for name, p in by_name.items())


def request(plan: Plan) -> DesignRequest:
    """Settings of the analyses, the same for every design point."""
    modes = plan.study.definition.modes
    return DesignRequest(
        parameters=asked_parameters(_design_plan(plan).design_study),
        margin=_design_plan(plan).design_study.goal.margin.damping_ratio,
        tolerance=modes.stability_tolerance,
        band_hz=plan.band_hz,
        settings=plan.settings,
        cycles=CyclesRequest(
            section=_design_plan(plan).design_study.limit_cycles,
            operating=plan.nominal,
            component_modes=mode_keys(plan),
            band_hz=plan.band_hz,
            tolerance=modes.stability_tolerance,
        ),
        structural_ranges=structural_ranges(_design_plan(plan).design_study),
        today=today_values(_design_plan(plan).design_study),
        structures=todays_structures(_design_plan(plan)),
        operation=nominal_operation(_design_plan(plan).design_study),
        basis=shared_key(plan),
    )


def structural_ranges(study: DesignStudy) -> dict[str, float]:
    """Ranges of the structural variables: upper less lower bound, by name."""
    return {v.name: v.range for v in study.variables if v.parameter.structural}


def todays_structures(plan: DesignPlan) -> dict[tuple[float, ...], str]:
    """Keys of today's structures by their values; empty where no variable changes the structure."""
    study = plan.design_study
    if not structural_ranges(study):
        return {}
    variable_columns = slice(study.n_operating, study.n_operating + len(study.variables))
    nominal = tuple(study.nominal)
    points = [
        plan.tasks[k]
        for k, evaluation in enumerate(plan.evaluations)
        if evaluation.of(variable_columns) == nominal
    ]
    return {tuple(p.structural_values().values()): p.structure for p in points}


def is_small_enough_for_cycles(plan: Plan) -> bool:
    """Whether the model is small enough for limit cycles and runs in time."""
    first = plan.tasks[0].structure
    return is_prepared(first) and prepared_model(first).model.n <= MAX_COORDINATES


KIND = Design()
