"""Building prepared models for a plan, in the cache, and the full-order check of design points."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from squealstudy.analysis.full_order import full_order_modes, reference_error
from squealstudy.analysis.point import solve_point
from squealstudy.errors import SquealstudyError
from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.cmt import BasisSettings, component_modes
from squealstudy.reduction.prepared import prepare
from squealstudy.study.cache import is_prepared, load_prepared, save_prepared
from squealstudy.study.files import write_json
from squealstudy.study.plan import Plan, Structure
from squealstudy.study.worker import PointTask, watch_parent

REFERENCES = "references"


@dataclass(frozen=True)
class BuildTask:
    """A structure to assemble, reduce and store."""

    structure: Structure
    options: Mapping[str, str | int]
    nominal: OperatingPoint
    training: tuple[OperatingPoint, ...]
    settings: BasisSettings
    threads: int
    parent: int


def build_structure(task: BuildTask) -> tuple[str, str]:
    """Assemble, reduce and cache one structure; (key, "") or (key, reason of failure)."""
    watch_parent(task.parent)
    key, design = task.structure.key, task.structure.design
    if is_prepared(key):
        return key, ""
    try:
        with threadpool_limits(task.threads):
            started = time.perf_counter()
            assembly = design.model.build(task.options, design.plain_values())
            assembly_s = time.perf_counter() - started
            prepared = prepare(assembly, task.nominal, task.settings, task.training)
        timings = {"assembly_s": assembly_s, **prepared.timings}
        save_prepared(key, replace(prepared, timings=timings))
    except SquealstudyError as error:
        return key, str(error)
    return key, ""


def mode_counts(plan: Plan) -> dict[str, int]:
    """Free-free modes, up to the basis' cutoff, of the components whose modes are in use.

    Assembles the first structure, but makes no reduction: a few seconds.
    """
    design = plan.structures[0].design
    wanted = {p.component for p in design.mode_parameters()}
    assembly = design.model.build(plan.study.options, design.plain_values())
    cutoff = plan.settings.component_cutoff
    return {
        c.name: len(real_modes(c.M, c.K, cutoff)[0])
        for c in assembly.components
        if c.name in wanted
    }


@dataclass(frozen=True)
class ReferenceTask:
    """A design point to solve by the full-order model as well."""

    directory: Path
    point: PointTask
    options: Mapping[str, str | int]
    settings: BasisSettings
    band_hz: tuple[float, float]
    parent: int


def check_reference(task: ReferenceTask) -> dict[str, Any]:
    """Solve one point at full order, write its errors to the results, and return them."""
    watch_parent(task.parent)
    started = time.perf_counter()
    design, state = task.point.design, task.point.design.state()
    result: dict[str, Any] = {"point_id": task.point.point_id}
    try:
        with threadpool_limits(1):
            reduced = solve_point(load_prepared(task.point.prepared_key), state, task.band_hz)
            assembly = design.model.build(task.options, design.plain_values())
            modes = component_modes(assembly, task.settings.component_cutoff)
            full = full_order_modes(
                assembly,
                modes,
                reduced.working_point,
                state,
                task.band_hz,
                task.settings.assembly_cutoff,
            )
        error = reference_error(reduced.lam, full.lam)
        result |= {
            "status": "ok",
            "frequency_error": error.frequency,
            "damping_error": error.damping,
            "missed_modes": error.missed,
            "full_order_modes": len(full.lam),
            "full_order_residual": float(full.residual.max(initial=0.0)),
        }
    except SquealstudyError as error:
        result |= {"status": "failed", "message": str(error)}
    result["wall_s"] = time.perf_counter() - started
    write_json(task.directory / REFERENCES / f"{task.point.point_id}.json", result)
    return result
