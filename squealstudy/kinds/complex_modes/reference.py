"""The full-order check of design points."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.engine.cache import load_any
from squealstudy.engine.files import write_json
from squealstudy.errors import SquealstudyError
from squealstudy.kinds.complex_modes.unreduced import Unreduced
from squealstudy.modes.full_order.pairs import paired_with_full_order
from squealstudy.reduction.cmt import BasisSettings
from squealstudy.study.design import DesignPoint

REFERENCES = "references"
UNTOLD = 1e-11  # relative error of a check that does not say its own


@dataclass(frozen=True, eq=False)
class ReferenceTask:
    """A design point, solved with roots `lam` (m,), to solve by the full-order model as well."""

    point: DesignPoint
    lam: np.ndarray
    options: Mapping[str, str | int]
    settings: BasisSettings
    band_hz: tuple[float, float]


def check_reference(task: ReferenceTask) -> dict[str, Any]:
    """Solve one point at full order: its errors, or why there are none."""
    started = time.perf_counter()
    result: dict[str, Any] = {"point_id": task.point.point_id}
    try:
        key, design = task.point.structure, task.point
        unreduced = Unreduced(key, task.options, task.settings)
        full = unreduced.solve(load_any(key), design, task.band_hz, check=True)
        pairs = paired_with_full_order(task.lam, full.lam, full.error_rung)
        result |= {
            "status": "ok",
            "frequency_error": pairs.frequency_error,
            "damping_error": pairs.damping_error,
            "missed_modes": pairs.missed,
            "full_order_modes": len(full.lam),
            "full_order_residual": float(full.residual.max(initial=0.0)),
            "roots": [[float(x.real), float(x.imag)] for x in full.lam],
            "root_errors": full.error_rung.tolist(),
        }
    except SquealstudyError as error:
        result |= {"status": "failed", "message": str(error)}
    result["wall_s"] = time.perf_counter() - started
    return result


def write_reference(directory: Path, found: dict[str, Any]) -> None:
    """Keep a full-order check in the results."""
    write_json(directory / REFERENCES / f"{found['point_id']}.json", found)


def read_references(directory: Path) -> dict[str, dict[str, Any]]:
    """Full-order checks by point id."""
    files = sorted((directory / REFERENCES).glob("*.json"))
    results = [json.loads(path.read_text(encoding="utf-8")) for path in files]
    return {r["point_id"]: r for r in results}


def reference_roots(reference: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Roots (n,) of a full-order check and their errors, rad/s."""
    full = np.array(reference["roots"], dtype=float).reshape(-1, 2) @ np.array([1.0, 1.0j])
    return full, np.array(reference.get("root_errors", UNTOLD * np.abs(full)), dtype=float)
