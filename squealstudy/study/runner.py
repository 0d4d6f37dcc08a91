"""Running a study: structures, design points in chunks on parallel workers, checks, tables."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from joblib import Parallel, delayed, parallel_config

from squealstudy.errors import ResultsError, SquealstudyError
from squealstudy.study import chunks
from squealstudy.study.cache import is_prepared, load_prepared
from squealstudy.study.files import remove_leftovers
from squealstudy.study.keys import chunk_id
from squealstudy.study.manifest import (
    check_ownership,
    locked,
    new_manifest,
    write_manifest,
)
from squealstudy.study.plan import Plan, Structure, reference_choice
from squealstudy.study.sampling import check_limit
from squealstudy.study.structures import (
    REFERENCES,
    BuildTask,
    ReferenceTask,
    build_structure,
    check_reference,
    mode_counts,
)
from squealstudy.study.tables import MODES, POINTS, build_tables, read_references
from squealstudy.study.worker import ChunkTask, PointTask, peak_memory_mb, solve_chunk

MAX_CHUNK = 16  # points: what a kill can lose at most, per worker
CHUNKS_A_WORKER = 8
KEEP_GAPS_LIMIT = 5000  # points: beyond it working points are not kept for other studies

Progress = Callable[[str, int, int], None]  # stage, done, total


@dataclass(frozen=True)
class RunReport:
    """What a run did.

    Attributes
    ----------
    directory : Path
    manifest : dict
        As written.
    n_solved : int
        Design points solved by this run; 0 where all was there.
    n_reused : int
        Points found in the results.
    """

    directory: Path
    manifest: dict[str, Any]
    n_solved: int
    n_reused: int


def check_component_modes(plan: Plan) -> None:
    """Raise StudyFileError where the study names a component mode that the basis does not hold.

    Costs a few seconds where the reduction is not in the cache, instead of the whole reduction.
    """
    if plan.designs[0].mode_parameters():
        first = plan.structures[0].key
        ready = is_prepared(first)
        plan.check_modes(load_prepared(first).model.mode_counts if ready else mode_counts(plan))


def default_directory(plan: Plan) -> Path:
    """results/<study name>, in the current directory."""
    return Path("results") / plan.study.definition.study.name


def run_study(
    plan: Plan,
    directory: Path,
    jobs: int,
    yes: bool = False,
    progress: Progress = lambda stage, done, total: None,
) -> RunReport:
    """Run a study, or what is left of it.

    Nothing is written before the study is known to be valid. Whole chunk files are kept over
    kills and changes; only missing design points are solved.

    Parameters
    ----------
    plan : Plan
    directory : Path
        Results directory; made where absent.
    jobs : int
        Worker processes.
    yes : bool
        Accept more points than the study's limit.
    progress : callable
        Told (stage, done, total).

    Raises
    ------
    StudyFileError, ResultsError
        Invalid study; directory of another study, or in use.
    """
    check_limit(plan.study, yes)
    check_ownership(directory, plan)
    started = time.perf_counter()
    check_component_modes(plan)
    failures = build_structures(plan, jobs, progress)
    prepared_s = time.perf_counter() - started
    with locked(directory):
        found = check_ownership(directory, plan)
        if found and _is_complete(found, plan, directory):
            return RunReport(directory, found, 0, len(plan.tasks))
        remove_leftovers(directory)
        manifest = new_manifest(plan, jobs)
        manifest["timings"] = {"structures_s": prepared_s, **_structure_timings(plan, failures)}
        write_manifest(directory, manifest)
        n_solved = _solve_points(plan, directory, jobs, failures, progress, manifest)
        _check_points(plan, directory, jobs, failures, progress, manifest)
        _finish(plan, directory, manifest, progress, started)
    return RunReport(directory, manifest, n_solved, len(plan.tasks) - n_solved)


def _is_complete(found: dict[str, Any], plan: Plan, directory: Path) -> bool:
    return (
        found.get("status") == "complete"
        and found.get("study_hash") == plan.study_hash
        and (directory / POINTS).is_file()
        and (directory / MODES).is_file()
    )


def _parallel(jobs: int, tasks: Sequence[Any]) -> Iterator[Any]:
    """Results of delayed tasks as they come, on loky workers with one BLAS thread each."""
    workers = max(1, min(jobs, len(tasks)))
    try:
        with parallel_config(backend="loky", inner_max_num_threads=1):
            yield from Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1)(
                tasks
            )
    except BrokenProcessPool as error:
        raise SquealstudyError(
            "a worker process died (out of memory, or killed); what is finished is kept, and the "
            "same command goes on from there, with fewer workers by --jobs"
        ) from error


def build_structures(plan: Plan, jobs: int, progress: Progress) -> dict[str, str]:
    """Make the prepared models that the cache does not hold; reasons of failure by key.

    Raises
    ------
    SquealstudyError
        Where no structure of the study can be made.
    """
    missing = [s for s in plan.structures if not is_prepared(s.key)]
    if not missing:
        return {}
    stage = "reduction"
    progress(stage, 0, len(missing))
    threads = jobs if len(missing) == 1 else 1
    tasks = [_build_task(plan, s, threads) for s in missing]
    if len(tasks) == 1:
        outcomes = iter([build_structure(tasks[0])])
    else:
        outcomes = _parallel(jobs, [delayed(build_structure)(t) for t in tasks])
    failures = {}
    for done, (key, reason) in enumerate(outcomes, start=1):
        progress(stage, done, len(missing))
        if reason:
            failures[key] = reason
    if len(failures) == len(plan.structures):
        raise SquealstudyError(f"{plan.study.path}: {next(iter(failures.values()))}")
    return failures


def build_first(plan: Plan, jobs: int) -> str:
    """Make the first structure of a plan; the reason of its failure, or an empty string."""
    return build_structure(_build_task(plan, plan.structures[0], jobs))[1]


def _build_task(plan: Plan, structure: Structure, threads: int) -> BuildTask:
    return BuildTask(
        structure,
        plan.study.options,
        plan.nominal,
        plan.training,
        plan.settings,
        threads,
        os.getpid(),
    )


def _structure_timings(plan: Plan, failures: dict[str, str]) -> dict[str, float]:
    """Seconds of each preparing stage when it was done, the mean over structures."""
    kept = [s.key for s in plan.structures if s.key not in failures]
    frame = pd.DataFrame([dict(load_prepared(key).timings) for key in kept])
    return {f"structure_{name}": float(value) for name, value in frame.mean().items()}


def _solve_points(
    plan: Plan,
    directory: Path,
    jobs: int,
    failures: dict[str, str],
    progress: Progress,
    manifest: dict[str, Any],
) -> int:
    """Solve the design points that no chunk file holds; their number."""
    started = time.perf_counter()
    done_before = chunks.finished_points(directory)
    pending = [t for t in plan.tasks if t.point_id not in done_before]
    unbuilt = [t for t in pending if t.prepared_key in failures]
    solvable = [t for t in pending if t.prepared_key not in failures]
    if unbuilt:
        rows = [
            chunks.failed_row(t.point_id, 0.0, "structure", failures[t.prepared_key])
            for t in unbuilt
        ]
        chunks.write_chunk(directory, chunk_id(t.point_id for t in unbuilt), rows)
    tasks = [
        ChunkTask(
            directory,
            plan.band_hz,
            tuple(part),
            len(plan.tasks) <= KEEP_GAPS_LIMIT,
            os.getpid(),
        )
        for part in split_chunks(solvable, jobs)
    ]
    total, done, known = len(plan.tasks), len(plan.tasks) - len(solvable), 0
    progress("design points", done, total)
    busy = peak = 0.0
    for report in _parallel(jobs, [delayed(solve_chunk)(t) for t in tasks]) if tasks else ():
        done += report.n_points
        known += report.n_known_working_points
        busy += report.wall_s
        peak = max(peak, report.peak_mb)
        progress("design points", done, total)
    manifest["peak_memory_mb"] = {"largest_worker": peak}
    manifest["timings"] |= {
        "points_s": time.perf_counter() - started,
        "points_worker_s": busy,
        "points_solved": len(solvable),
        "working_points_reused": known,
    }
    return len(pending)


def split_chunks(tasks: Sequence[PointTask], jobs: int) -> list[Sequence[PointTask]]:
    """Consecutive points in chunks small enough to balance the workers and to lose little."""
    size = max(1, min(MAX_CHUNK, math.ceil(len(tasks) / (CHUNKS_A_WORKER * jobs))))
    return [tasks[i : i + size] for i in range(0, len(tasks), size)]


def _check_points(
    plan: Plan,
    directory: Path,
    jobs: int,
    failures: dict[str, str],
    progress: Progress,
    manifest: dict[str, Any],
) -> None:
    """Solve the chosen reference points at full order, those not checked before."""
    started = time.perf_counter()
    chosen = [plan.tasks[i] for i in reference_choice(plan, reference_count(plan))]
    present = read_references(directory) if (directory / REFERENCES).is_dir() else {}
    tasks = [
        ReferenceTask(directory, t, plan.study.options, plan.settings, plan.band_hz, os.getpid())
        for t in chosen
        if t.point_id not in present and t.prepared_key not in failures
    ]
    if tasks:
        progress("full-order check", 0, len(tasks))
    results = _parallel(jobs, [delayed(check_reference)(t) for t in tasks]) if tasks else ()
    for done, _ in enumerate(results, start=1):
        progress("full-order check", done, len(tasks))
    manifest["timings"]["reference_s"] = time.perf_counter() - started
    ids = {t.point_id for t in chosen}
    manifest["reference"] = [r for i, r in read_references(directory).items() if i in ids]


def reference_count(plan: Plan) -> int:
    """Number of design points to check at full order."""
    return plan.study.definition.modes.reference_points


def _finish(
    plan: Plan,
    directory: Path,
    manifest: dict[str, Any],
    progress: Progress,
    started: float,
) -> None:
    """Build the tables and close the manifest."""
    progress("tables", 0, 1)
    tables_started = time.perf_counter()
    points, _ = build_tables(plan, directory)
    now = time.perf_counter()
    manifest["timings"] |= {"tables_s": now - tables_started, "total_s": now - started}
    manifest["n_failed"] = int((points["status"] != "ok").sum())
    manifest["peak_memory_mb"]["parent"] = peak_memory_mb()
    manifest["status"] = "complete"
    write_manifest(directory, manifest)
    progress("tables", 1, 1)
    if manifest["n_failed"] == len(points):
        message = str(points["message"].iloc[0])
        raise ResultsError(f"{directory}: every design point failed, the first with: {message}")
