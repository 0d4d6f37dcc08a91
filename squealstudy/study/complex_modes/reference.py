"""The full-order check of design points."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.analysis.full_order.family_point import check_family_point
from squealstudy.analysis.full_order.modes import FullOrderModes, full_order_modes, reference_error
from squealstudy.analysis.full_order.solution import expected_roots
from squealstudy.analysis.point import state_working_point
from squealstudy.errors import SquealstudyError
from squealstudy.reduction.cmt import BasisSettings
from squealstudy.reduction.prepared_family import PreparedFamily
from squealstudy.study.complex_modes.unreduced import Unreduced
from squealstudy.study.family_cache import Prepared, load_any
from squealstudy.study.files import write_json
from squealstudy.study.tasks import PointTask

REFERENCES = "references"


@dataclass(frozen=True, eq=False)
class ReferenceTask:
    """A design point, solved with roots `lam` (m,), to solve by the full-order model as well."""

    point: PointTask
    lam: np.ndarray
    options: Mapping[str, str | int]
    settings: BasisSettings
    band_hz: tuple[float, float]


def check_reference(task: ReferenceTask) -> dict[str, Any]:
    """Solve one point at full order: its errors, or why there are none."""
    started = time.perf_counter()
    result: dict[str, Any] = {"point_id": task.point.point_id}
    try:
        full = _full_order(task, load_any(task.point.prepared_key))
        error = reference_error(task.lam, full.lam)
        result |= {
            "status": "ok",
            "frequency_error": error.frequency,
            "damping_error": error.damping,
            "missed_modes": error.missed,
            "full_order_modes": len(full.lam),
            "full_order_residual": float(full.residual.max(initial=0.0)),
            "roots": [[float(x.real), float(x.imag)] for x in full.lam],
            "root_errors": full.error.tolist(),
        }
    except SquealstudyError as error:
        result |= {"status": "failed", "message": str(error)}
    result["wall_s"] = time.perf_counter() - started
    return result


def write_reference(directory: Path, found: dict[str, Any]) -> None:
    """Keep a full-order check in the results."""
    write_json(directory / REFERENCES / f"{found['point_id']}.json", found)


def _full_order(task: ReferenceTask, prepared: Prepared) -> FullOrderModes:
    """The unreduced model; of a family, which is never reduced, about another shift."""
    design = task.point.design
    if isinstance(prepared, PreparedFamily):
        return check_family_point(prepared, design.plain_values(), task.band_hz)
    state = design.state()
    point = state_working_point(prepared, state)
    unreduced = Unreduced(task.point.prepared_key, task.options, task.settings)
    assembly, modes = unreduced.assembly(design)
    cutoff = task.settings.damped_to
    expected = expected_roots(prepared.model, point, task.band_hz[1])
    return full_order_modes(assembly, modes, point, state, task.band_hz, cutoff, expected)


def read_references(directory: Path) -> dict[str, dict[str, Any]]:
    """Full-order checks by point id."""
    files = sorted((directory / REFERENCES).glob("*.json"))
    results = [json.loads(path.read_text(encoding="utf-8")) for path in files]
    return {r["point_id"]: r for r in results}
