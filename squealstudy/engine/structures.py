"""Building prepared models for a plan, in the cache."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import is_prepared, load_any, load_prepared, save_prepared
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.errors import SquealstudyError, StudyFileError
from squealstudy.linalg.factor import solve_threads
from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.models.operating import ModeKey, OperatingPoint
from squealstudy.modes.full_order.finer_model import Reduction, with_finer_model
from squealstudy.modes.point import angular_band
from squealstudy.reduction.cmt import BasisSettings
from squealstudy.reduction.prepared import PreparedModel, prepare_with_basis
from squealstudy.reduction.prepared_family import PreparedFamily, prepare_family
from squealstudy.study.design import DesignPoint
from squealstudy.study.family import read_family
from squealstudy.study.source import SourceText

SMALL = 100  # degrees of freedom of a family of matrices whose points take milliseconds
PATIENCE = 3.0  # s: two workers take 2 s to start


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
    settings: BasisSettings
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
    with threadpool_limits(1), solve_threads(task.threads):
        started = time.perf_counter()
        assembly = task.point.assembly()
        assembly_s = time.perf_counter() - started
        known = load_prepared(task.coarse_key).space if is_prepared(task.coarse_key) else None
        prepared, modes, basis = prepare_with_basis(
            assembly, task.nominal, task.settings, task.training, known
        )
        timings = {"assembly_s": assembly_s, **prepared.timings}
        started = time.perf_counter()
        if task.top_hz is not None:
            points = (task.nominal, *task.training)
            cutoff = task.settings.damped_to
            made = Reduction(assembly, modes, points, task.top_hz, cutoff, task.scales)
            prepared, _ = with_finer_model(prepared, basis, made, task.enriching)
        timings["finer_model_s"] = time.perf_counter() - started
    return replace(prepared, timings=timings)


def patience(plan: Plan) -> float:
    """Seconds for which work on a model of few degrees of freedom is done without workers."""
    if has_mesh(plan.study):
        return 0.0
    key = plan.tasks[0].structure
    if isinstance(plan.study.model, FamilyDefinition):
        return PATIENCE if is_prepared(key) and load_any(key).model.n <= SMALL else 0.0
    return PATIENCE


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
