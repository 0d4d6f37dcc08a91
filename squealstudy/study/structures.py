"""Building prepared models for a plan, in the cache."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

from threadpoolctl import threadpool_limits

from squealstudy.errors import SquealstudyError
from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.cmt import BasisSettings
from squealstudy.reduction.prepared import prepare
from squealstudy.study.cache import is_prepared, save_prepared
from squealstudy.study.plan import Plan, Structure
from squealstudy.study.process import watch_parent


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
