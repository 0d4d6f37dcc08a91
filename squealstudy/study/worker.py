"""What a worker process does: solve a chunk of design points and write its file."""

from __future__ import annotations

import os
import resource
import threading
import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from squealstudy.analysis.point import solve_point
from squealstudy.errors import SquealstudyError
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.study import chunks
from squealstudy.study.cache import load_gaps, load_prepared, save_gaps
from squealstudy.study.design import Design
from squealstudy.study.keys import chunk_id, content_hash

WATCH_S = 0.5
_watched: set[int] = set()


@dataclass(frozen=True)
class PointTask:
    """One design point: identity, design, and the cache key of its structure."""

    point_id: str
    design: Design
    prepared_key: str


@dataclass(frozen=True)
class ChunkTask:
    """Design points that one worker solves and writes together."""

    directory: Path
    band_hz: tuple[float, float]
    points: tuple[PointTask, ...]
    keep_gaps: bool
    parent: int


@dataclass(frozen=True)
class ChunkReport:
    """What comes back from a worker: counts and times only."""

    n_points: int
    n_failed: int
    n_known_working_points: int
    wall_s: float
    peak_mb: float


def watch_parent(parent: int) -> None:
    """End this process when `parent` is gone: a killed run leaves no worker behind."""
    if parent in _watched or os.getpid() == parent:
        return
    _watched.add(parent)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(WATCH_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@lru_cache(maxsize=4)
def _prepared(key: str) -> PreparedModel:
    return load_prepared(key)


@lru_cache(maxsize=4)
def _gaps(key: str) -> dict[str, np.ndarray]:
    return load_gaps(key)


def peak_memory_mb() -> float:
    """Largest resident size of this process so far, MB.

    From /proc where there is one: getrusage gives a worker its parent's size at the fork.
    """
    status = Path("/proc/self/status")
    if status.is_file():
        fields = dict(line.split(":", 1) for line in status.read_text().splitlines())
        return float(fields["VmHWM"].split()[0]) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def solve_chunk(task: ChunkTask) -> ChunkReport:
    """Solve the points of a chunk, one BLAS thread, and write the chunk file."""
    watch_parent(task.parent)
    started = time.perf_counter()
    rows: list[dict[str, Any]] = []
    new_gaps: dict[str, dict[str, np.ndarray]] = {}
    known = 0
    with threadpool_limits(1):
        for point in task.points:
            row, gap = _solve(point, task.band_hz)
            rows.append(row)
            key = working_point_key(point.design)
            if key in _gaps(point.prepared_key):
                known += 1
            elif gap is not None and task.keep_gaps:
                new_gaps.setdefault(point.prepared_key, {})[key] = gap
    name = chunk_id(p.point_id for p in task.points)
    chunks.write_chunk(task.directory, name, rows)
    for key, gaps in new_gaps.items():
        save_gaps(key, name, gaps)
        _gaps(key).update(gaps)
    failed = sum(row["status"] != "ok" for row in rows)
    return ChunkReport(len(rows), failed, known, time.perf_counter() - started, peak_memory_mb())


def _solve(
    point: PointTask, band_hz: tuple[float, float]
) -> tuple[dict[str, Any], np.ndarray | None]:
    started = time.perf_counter()
    try:
        known = _gaps(point.prepared_key).get(working_point_key(point.design))
        modes = solve_point(_prepared(point.prepared_key), point.design.state(), band_hz, known)
    except SquealstudyError as error:
        status = getattr(error, "status", "failed")
        wall = time.perf_counter() - started
        return chunks.failed_row(point.point_id, wall, status, str(error)), None
    except (np.linalg.LinAlgError, FloatingPointError, ValueError) as error:
        wall = time.perf_counter() - started
        message = f"{type(error).__name__}: {error}"
        return chunks.failed_row(point.point_id, wall, "failed", message), None
    wall = time.perf_counter() - started
    return chunks.solved_row(point.point_id, wall, modes), modes.working_point.gap


def working_point_key(design: Design) -> str:
    """Hash of what a working point depends on beside its structure."""
    state = design.state()
    op = state.operating
    return content_hash(
        [
            float(op.friction).hex(),
            float(op.pressure).hex(),
            op.law.kind,
            [x.hex() for x in op.law.parameters],
            sorted((c, j, float(s).hex()) for (c, j), s in state.frequency_scale.items() if s != 1),
        ]
    )
