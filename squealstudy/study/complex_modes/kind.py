"""Complex-mode studies as a kind."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
from joblib import delayed
from threadpoolctl import threadpool_limits

from squealstudy.analysis.point import solve_point
from squealstudy.errors import ConvergenceError
from squealstudy.study.cache import load_prepared
from squealstudy.study.complex_modes import rows
from squealstudy.study.complex_modes.reference import (
    REFERENCES,
    ReferenceTask,
    check_reference,
    read_references,
)
from squealstudy.study.complex_modes.tables import build_tables
from squealstudy.study.complex_modes.worker import ChunkTask, solve_chunk
from squealstudy.study.kind import Progress
from squealstudy.study.names import MODES, POINTS
from squealstudy.study.parallel import in_parallel, split_chunks
from squealstudy.study.plan import Plan, reference_choice
from squealstudy.study.tasks import ChunkReport, PointTask

KEEP_GAPS_LIMIT = 5000  # points: beyond it working points are not kept for other studies


class ComplexModes:
    """Working point and complex modes of every design point; full-order checks of some."""

    schema: pa.Schema = rows.SCHEMA
    tables: tuple[str, ...] = (POINTS, MODES)

    def check(self, plan: Plan) -> None:
        """Component modes are checked for every kind; there is no more to check."""

    def warnings(self, plan: Plan) -> list[str]:
        """Complex modes give none."""
        return []

    def prepare(self, plan: Plan, report: Progress) -> None:
        """Structures are all that complex modes need."""

    def tasks(
        self, plan: Plan, directory: Path, points: Sequence[PointTask], jobs: int
    ) -> list[ChunkTask]:
        """Chunks of consecutive points."""
        keep = len(plan.tasks) <= KEEP_GAPS_LIMIT
        return [
            ChunkTask(directory, plan.band_hz, tuple(part), keep, os.getpid())
            for part in split_chunks(points, jobs)
        ]

    def solve(self, task: ChunkTask) -> ChunkReport:
        """Solve one chunk in a worker."""
        return solve_chunk(task)

    def failed_row(self, point_id: str, status: str, message: str) -> dict[str, Any]:
        """Chunk row of a point that could not be solved."""
        return rows.failed_row(point_id, 0.0, status, message)

    def verify(
        self, plan: Plan, directory: Path, jobs: int, failures: Mapping[str, str], report: Progress
    ) -> list[dict[str, Any]]:
        """Solve the chosen points at full order, those not checked before; all their errors."""
        count = plan.study.definition.modes.reference_points
        chosen = [plan.tasks[i] for i in reference_choice(plan, count)]
        present = read_references(directory) if (directory / REFERENCES).is_dir() else {}
        tasks = [
            ReferenceTask(
                directory, t, plan.study.options, plan.settings, plan.band_hz, os.getpid()
            )
            for t in chosen
            if t.point_id not in present and t.prepared_key not in failures
        ]
        if tasks:
            report("full-order check", 0, len(tasks))
        results = in_parallel(jobs, [delayed(check_reference)(t) for t in tasks])
        for done, _ in enumerate(results, start=1):
            report("full-order check", done, len(tasks))
        ids = {t.point_id for t in chosen}
        return [r for i, r in read_references(directory).items() if i in ids]

    def build_tables(self, plan: Plan, directory: Path) -> pd.DataFrame:
        """Write points and modes."""
        return build_tables(plan, directory)[0]

    def time_point(self, plan: Plan, task: PointTask) -> float | None:
        """Seconds of one design point."""
        prepared = load_prepared(task.prepared_key)
        started = time.perf_counter()
        with threadpool_limits(1):
            try:
                solve_point(prepared, task.design.state(), plan.band_hz)
            except ConvergenceError:
                return None
        return time.perf_counter() - started
