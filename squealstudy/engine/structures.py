"""Makes the structures of a plan: checks, assembles, reduces and caches them."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import is_prepared, load_prepared, save_prepared
from squealstudy.engine.chunk_rows import unforeseen
from squealstudy.engine.plan import Plan
from squealstudy.engine.reduced import (
    BuildTask,
    make_shared,
    reduced_with_basis,
    shared_task,
)
from squealstudy.engine.workers import Workers
from squealstudy.errors import SquealstudyError, StudyFileError
from squealstudy.linalg.real_modes import real_modes
from squealstudy.machine.resources import memory_returned
from squealstudy.mechanics.failures import FAILURES
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.reduction.prepared import (
    PreparedFamily,
    prepare_family,
)
from squealstudy.root_pairs import angular_band
from squealstudy.study.design import DesignPoint
from squealstudy.study.family import read_family
from squealstudy.study.source import SourceText


def build_structures(
    plan: Plan, workers: Workers, wanted_keys: Collection[str] | None = None
) -> dict[str, str]:
    """Make the prepared models that the cache does not hold; reasons of failure by key.

    `wanted_keys` are the keys to make, where only some points of a study are tried; None: all.

    Raises
    ------
    SquealstudyError
        Where no structure of the study can be made.
    """
    keys = plan.structures if wanted_keys is None else plan.structures.keys() & wanted_keys
    missing = [p for key, p in plan.structures.items() if key in keys and not is_prepared(key)]
    if not missing:
        return {}
    workers = with_files(plan, workers)
    if workers.jobs > 1:
        plan.kind.begin(plan)
    threads = workers.threads(len(missing))
    tasks = [build_task(plan, point, threads) for point in missing]
    failures = _make_shared(tasks, workers)
    tasks = [task for task in tasks if task.point.structure not in failures]
    name = "reduction" if plan.study.model.meshed else "model"
    outcomes = workers.each(build_structure, tasks, name)
    failures |= {key: reason for key, reason in outcomes if reason}
    if len(failures) == len(plan.structures):
        raise SquealstudyError(f"{plan.study.source.path}: {next(iter(failures.values()))}")
    return failures


def _make_shared(tasks: Sequence[BuildTask | FamilyTask], workers: Workers) -> dict[str, str]:
    """Make the bases of ranges that structures are in; reasons of failure by structure.

    One task reduces a range place by place. A single range has all threads.
    """
    of_range = {t.shared.key: t for t in tasks if isinstance(t, BuildTask) and t.shared}
    if not of_range:
        return {}
    single_tasks = [replace(t, threads=workers.threads(len(of_range))) for t in of_range.values()]
    outcomes = workers.each(make_shared, single_tasks, "basis over a range")
    lost = {key: reason for key, reason in outcomes if reason}
    return {
        t.point.structure: lost[t.shared.key]
        for t in tasks
        if isinstance(t, BuildTask) and t.shared and t.shared.key in lost
    }


def with_files(plan: Plan, workers: Workers) -> Workers:
    """The workers, but only those of this machine where a plan's model reads files."""
    of_files = isinstance(plan.study.model, FamilyDefinition | FileDefinition)
    return workers.at_home if of_files else workers


def check_component_modes(plan: Plan) -> None:
    """Raise StudyFileError where the study names a component mode that the basis does not hold.

    Where the reduction is not in the cache this takes a few seconds, not those of a reduction.
    """
    if plan.first.mode_parameters():
        first = plan.tasks[0].structure
        ready = is_prepared(first)
        plan.check_modes(load_prepared(first).model.mode_counts if ready else mode_counts(plan))


def check_model_file(plan: Plan) -> list[str]:
    """Doubts about a model file with meshes; none where its first structure is in the cache.

    Raises StudyFileError where the file cannot be used.
    """
    model = plan.study.model
    if not isinstance(model, FileDefinition) or not model.meshed:
        return []
    if is_prepared(plan.tasks[0].structure):
        return []
    from squealstudy.study.components import free_motions  # of meshes: not for minimal models

    return free_motions(model)


def check_shapes(plan: Plan) -> str:
    """Warning about a part of the geometry that vanishes in some structures; empty without.

    Nothing is built. Raises StudyFileError where a part vanishes in all structures.
    """
    model = plan.study.model
    values = [point.plain_values() for point in plan.structures.values()]
    vanishing = [(pair, v) for v in values if (pair := model.vanishing(v))]
    if not vanishing:
        return ""
    (smaller, larger), first = vanishing[0]
    text = f"expected {smaller} ({first[smaller]:g}) below {larger} ({first[larger]:g})"
    if len(vanishing) < len(values):
        return f"{len(vanishing)} of {len(values)} geometries cannot be built; the first: {text}"
    named = {*plan.study.definition.parameters, *(s.name for s in plan.study.sweeps)}
    raise plan.error(larger if larger in named else smaller, f"{text}: a part would vanish")


@dataclass(frozen=True)
class FamilyTask:
    """The family of matrices of a design point to read, prepare and store."""

    point: DesignPoint
    source: SourceText
    band_hz: tuple[float, float]
    threads: int


def build_task(plan: Plan, point: DesignPoint, threads: int) -> BuildTask | FamilyTask:
    """The task that builds the structure of a design point."""
    if isinstance(point.model, FamilyDefinition):
        return FamilyTask(point, plan.study.source, plan.band_hz, threads)
    return BuildTask(
        point=point,
        nominal=plan.nominal,
        training=plan.training,
        settings=plan.settings,
        top_hz=plan.judged_to_hz,
        band_hz=plan.band_hz,
        scales=plan.trained_scales,
        enriching=plan.enriching,
        coarse_key=plan.structure_key(point, False) if plan.enriched else "",
        threads=threads,
        shared=shared_task(plan, point),
    )


def build_structure(task: BuildTask | FamilyTask) -> tuple[str, str]:
    """Make and cache one structure; (key, "") or (key, reason of failure, foreseen or not).

    Raises StudyFileError where a file of matrices cannot be used.
    """
    key = task.point.structure
    if is_prepared(key):
        return key, ""
    with memory_returned():  # assembly and factors are not used again
        try:
            if isinstance(task, FamilyTask):
                save_prepared(key, _prepared_family(task))
            else:
                save_prepared(key, reduced_with_basis(task)[0])
        except StudyFileError:
            raise
        except FAILURES as error:
            return key, unforeseen(error)[1]
    return key, ""


def _prepared_family(task: FamilyTask) -> PreparedFamily:
    """Read the matrices and solve the nominal point; how long both took is in ``timings``."""
    model = task.point.model
    assert isinstance(model, FamilyDefinition)
    started = time.perf_counter()
    family = read_family(model, task.source)
    read_s = time.perf_counter() - started
    try:
        with threadpool_limits(task.threads):
            prepared = prepare_family(family, model.defaults(), angular_band(task.band_hz))
    except SquealstudyError as error:
        values = ", ".join(f"{name} = {default:g}" for name, default in model.defaults().items())
        raise SquealstudyError(f"at the values of [parameters], {values}: {error}") from error
    return replace(prepared, timings={"read_s": read_s, **prepared.timings})


def mode_counts(plan: Plan) -> dict[str, int]:
    """Number of free-free modes up to the basis' cutoff, of components whose modes are in use.

    The first structure is assembled, but not reduced, which takes a few seconds.
    """
    design = plan.tasks[0]
    components = {p.component for p in design.mode_parameters()}
    assembly = design.assembly()
    cutoff = plan.settings.component_cutoff
    return {
        c.name: len(real_modes(c.M, c.K, cutoff)[0])
        for c in assembly.components
        if c.name in components
    }
