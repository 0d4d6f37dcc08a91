"""The full-order check of design points."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from squealstudy.analysis.full_order import full_order_modes, reference_error
from squealstudy.analysis.point import solve_point
from squealstudy.errors import SquealstudyError
from squealstudy.reduction.cmt import BasisSettings, component_modes
from squealstudy.study.cache import load_prepared
from squealstudy.study.files import write_json
from squealstudy.study.process import watch_parent
from squealstudy.study.tasks import PointTask

REFERENCES = "references"


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


def read_references(directory: Path) -> dict[str, dict[str, Any]]:
    """Full-order checks by point id."""
    files = sorted((directory / REFERENCES).glob("*.json"))
    results = [json.loads(path.read_text(encoding="utf-8")) for path in files]
    return {r["point_id"]: r for r in results}
