"""Base of kinds of study that solve design points of a model: structures first, then the points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.engine.cache import is_prepared, load_any
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.kind import Kind, Warn
from squealstudy.engine.manifest import model_facts
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.engine.reduced import shared_facts
from squealstudy.engine.structures import build_structures, check_component_modes, check_shapes
from squealstudy.engine.workers import Workers
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.study.definition import ResolvedStudy, resolve_study
from squealstudy.study.design import DesignPoint
from squealstudy.study.kind_protocols import StudyKind
from squealstudy.study.sampling import count_points
from squealstudy.study.sections import StudyDefinition
from squealstudy.study.source import SourceText

# largest number of degrees of freedom of a family of matrices whose points take milliseconds
MILLISECOND_MAX_DOF = 100
WORKER_START_WORTH_S = 3.0  # work [s] that is not worth starting workers: two take 2 s to start
Columns = dict[str, float | np.ndarray]  # values of parameters at all design points


@dataclass(frozen=True)
class Solves:
    """Forecast cost of a study. The unit is one design point solved alone by the exact method.

    Attributes
    ----------
    point : float
        Cost of one design point of the study.
    shared : float
        Cost of what is computed once for all design points.
    checks : float
        Cost of all checks, which the workers share.
    between : float
        Largest cost of further points between the design points, which are solved last. `longest`
        may include it.
    least, longest : float
        Factors on the forecast time of the design points for the shortest and longest time.
    not_in_it : str
        Work that comes on top and cannot be forecast, in words.
    """

    point: float = 1.0
    shared: float = 0.0
    checks: float = 0.0
    between: float = 0.0
    least: float = 0.8
    longest: float = 1.6
    not_in_it: str = ""


# keys by section that new study files show
OFTEN_CHANGED = {
    "parameters": ("friction", "pressure", "sliding_speed", "damping_ratio", "normal_force"),
    "modes": ("band",),
}


class ModelKind(Kind):
    """A kind whose design points are those of a model.

    Attributes
    ----------
    definition : type of StudyDefinition
        Schema of the study file, which includes the kind's own section if it has one.
    file_defaults : mapping
        Defaults by section and key that differ from those of a study of complex modes.
    begins_with : mapping of str -> float
        Values of parameters in a new study file, for parameters that the model has with default 0.
    start : mapping of str -> mapping, or list of mappings
        Further sections of a new study file; values that the model proposes replace these.
    short : mapping of str -> sequence of str
        Keys by section that matter most: a new study file shows them at their defaults.
    tells_reduction : bool
        Whether its tables have the error of the reduction, estimated by a finer model.
    chooses_rung : bool
        Whether its design points are solved by a rung of reanalysis, `[modes] method`.
    has_fidelity : bool
        Whether `[fidelity]` can choose its settings.
    points_are_modes : bool
        Whether a design point is one solve of complex modes, whose time follows from the model's
        size.
    needs_contact : bool
        Whether a family of matrices, which has no contact, cannot be studied.
    """

    definition: type[StudyDefinition] = StudyDefinition
    file_defaults: Mapping[str, Mapping[str, Any]] = {}
    begins_with: Mapping[str, float] = {}
    start: Mapping[str, Any] = {}
    short: Mapping[str, Sequence[str]] = OFTEN_CHANGED
    tells_reduction: bool = True
    chooses_rung: bool = False
    has_fidelity: bool = False
    points_are_modes: bool = False
    needs_contact: bool = True

    # -- the study file --------------------------------------------------------------------------
    def read(self, source: SourceText, tables: Mapping[str, Any]) -> ResolvedStudy:
        """Read the study of a file's tables, checked against its model and resolved."""
        return resolve_study(source, tables)

    def plan(self, study: ResolvedStudy) -> Plan:
        """The plan of a study's design points."""
        return Plan(study)

    def owner(self, study: ResolvedStudy) -> tuple[str, str, str]:
        """Name, kind and model, by which the study's results directory is recognised."""
        return study.name, self.name, study.model.name

    def n_points(self, study: ResolvedStudy) -> int:
        """Number of design points that a study begins with, without making them."""
        return count_points(study)

    def check_count(self, study: ResolvedStudy, yes: bool) -> None:
        """Raise as `check_limit` does, by the number of points that a study begins with."""
        _check_limit(study, self.n_points(study), yes)

    def check_limit(self, plan: Plan, yes: bool) -> None:
        """Raise StudyFileError (key ``design.limit``) above the limit of points, unless `yes`."""
        _check_limit(plan.study, len(plan.swept), yes)

    def resolver(self, study: ResolvedStudy) -> Callable[[Columns], Columns]:
        """Function that completes values of design points by those that follow from the study.

        It takes values by the names of parameters, numbers or arrays over design points, and
        returns them completed.
        """
        return lambda values: values

    def identity(self, plan: Plan) -> list[Any]:
        """What a row depends on beside structure and values, for the hash that identifies it."""
        return []

    def table_identity(self, plan: Plan) -> list[Any]:
        """What the tables depend on beside the rows, for the hash that identifies them."""
        return []

    # -- a run -----------------------------------------------------------------------------------
    def seconds_without_workers(self, plan: Plan) -> float:
        """Seconds that this process works alone before it starts workers; 0 for large models."""
        key, family = plan.tasks[0].structure, isinstance(plan.study.model, FamilyDefinition)
        if has_mesh(plan.study) or (family and not is_prepared(key)):
            return 0.0
        return (
            WORKER_START_WORTH_S
            if not family or load_any(key).model.n <= MILLISECOND_MAX_DOF
            else 0.0
        )

    def make_models(self, plan: Plan, workers: Workers, warn: Warn) -> tuple[Plan, dict[str, str]]:
        """Make the reductions, and better ones where the basis is not accurate enough.

        Returns the plan, perhaps one with a better basis, and reasons of failure by key.
        """
        if text := check_shapes(plan):
            warn(text)
        check_component_modes(plan)
        failures = self.make_missing_models(plan, workers)
        if (shared := shared_facts(plan)) and not shared["shared_basis"]["used"]:
            facts = shared["shared_basis"]
            warn(
                f"no basis of {facts['reductions']} reductions serves {facts['range']}: each value "
                "has a reduction of its own"
            )
        self.check(plan)
        if (better := self.accurate(plan, failures, workers)) is not plan:
            plan = better
            failures |= self.make_missing_models(plan, workers)
        return plan, failures

    def check(self, plan: Plan) -> None:
        """Raise StudyFileError for faults that only the prepared models show."""

    def accurate(self, plan: Plan, failures: Mapping[str, str], workers: Workers) -> Plan:
        """The plan with reduced models that are accurate enough; by default the same plan."""
        return plan

    def begin(self, plan: Plan) -> None:
        """Start, in other processes, work that can be done while structures are made."""

    def stacks(self, plan: Plan) -> bool:
        """Whether a plan's points are solved as a batch of small models, without structures."""
        return False

    def make_missing_models(self, plan: Plan, workers: Workers) -> dict[str, str]:
        """Make structures that the cache lacks (none for a batch); reasons of failure by key."""
        return {} if plan.stacked else build_structures(plan, workers)

    def unsolvable(
        self, plan: Plan, points: DesignPoints, failures: Mapping[str, str]
    ) -> dict[str, str]:
        """Design points whose structure could not be made, and why, by id."""
        return {
            name: failures[key]
            for key, rows in (points.of_structures() if failures else ())
            if key in failures
            for name in points.ids[rows].astype(str).tolist()
        }

    def time_point(self, plan: Plan, task: DesignPoint) -> float | None:
        """Seconds of one design point on one core; None where it cannot be solved."""
        raise NotImplementedError

    def settings(self, plan: Plan) -> list[tuple[str, str]]:
        """Names and values of settings by which design points will be solved, for `check`."""
        return []

    def solves(self, plan: Plan) -> Solves:
        """Cost of the study relative to the design points that are timed."""
        return Solves()

    def may_end_early(self, plan: Plan) -> bool:
        """Whether later design points may take far less time than the first ones."""
        return False

    def reads_meshes(self, plan: Plan) -> bool:
        """Whether its tasks assemble the unreduced model, and so read the user's mesh files."""
        return False

    def usable_workers(self, plan: Plan, workers: Workers) -> Workers:
        """The workers, but only those of this machine where tasks read its files."""
        has_files = isinstance(plan.study.model, FileDefinition)
        return workers.at_home if has_files and self.reads_meshes(plan) else workers

    # -- the manifest ----------------------------------------------------------------------------
    def manifest(self, plan: Plan) -> dict[str, Any]:
        """Facts for the manifest: model, parameters, design and structures."""
        return model_facts(plan) | shared_facts(plan)

    def timings(self, plan: Plan, failures: Mapping[str, str]) -> dict[str, float]:
        """Mean over structures of the seconds that each stage took when a structure was made."""
        if plan.stacked:
            return {}
        made_keys = [key for key in plan.structures if key not in failures]
        of_structures = [load_any(key).timings for key in made_keys]
        return {
            f"structure_{name}": float(np.mean([t[name] for t in of_structures if name in t]))
            for name in {name: None for timings in of_structures for name in timings}
        }


def as_model_kind(kind: StudyKind) -> ModelKind:
    """The kind as a ModelKind; TypeError where it is not one."""
    if not isinstance(kind, ModelKind):
        raise TypeError(f"the kind of study '{kind.name}' does not derive from ModelKind")
    return kind


def _check_limit(study: ResolvedStudy, count: int, yes: bool) -> None:
    """Raise StudyFileError for more design points than the limit, unless `yes`."""
    limit = study.definition.design.limit
    if count > limit and not yes:
        raise study.error(
            ("design", "limit"),
            f"the study has {count:,} design points, more than the limit of {limit:,}: "
            "give --yes to run it all the same, raise the limit or sweep fewer values",
        )
