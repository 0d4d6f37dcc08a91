"""Complex-mode studies as a kind."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from threadpoolctl import threadpool_limits

from squealstudy.errors import ConvergenceError
from squealstudy.study.cache import is_prepared
from squealstudy.study.complex_modes import rows
from squealstudy.study.complex_modes.counts import read_roots
from squealstudy.study.complex_modes.full_rung import FullRung
from squealstudy.study.complex_modes.solve import solve_design
from squealstudy.study.complex_modes.worker import ChunkTask, solve_chunk
from squealstudy.study.family_cache import load_any
from squealstudy.study.kind import Kind
from squealstudy.study.method import APPROXIMATE, AUTO, FOR_COMPARISON, FULL, OVER_A_BASIS
from squealstudy.study.names import MODES, ONSETS, POINTS
from squealstudy.study.parallel import Progress, Workers, split_chunks
from squealstudy.study.plan import Plan, checked_points
from squealstudy.study.rows import FAILURES
from squealstudy.study.tasks import PointTask, Solved

if TYPE_CHECKING:
    import pandas as pd

    from squealstudy.study.complex_modes.bases import BasisTask
    from squealstudy.study.complex_modes.window_worker import WindowTask

KEEP_GAPS_LIMIT = 5000  # points: beyond it working points are not kept for other studies


class ComplexModes(Kind):
    """Working point and complex modes of every design point; full-order checks of some."""

    schema: pa.Schema = rows.SCHEMA
    tables: tuple[str, ...] = (POINTS, MODES, ONSETS)

    def check(self, plan: Plan) -> None:
        """Modes of the assembly must be held by every basis; component modes are, in any kind."""
        if not plan.designs[0].assembly_parameters() or plan.method.name == FULL:
            return
        for structure in plan.structures:
            if is_prepared(structure.key):
                plan.check_assembly_modes(load_any(structure.key).model.n)

    def warnings(self, plan: Plan) -> list[str]:
        """A method that keeps no tolerance."""
        name = plan.method.name
        if name not in FOR_COMPARISON:
            return []
        return [
            f"{name} is a method to compare others with: it keeps no tolerance, and its points are "
            "'ok' whatever errors the modes table estimates"
        ]

    def accurate(self, plan: Plan, failures: Mapping[str, str], workers: Workers) -> Plan:
        """The plan, with an enriched basis where that of the study errs by more than its tolerance.

        What no rung of reanalysis can lower is lowered once for all points of the study. A basis
        that the study chooses itself, by any key of [reduction], stays as it is.
        """
        if plan.enriched or plan.study.definition.reduction.model_fields_set:
            return plan
        from squealstudy.study.complex_modes.reduction import make_samples

        samples = make_samples(plan, failures, workers)
        worst = max((sample.worst for _, sample in samples), default=0.0)
        return Plan(plan.study, plan.swept, True) if worst > plan.method.largest_error else plan

    def prepare(self, plan: Plan, report: Progress) -> None:
        """The sweep bases of methods that need them."""
        if plan.method.name in OVER_A_BASIS:
            from squealstudy.study.complex_modes.window_tasks import basis_tasks

            with threadpool_limits(1):  # matrices are small: more threads wait for each other
                for task in basis_tasks(plan):
                    if is_prepared(task.key):
                        self._make_basis(plan, task, report)

    @staticmethod
    def _make_basis(plan: Plan, task: BasisTask, report: Progress) -> None:
        chosen = plan.study.definition.modes.method != AUTO
        if task.refusal.is_file() and not chosen:
            return
        from squealstudy.study.complex_modes.bases import make_basis, refuse_basis

        try:
            make_basis(task, lambda done, most: report("sweep basis", done, most))
        except (ConvergenceError, np.linalg.LinAlgError) as error:
            if not chosen:  # all its points are then exact
                refuse_basis(task, str(error))
                return
            raise plan.error_at(
                ("modes", "method"),
                f"no sweep basis for {plan.method.name} can be made over this box ({error}): "
                'method = "dense" (of matrices "full") solves point by point',
            ) from error

    def tasks(
        self, plan: Plan, points: Sequence[PointTask], jobs: int
    ) -> list[ChunkTask | WindowTask]:
        """Chunks of consecutive points, or boxes of neighbouring ones."""
        boxed: list[PointTask] = []
        if plan.method.name in APPROXIMATE:
            without = {task.key for task in self._without_basis(plan)}
            boxed = [point for point in points if point.prepared_key not in without]
            points = [point for point in points if point.prepared_key in without]
        keep = len(plan.tasks) <= KEEP_GAPS_LIMIT
        full = FullRung(plan.study.options, plan.settings) if plan.method.name == FULL else None
        chunks = [
            ChunkTask(plan.band_hz, tuple(part), keep, full) for part in split_chunks(points, jobs)
        ]
        if not boxed:
            return [*chunks]
        from squealstudy.study.complex_modes.window_tasks import window_tasks

        return [*window_tasks(plan, boxed), *chunks]

    @staticmethod
    def _without_basis(plan: Plan) -> list[BasisTask]:
        """Structures over whose design points no basis could be made."""
        if plan.method.name not in OVER_A_BASIS:
            return []
        from squealstudy.study.complex_modes.window_tasks import basis_tasks

        return [task for task in basis_tasks(plan) if not task.path.is_file()]

    def solve(self, task: ChunkTask | WindowTask) -> Solved:
        """Solve one chunk in a worker."""
        if isinstance(task, ChunkTask):
            return solve_chunk(task)
        from squealstudy.study.complex_modes.window_worker import solve_box

        return solve_box(task)

    def failed_row(self, point_id: str, status: str, message: str) -> dict[str, Any]:
        """Chunk row of a point that could not be solved."""
        return rows.failed_row(point_id, 0.0, status, message)

    def verify(
        self, plan: Plan, directory: Path, failures: Mapping[str, str], workers: Workers
    ) -> list[dict[str, Any]]:
        """Solve the chosen points at full order, those not checked before; all their errors."""
        from squealstudy.study.complex_modes.reference import (
            REFERENCES,
            ReferenceTask,
            check_reference,
            read_references,
            write_reference,
        )

        chosen = [plan.tasks[i] for i in checked_points(plan)]
        present = read_references(directory) if (directory / REFERENCES).is_dir() else {}
        wanted = [t for t in chosen if t.point_id not in present]
        found = read_roots(directory, [t.point_id for t in wanted], overdamped=True)
        tasks = [
            ReferenceTask(t, lam, plan.study.options, plan.settings, plan.band_hz)
            for t in wanted
            if t.prepared_key not in failures and (lam := found.get(t.point_id)) is not None
        ]
        for result in workers.each(check_reference, tasks, "full-order check"):
            write_reference(directory, result)
        ids = {t.point_id for t in chosen}
        return [r for i, r in read_references(directory).items() if i in ids]

    def build_tables(
        self, plan: Plan, directory: Path, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write points, modes and onsets."""
        from squealstudy.study.complex_modes.audit import audited
        from squealstudy.study.complex_modes.reduction import make_samples
        from squealstudy.study.complex_modes.reference import read_references
        from squealstudy.study.complex_modes.tables import build_tables

        if plan.study.definition.modes.track:  # which solves points in between
            self.prepare(plan, workers.report)
        built = {s.key: "" for s in plan.structures if not is_prepared(s.key)}
        samples = make_samples(plan, built, workers)
        points, facts = build_tables(plan, directory, workers, samples)
        served = {str(k): int(n) for k, n in points["method"].value_counts().items() if k}
        if plan.study.definition.modes.audit:
            ids = [plan.tasks[i].point_id for i in checked_points(plan)]
            facts["audit"] = audited(directory, ids, read_references(directory))
        reason = plan.method.reason
        for task in self._without_basis(plan):
            if task.refusal.is_file():
                reason += f"; no basis, all points are exact: {task.refusal.read_text()}"
                break
        method = {"chosen": plan.method.name, "reason": reason, "points": served}
        return points, {**facts, "method": {**method, "tolerance": plan.method.tolerance}}

    def time_point(self, plan: Plan, task: PointTask) -> float | None:
        """Seconds of one design point by the exact method."""
        prepared = load_any(task.prepared_key)
        full = plan.method.name == FULL
        rung = FullRung(plan.study.options, plan.settings) if full else None
        started = time.perf_counter()
        with threadpool_limits(1):
            try:
                if rung is not None:
                    rung.solve(task, plan.band_hz)
                else:
                    solve_design(prepared, task.design, plan.band_hz)
            except FAILURES:
                return None
        return time.perf_counter() - started
