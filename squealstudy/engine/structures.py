"""The structures of a plan: checked, assembled, reduced and kept in the cache."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import is_prepared, load_prepared, save_prepared
from squealstudy.engine.plan import Plan
from squealstudy.engine.workers import Workers
from squealstudy.errors import SquealstudyError, StudyFileError
from squealstudy.linalg.factor import solve_threads
from squealstudy.linalg.real_modes import real_modes
from squealstudy.machine import give_back_memory
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.models.operating import ModeKey, OperatingPoint
from squealstudy.modes.full_order.finer_model import ReductionRecord, with_finer_model
from squealstudy.modes.point import angular_band
from squealstudy.reduction.cmt import ComponentBasis, ReductionSettings
from squealstudy.reduction.contact_space import ContactSpace
from squealstudy.reduction.prepared import (
    PreparedFamily,
    PreparedModel,
    prepare_family,
    prepare_with_basis,
)
from squealstudy.study.design import DesignPoint
from squealstudy.study.family import read_family
from squealstudy.study.source import SourceText


def build_structures(
    plan: Plan, workers: Workers, wanted: Collection[str] | None = None
) -> dict[str, str]:
    """Make the prepared models that the cache does not hold; reasons of failure by key.

    `wanted` are the keys of those to be made, of a study that is tried at some points alone.

    Raises
    ------
    SquealstudyError
        Where no structure of the study can be made.
    """
    asked = plan.structures if wanted is None else plan.structures.keys() & wanted
    missing = [p for key, p in plan.structures.items() if key in asked and not is_prepared(key)]
    if not missing:
        return {}
    workers = with_files(plan, workers)
    if workers.jobs > 1:
        plan.kind.begin(plan)
    threads = workers.threads(len(missing))
    tasks = [build_task(plan, point, threads) for point in missing]
    made = workers.each(build_structure, tasks, "reduction")
    failures = {key: reason for key, reason in made if reason}
    if len(failures) == len(plan.structures):
        raise SquealstudyError(f"{plan.study.source.path}: {next(iter(failures.values()))}")
    return failures


def with_files(plan: Plan, workers: Workers) -> Workers:
    """Those of the workers that have the files which a plan's model reads."""
    of_files = isinstance(plan.study.model, FamilyDefinition | FileDefinition)
    return workers.at_home if of_files else workers


def check_component_modes(plan: Plan) -> None:
    """Raise StudyFileError where the study names a component mode that the basis does not hold.

    Costs a few seconds where the reduction is not in the cache, instead of the whole reduction.
    """
    if plan.first.mode_parameters():
        first = plan.tasks[0].structure
        ready = is_prepared(first)
        plan.check_modes(load_prepared(first).model.mode_counts if ready else mode_counts(plan))


def check_shapes(plan: Plan) -> str:
    """What of the geometry vanishes in some structures of a plan, to warn of; nothing is built.

    Raises StudyFileError where it does in all of them.
    """
    model = plan.study.model
    values = [point.plain_values() for point in plan.structures.values()]
    found = [(pair, v) for v in values if (pair := model.vanishing(v))]
    if not found:
        return ""
    (smaller, larger), first = found[0]
    text = f"expected {smaller} ({first[smaller]:g}) below {larger} ({first[larger]:g})"
    if len(found) < len(values):
        return f"{len(found)} of {len(values)} geometries cannot be built; the first: {text}"
    given = {*plan.study.definition.parameters, *(s.name for s in plan.study.sweeps)}
    raise plan.error(larger if larger in given else smaller, f"{text}: a part would vanish")


@dataclass(frozen=True)
class BuildTask:
    """The structure of a design point to assemble, reduce and store.

    `top_hz` is that of the band of a reduction, None where no error of it is asked for.
    `enriching` is how often what a finer model shows joins the basis (`with_finer_model`);
    `coarse_key` that of the same structure with less of it, empty where there is none.
    """

    point: DesignPoint
    nominal: OperatingPoint
    training: tuple[OperatingPoint, ...]
    settings: ReductionSettings
    top_hz: float | None
    scales: tuple[Mapping[ModeKey, float], ...]
    enriching: int
    coarse_key: str
    threads: int


@dataclass(frozen=True)
class FamilyTask:
    """The family of matrices of a design point to read, prepare and store."""

    point: DesignPoint
    source: SourceText
    band_hz: tuple[float, float]
    threads: int


def build_task(plan: Plan, point: DesignPoint, threads: int) -> BuildTask | FamilyTask:
    """What has to be done for the structure of a design point."""
    if isinstance(point.model, FamilyDefinition):
        return FamilyTask(point, plan.study.source, plan.band_hz, threads)
    return BuildTask(
        point=point,
        nominal=plan.nominal,
        training=plan.training,
        settings=plan.settings,
        top_hz=plan.judged_to_hz,
        scales=plan.trained_scales,
        enriching=plan.enriching,
        coarse_key=plan.structure_key(point, False) if plan.enriched else "",
        threads=threads,
    )


def build_structure(task: BuildTask | FamilyTask) -> tuple[str, str]:
    """Make and cache one structure; (key, "") or (key, reason of failure).

    Raises StudyFileError where a file of matrices cannot be used.
    """
    key = task.point.structure
    if is_prepared(key):
        return key, ""
    try:
        if isinstance(task, FamilyTask):
            save_prepared(key, _prepared_family(task))
        else:
            save_prepared(key, _reduced(task))
    except StudyFileError:
        raise
    except SquealstudyError as error:
        return key, str(error)
    finally:
        give_back_memory()  # assembly and factors are no longer in use
    return key, ""


def _prepared_family(task: FamilyTask) -> PreparedFamily:
    """Read the matrices and solve the nominal point."""
    model = task.point.model
    assert isinstance(model, FamilyDefinition)
    started = time.perf_counter()
    family = read_family(model, task.source)
    read_s = time.perf_counter() - started
    try:
        with threadpool_limits(task.threads):
            prepared = prepare_family(family, model.defaults(), angular_band(task.band_hz))
    except SquealstudyError as error:
        raise SquealstudyError(f"at the values of [parameters]: {error}") from error
    return replace(prepared, timings={"read_s": read_s, **prepared.timings})


def _reduced(task: BuildTask) -> PreparedModel:
    """Assemble and reduce."""
    return reduced_with_basis(task)[0]


def reduced_with_basis(
    task: BuildTask, known: ContactSpace | None = None
) -> tuple[PreparedModel, ComponentBasis]:
    """Assemble and reduce.

    `known` is the contact space of the same structure; that of a coarser model of it is looked for.
    """
    with threadpool_limits(1), solve_threads(task.threads):
        started = time.perf_counter()
        assembly = task.point.assembly()
        assembly_s = time.perf_counter() - started
        if known is None and is_prepared(task.coarse_key):
            known = load_prepared(task.coarse_key).space
        prepared, modes, basis = prepare_with_basis(
            assembly, task.nominal, task.settings, task.training, known
        )
        timings = {"assembly_s": assembly_s, **prepared.timings}
        started = time.perf_counter()
        if task.top_hz is not None:
            points = (task.nominal, *task.training)
            cutoff = task.settings.damped_to
            made = ReductionRecord(assembly, modes, points, task.top_hz, cutoff, task.scales)
            prepared, basis = with_finer_model(prepared, basis, made, task.enriching)
        timings["finer_model_s"] = time.perf_counter() - started
    return replace(prepared, timings=timings), basis


def mode_counts(plan: Plan) -> dict[str, int]:
    """Free-free modes, up to the basis' cutoff, of the components whose modes are in use.

    Assembles the first structure, but makes no reduction: a few seconds.
    """
    design = plan.tasks[0]
    wanted = {p.component for p in design.mode_parameters()}
    assembly = design.assembly()
    cutoff = plan.settings.component_cutoff
    return {
        c.name: len(real_modes(c.M, c.K, cutoff)[0])
        for c in assembly.components
        if c.name in wanted
    }
