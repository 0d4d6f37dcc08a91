"""Running a study: structures, design points in chunks on parallel workers, checks, tables."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq

from squealstudy.errors import ResultsError, SquealstudyError
from squealstudy.study import chunks
from squealstudy.study.cache import is_prepared, load_prepared, read_scalars
from squealstudy.study.files import remove_leftovers
from squealstudy.study.kind import Kind
from squealstudy.study.kinds import kind_named
from squealstudy.study.manifest import (
    check_ownership,
    locked,
    new_manifest,
    outdated,
    point_facts,
)
from squealstudy.study.names import INACCURATE, POINTS
from squealstudy.study.parallel import Progress, Workers, silent
from squealstudy.study.plan import Plan
from squealstudy.study.process import peak_memory_mb
from squealstudy.study.results_manifest import write_manifest
from squealstudy.study.rounds import grown
from squealstudy.study.sampling import check_limit
from squealstudy.study.structures import build_structure, build_task, mode_counts, patience
from squealstudy.study.tasks import Work

if TYPE_CHECKING:
    import pandas as pd


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


def kind_of(plan: Plan) -> Kind:
    """What the plan's study computes."""
    return kind_named(plan.study.definition.study.kind)


def check_component_modes(plan: Plan) -> None:
    """Raise StudyFileError where the study names a component mode that the basis does not hold.

    Costs a few seconds where the reduction is not in the cache, instead of the whole reduction.
    """
    if plan.designs[0].mode_parameters():
        first = plan.structures[0].key
        ready = is_prepared(first)
        plan.check_modes(load_prepared(first).model.mode_counts if ready else mode_counts(plan))


def check_shapes(plan: Plan) -> str:
    """What of the geometry vanishes in some structures of a plan, to warn of; nothing is built.

    Raises StudyFileError where it does in all of them.
    """
    model = plan.study.model
    values = [s.design.plain_values() for s in plan.structures]
    found = [(pair, v) for v in values if (pair := model.vanishing(v))]
    if not found:
        return ""
    (smaller, larger), first = found[0]
    text = f"expected {smaller} ({first[smaller]:g}) below {larger} ({first[larger]:g})"
    if len(found) < len(values):
        return f"{len(found)} of {len(values)} geometries cannot be built; the first: {text}"
    given = {*plan.study.definition.parameters, *(s.name for s in plan.study.sweeps)}
    raise plan.error(larger if larger in given else smaller, f"{text}: a part would vanish")


def default_directory(plan: Plan) -> Path:
    """results/<study name>, in the current directory."""
    return Path("results") / plan.study.definition.study.name


def run_study(
    plan: Plan,
    directory: Path,
    jobs: int,
    yes: bool = False,
    progress: Progress = silent,
    warn: Callable[[str], None] = lambda text: None,
) -> RunReport:
    """Run a study, or what is left of it.

    Nothing is written before the study is known to be valid. Whole chunk files are kept over
    kills and changes; only missing design points are solved. A design that grows is solved in
    rounds, each of points that the ones before ask for.

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
    warn : callable
        Told what may go wrong, before the design points are solved.

    Raises
    ------
    StudyFileError, ResultsError
        Invalid study; directory of another study, or in use.
    """
    check_limit(plan.study, yes)
    check_ownership(directory, plan)
    started = time.perf_counter()
    if text := check_shapes(plan):
        warn(text)
    check_component_modes(plan)
    workers = Workers(jobs, progress, partial(patience, plan))
    failures = build_structures(plan, workers)
    kind = kind_of(plan)
    kind.check(plan)
    if (better := kind.accurate(plan, failures, workers)) is not plan:
        plan = better
        failures |= build_structures(plan, workers)
    prepared_s = time.perf_counter() - started
    with locked(directory):
        if (further := grown(plan, directory)) is not plan:
            plan = further
            failures |= build_structures(plan, workers)
        found = check_ownership(directory, plan)
        if found and _is_complete(found, plan, kind, directory):
            _expect_solved(directory)
            return RunReport(directory, found, 0, len(plan.tasks))
        if text := outdated(directory, found):
            warn(f"{text}; all design points are solved again")
        remove_leftovers(directory)
        manifest = new_manifest(plan, jobs)
        manifest["timings"] = {"structures_s": prepared_s, **_structure_timings(plan, failures)}
        write_manifest(directory, manifest)
        for text in kind.warnings(plan):
            warn(text)
        n_solved = _solve_points(plan, kind, directory, failures, workers, manifest)
        while len((further := grown(plan, directory)).tasks) > len(plan.tasks):
            plan = further
            check_limit(plan.study, yes, len(plan.tasks))
            failures |= build_structures(plan, workers)
            manifest |= point_facts(plan)
            n_solved += _solve_points(plan, kind, directory, failures, workers, manifest)
        verified = time.perf_counter()
        manifest["reference"] = kind.verify(plan, directory, failures, workers)
        manifest["timings"]["reference_s"] = time.perf_counter() - verified
        _finish(plan, kind, directory, manifest, workers, started)
    return RunReport(directory, manifest, n_solved, len(plan.tasks) - n_solved)


def _is_complete(found: dict[str, Any], plan: Plan, kind: Kind, directory: Path) -> bool:
    return (
        found.get("status") == "complete"
        and found.get("study_hash") == plan.study_hash
        and all(_readable(directory / name) for name in kind.tables)
    )


def _readable(path: Path) -> bool:
    """Whether a table is there and whole; what is not is made again from the chunk files."""
    try:
        pq.read_metadata(path)
    except (OSError, ValueError):
        return False
    return True


def build_structures(
    plan: Plan, workers: Workers, wanted: Collection[str] | None = None
) -> dict[str, str]:
    """Make the prepared models that the cache does not hold; reasons of failure by key.

    `wanted` are the keys of those to be made, of a study that is tried at some points alone.

    Raises
    ------
    SquealstudyError
        Where no structure of the study can be made.
    """
    asked = [s for s in plan.structures if wanted is None or s.key in wanted]
    missing = [s for s in asked if not is_prepared(s.key)]
    if not missing:
        return {}
    if workers.jobs > 1:
        kind_of(plan).begin(plan)
    threads = workers.jobs if len(missing) == 1 else 1
    tasks = [build_task(plan, s, threads) for s in missing]
    made = workers.each(build_structure, tasks, "reduction")
    failures = {key: reason for key, reason in made if reason}
    if len(failures) == len(plan.structures):
        raise SquealstudyError(f"{plan.study.path}: {next(iter(failures.values()))}")
    return failures


def build_first(plan: Plan, jobs: int) -> str:
    """Make the first structure of a plan; the reason of its failure, or an empty string."""
    return build_structure(build_task(plan, plan.structures[0], jobs))[1]


def _structure_timings(plan: Plan, failures: dict[str, str]) -> dict[str, float]:
    """Seconds of each preparing stage when it was done, the mean over structures."""
    kept = [s.key for s in plan.structures if s.key not in failures]
    found = [read_scalars(key)["timings"] for key in kept]
    return {
        f"structure_{name}": float(np.mean([t[name] for t in found if name in t]))
        for name in {name: None for timings in found for name in timings}
    }


def _solve_points(
    plan: Plan,
    kind: Kind,
    directory: Path,
    failures: dict[str, str],
    workers: Workers,
    manifest: dict[str, Any],
) -> int:
    """Solve the design points that no chunk file holds; their number."""
    started = time.perf_counter()
    done_before = chunks.finished_points(directory, kind.schema)
    pending = [t for t in plan.tasks if t.point_id not in done_before]
    unbuilt = [t for t in pending if t.prepared_key in failures]
    solvable = [t for t in pending if t.prepared_key not in failures]
    if unbuilt:
        rows = [kind.failed_row(t.point_id, "structure", failures[t.prepared_key]) for t in unbuilt]
        chunks.write_rows(directory, rows, kind.schema)
    if solvable:
        kind.prepare(plan, workers.report)
    work = [Work(kind, task) for task in kind.tasks(plan, solvable, workers.jobs)]
    total, done, known = len(plan.tasks), len(plan.tasks) - len(solvable), 0
    workers.report("design points", done, total)
    timings = manifest["timings"]
    busy, peak = 0.0, manifest.get("peak_memory_mb", {}).get("largest_worker", 0.0)
    for chunk in workers.each(Work.done, work):
        chunks.write_chunk(directory, chunk)
        done += len(chunk.table)
        known += chunk.known
        busy += chunk.wall_s
        peak = max(peak, chunk.peak_mb)
        workers.report("design points", done, total)
    manifest["peak_memory_mb"] = {"largest_worker": peak}
    spent = {
        "points_s": time.perf_counter() - started,
        "points_worker_s": busy,
        "points_solved": len(solvable),
        "working_points_reused": known,
    }
    for name, value in spent.items():  # of all rounds together
        timings[name] = timings.get(name, 0) + value
    return len(pending)


def _finish(
    plan: Plan,
    kind: Kind,
    directory: Path,
    manifest: dict[str, Any],
    workers: Workers,
    started: float,
) -> None:
    """Build the tables and close the manifest."""
    workers.report("tables", 0, 1)
    tables_started = time.perf_counter()
    points, facts = kind.build_tables(plan, directory, workers)
    manifest |= facts
    now = time.perf_counter()
    manifest["timings"] |= {"tables_s": now - tables_started, "total_s": now - started}
    solved = points["status"].isin(["ok", INACCURATE])
    manifest["n_failed"] = int((~solved).sum())
    manifest["n_inaccurate"] = int((points["status"] == INACCURATE).sum())
    manifest["peak_memory_mb"]["parent"] = peak_memory_mb()
    manifest["status"] = "complete"
    write_manifest(directory, manifest)
    workers.report("tables", 1, 1)
    _expect_solved(directory)


def _expect_solved(directory: Path) -> None:
    """Raise ResultsError, with the reasons, where no design point of a finished run is ok."""
    points = pq.read_table(directory / POINTS, columns=["status", "message"]).to_pandas()
    if (points["status"] == "ok").any():
        return
    what = "is inaccurate" if (points["status"] == INACCURATE).any() else "failed"
    raise ResultsError(
        f"{directory}: every design point {what} ({failure_counts(points['status'])}), the first "
        f"with: {points['message'].iloc[0]}"
    )


def failure_counts(status: pd.Series) -> str:
    """How often design points are not ok, by status, such as ``3 not_converged``."""
    counts = status[status != "ok"].value_counts()
    return ", ".join(f"{count} {name}" for name, count in counts.items())
