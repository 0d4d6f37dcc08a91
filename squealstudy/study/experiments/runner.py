"""Running an experiment: what is missing of its runs, one after the other, then its tables."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from squealstudy.study.chunks import finished_points, write_rows
from squealstudy.study.experiments.definition import Experiment, PrecisionFile
from squealstudy.study.experiments.kinds import ExperimentKind, experiment_kind
from squealstudy.study.files import remove_leftovers
from squealstudy.study.keys import content_hash
from squealstudy.study.manifest import check_owner, locked, outdated, versions
from squealstudy.study.parallel import Progress, Workers, silent
from squealstudy.study.process import peak_memory_mb
from squealstudy.study.results_manifest import write_manifest
from squealstudy.study.runner import RunReport


def run_experiment(
    experiment: Experiment,
    directory: Path,
    jobs: int,
    progress: Progress = silent,
    warn: Callable[[str], None] = lambda text: None,
) -> RunReport:
    """Run an experiment, or what is left of it.

    What is timed is made run by run in this process: nothing else of ours runs beside it.

    Parameters
    ----------
    experiment : Experiment
    directory : Path
        Results directory; made where absent.
    jobs : int
        Threads and workers of the preparations.
    progress : callable
        Told (stage, done, total).
    warn : callable
        Told what may mislead.

    Raises
    ------
    StudyFileError, ResultsError
        Invalid file; directory of another study, or in use; a reference that failed.
    """
    kind = experiment_kind(experiment)
    check_owner(directory, experiment.owner)
    started = time.perf_counter()
    workers = Workers(jobs, progress)
    kind.prepare(workers)
    with locked(directory):
        found = check_owner(directory, experiment.owner)
        runs = kind.runs()
        identity = content_hash([[kind.ids(run) for run in runs], experiment.source.text])
        if found and found.get("study_hash") == identity and _whole(found, kind, directory):
            return RunReport(directory, found, 0, len(runs))
        if text := outdated(directory, found):
            warn(f"{text}; all runs are made again")
        remove_leftovers(directory)
        manifest = _manifest(experiment, jobs, identity, len(runs))
        write_manifest(directory, manifest)
        solved = _solve(kind, directory, runs, workers)
        table, facts = kind.build_tables(directory)
        manifest |= facts | {"n_failed": int((table["status"] != "ok").sum()), "status": "complete"}
        manifest["timings"] = {"total_s": time.perf_counter() - started}
        manifest["peak_memory_mb"] = {"parent": peak_memory_mb()}
        write_manifest(directory, manifest)
    return RunReport(directory, manifest, solved, len(runs) - solved)


def _solve(kind: ExperimentKind, directory: Path, runs: list[Any], workers: Workers) -> int:
    done = finished_points(directory, kind.schema)
    missing = [run for run in runs if not done.issuperset(kind.ids(run))]
    before = len(runs) - len(missing)
    workers.report("runs", before, len(runs))
    made = replace(workers, jobs=workers.jobs if kind.in_parallel else 1)
    for number, rows in enumerate(made.each(kind.solve, missing), start=1):
        write_rows(directory, rows, kind.schema)
        workers.report("runs", before + number, len(runs))
    return len(missing)


def _whole(found: dict[str, Any], kind: ExperimentKind, directory: Path) -> bool:
    there = all((directory / name).is_file() for name in kind.tables)
    return there and found.get("status") == "complete"


def _manifest(experiment: Experiment, jobs: int, identity: str, n_runs: int) -> dict[str, Any]:
    name, kind, model = experiment.owner
    base = experiment.base.source.text if isinstance(experiment, PrecisionFile) else None
    return {
        "status": "running",
        "name": name,
        "kind": kind,
        "model": model,
        "study_hash": identity,
        "n_points": n_runs,
        "parameters": [],
        "sweeps": [],
        "units": {},
        "study": experiment.source.text,
        "base": base,
        "versions": versions(),
        "python": platform.python_version(),
        "machine": {"processor": platform.machine(), "cores": os.cpu_count()},
        "threads": {"workers": jobs, "blas_threads_a_worker": 1},
        "timings": {},
    }
