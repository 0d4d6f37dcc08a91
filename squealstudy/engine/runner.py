"""Runs a study: structures, design points in chunks on workers, checks, tables."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from squealstudy.engine.chunk_rows import lost_chunk, solve_chunk, unforeseen
from squealstudy.engine.chunk_writer import ChunkWriter
from squealstudy.engine.journal import JOURNAL, Journal
from squealstudy.engine.keys import ID_TYPE
from squealstudy.engine.kind import Planned, Warn, as_kind
from squealstudy.engine.manifest import (
    FINISHED_AT,
    SIDE_STUDIES,
    check_owner,
    identity_facts,
    locked,
    new_manifest,
    outdated,
)
from squealstudy.engine.manifest_file import PICTURES, write_manifest
from squealstudy.engine.recorded_code import RECORDS, enter_executed
from squealstudy.engine.result_names import CHUNKS, LOCK, expect_inside, leads_out
from squealstudy.engine.store import INACCURATE, Store
from squealstudy.engine.validity import SOLVED
from squealstudy.engine.workers import Progress, Workers, on_one_thread, silent
from squealstudy.errors import (
    ContradictionError,
    MachineError,
    ResultsError,
    SquealstudyError,
    StudyFileError,
)
from squealstudy.machine.resources import give_back_memory, peak_memory_mb
from squealstudy.mechanics.failures import FAILURES
from squealstudy.wording import failure_counts, plural

if TYPE_CHECKING:
    import pandas as pd

    from squealstudy.engine.cluster import Cluster


@dataclass(frozen=True)
class RunReport:
    """Results directory of a run, and how many of its points were solved or there already.

    Attributes
    ----------
    directory : Path
    manifest : dict
        The manifest as it was written.
    n_solved : int
        Number of points that this run solved or could not solve; 0 where all results were there.
    n_reused : int
        Number of points whose rows were in the results before.
    """

    directory: Path
    manifest: dict[str, Any]
    n_solved: int
    n_reused: int


@on_one_thread
def run_study(
    plan: Planned,
    directory: Path,
    jobs: int,
    yes: bool = False,
    progress: Progress = silent,
    warn: Warn = lambda text: None,
    fresh: bool = False,
    cluster: Cluster | None = None,
) -> RunReport:
    """Run a study of any kind, or the rest of one that was begun before.

    Nothing is written before the study is known to be valid. Chunk files that are whole stay when a
    run is killed or the study changes; only missing design points are solved. A design that grows
    is solved in rounds; each round has the points that results of the former rounds ask for.

    Parameters
    ----------
    plan : Planned
    directory : Path
        Results directory; made where absent.
    jobs : int
        Number of workers.
    yes : bool
        Accept more points than the study's limit.
    progress : callable
        Called with (stage, done, total, failed).
    warn : callable
        Called with a text about what may go wrong.
    fresh : bool
        Remove what the study wrote there before, and begin anew; other files stay.
    cluster : Cluster or None
        Cluster whose workers solve the design points; None: processes of this machine.

    Raises
    ------
    StudyFileError, ResultsError
        Where the study is invalid, the directory is another study's or in use, or no design point
        is ok.
    """
    kind = as_kind(plan.kind)
    kind.check_limit(plan, yes)
    check_owner(directory, plan.owner)
    started = time.perf_counter()
    workers = Workers(jobs, progress, partial(kind.seconds_without_workers, plan), cluster)
    plan, failures = kind.make_models(plan, workers, warn)
    prepared_s = time.perf_counter() - started
    with locked(directory), reading_earlier_files(store := Store(directory)):
        manifest_before = check_owner(directory, plan.owner, store.journal)
        pictures, beside_left = _pictures(manifest_before), _left_beside(plan, directory)
        if fresh and (manifest_before or store.journal.begun):
            store.clear(plan.owner, [*kind.tables, *pictures])
            manifest_before = None
            while beside_left:
                _remove(beside_left.pop(), kind.tables)
        store.journal.begin(plan.owner)
        is_intact = store.repair(warn)
        options = _Options(jobs, yes, progress, warn, fresh, cluster)
        side_facts, changed = _run_beside(plan, directory, options)
        if (further := kind.extended_plan(plan, store)) is not plan:
            plan = further
            failures |= kind.make_missing_models(plan, workers)
        if (
            manifest_before
            and is_intact
            and not changed
            and _is_complete(manifest_before, plan, store)
        ):
            statuses = store.read_table(kind.tables[0], ["status", "message"])
            if len(statuses):
                _expect_solved(plan, directory, statuses.to_pandas())
                return RunReport(directory, manifest_before, 0, len(plan.tasks))
        if text := outdated(directory, manifest_before):
            warn(f"{text}; all {kind.rows_word} are solved again")
        if text := _left_over(plan, store, done := store.finished_points(kind.schema)):
            warn(text)
        for other in beside_left:
            warn(f"{other}: it belongs to this study no more (--fresh removes it)")
        for name in pictures:  # they show tables that are made anew
            (directory / name).unlink(missing_ok=True)
        manifest = new_manifest(plan, jobs)
        manifest["timings"] = {"structures_s": prepared_s, **kind.timings(plan, failures)}
        manifest |= {SIDE_STUDIES: side_facts} if side_facts else {}
        write_manifest(directory, manifest)
        enter_executed([record["hash"] for record in manifest.get(RECORDS, [])])
        for text in kind.warnings(plan):
            warn(text)
        n_solved = _solve_points(plan, store, done, failures, workers, manifest)
        while len((further := kind.extended_plan(plan, store)).tasks) > len(plan.tasks):
            plan = further
            kind.check_limit(plan, yes)
            failures |= kind.make_missing_models(plan, workers)
            manifest |= kind.manifest(plan) | identity_facts(plan)
            done = store.finished_points(kind.schema)
            n_solved += _solve_points(plan, store, done, failures, workers, manifest)
        verified = time.perf_counter()
        manifest["reference"] = kind.verify(plan, store, failures, workers)
        manifest["timings"]["reference_s"] = time.perf_counter() - verified
        _finish(plan, store, manifest, workers, started)
    return RunReport(directory, manifest, n_solved, len(plan.tasks) - n_solved)


@dataclass(frozen=True)
class _Options:
    """How a study is run; see `run_study`."""

    jobs: int
    yes: bool
    progress: Progress
    warn: Warn
    fresh: bool
    cluster: Cluster | None


def _run_beside(plan: Planned, directory: Path, options: _Options) -> tuple[dict[str, str], bool]:
    """Run the studies beside a study.

    Returns by folder why one failed, else an empty text; and whether results of any have changed.
    A fault of a study file or of the machine ends the run; after other errors the next study runs.
    """
    failures, changed = {}, False
    for folder, other in as_kind(plan.kind).side_studies(plan).items():
        expect_inside(directory, folder)
        options_there = replace(options, progress=partial(_told_of, options.progress, folder))
        failures[folder] = ""
        try:
            report = run_study(other, directory / folder, **vars(options_there))
        except (StudyFileError, MachineError):
            raise
        except SquealstudyError as error:
            failures[folder], changed = str(error), True
            options.warn(f"{folder}: {error}")
        else:
            changed |= report.n_solved > 0
    return failures, changed


def _left_beside(plan: Planned, directory: Path) -> list[Path]:
    """Results of studies that were run beside this one before, and no longer belong to it."""
    name, kind, _ = plan.owner
    planned = {directory / folder for folder in as_kind(plan.kind).side_studies(plan)}
    folders = {path.parent for path in directory.glob(f"*/*/{JOURNAL}")} - planned
    begun = {p for p in folders if not leads_out(directory, p.relative_to(directory).as_posix())}
    owners = {p: Journal(p).owner or () for p in sorted(begun)}
    return [p for p, owner in owners.items() if owner[:2] == (f"{name}_{p.name}", kind)]


def _remove(directory: Path, tables: Sequence[str]) -> None:
    """Remove all that a study wrote in a directory, by its journal; other files stay."""
    store = Store(directory)
    owner = store.journal.owner
    assert owner is not None
    with locked(directory):
        manifest = check_owner(directory, owner, store.journal)
        store.clear(owner, [*tables, *_pictures(manifest)])
        (directory / JOURNAL).unlink()
    (directory / LOCK).unlink(missing_ok=True)
    for folder in (directory, directory.parent):
        with contextlib.suppress(OSError):  # it holds files of others
            folder.rmdir()


def _pictures(manifest: dict[str, Any] | None) -> list[str]:
    """Names of the pictures that a manifest lists."""
    return list(manifest.get(PICTURES, [])) if manifest else []


def _told_of(
    progress: Progress, folder: str, stage: str, done: int, total: int, failed: int = 0
) -> None:
    progress(f"{folder}: {stage}", done, total, failed)


def _is_complete(manifest: dict[str, Any], plan: Planned, store: Store) -> bool:
    """Whether nothing is left to do in a directory whose files are all whole."""
    if manifest.get("status") != "complete" or manifest.get("study_hash") != plan.study_hash:
        return False
    if not all(store.parts(name) for name in plan.kind.tables):
        return False
    if not store.journal.unreadable:
        return True
    # chunks may have been in lines that cannot be read
    return bool(np.isin(plan.tasks.ids, store.finished_points(plan.kind.schema)).all())


def _left_over(plan: Planned, store: Store, solved_ids: np.ndarray) -> str:
    """Warning about rows solved before that do not belong to the study now; empty without any."""
    others = int(np.isin(solved_ids, plan.tasks.ids, invert=True).sum())
    if not others:
        return ""
    return (
        f"{store.directory}: {len(solved_ids) - others} of "
        f"{plural(len(solved_ids), plan.kind.row_word)} "
        f"solved before belong to this study as it is now, for the study or the code changed; "
        f"{others} others stay in {CHUNKS}/, not in the tables (--fresh removes them)"
    )


def _solve_points(
    plan: Planned,
    store: Store,
    done_before: np.ndarray,
    failures: dict[str, str],
    workers: Workers,
    manifest: dict[str, Any],
) -> int:
    """Solve the design points whose ids are not in `done_before`; how many these were."""
    started, kind = time.perf_counter(), as_kind(plan.kind)
    workers = kind.usable_workers(plan, workers)
    pending = np.flatnonzero(np.isin(plan.tasks.ids, done_before, invert=True))
    why = kind.unsolvable(plan, plan.tasks.at(pending), failures)
    rows = [kind.failed_row(name, "structure", text) for name, text in why.items()]
    if rows:
        store.write_rows(rows, kind.schema)
    lost = np.isin(plan.tasks.ids[pending], np.array(list(why), dtype=ID_TYPE))
    solvable = plan.tasks.at(pending[~lost])
    tasks = kind.tasks(plan, solvable, workers) if len(solvable) else []
    total, done, gaps_reused = len(plan.tasks), len(plan.tasks) - len(solvable), 0
    failed = len(rows)
    workers.report(kind.rows_word, done, total, failed)
    busy, peak = 0.0, manifest.get("peak_memory_mb", {}).get("largest_worker", 0.0)
    stand_in = partial(lost_chunk, kind)
    with ChunkWriter(store) as writer:
        for chunk in workers.each(partial(solve_chunk, kind), tasks, lost=stand_in):
            writer.add(chunk)
            workers.pace.took(len(chunk.table), chunk.wall_s)
            done += len(chunk.table)
            failed += sum(s not in SOLVED for s in chunk.table["status"].to_pylist())
            gaps_reused += chunk.known
            busy += chunk.wall_s
            peak = max(peak, chunk.peak_mb)
            workers.report(kind.rows_word, done, total, failed)
    manifest["peak_memory_mb"] = {"largest_worker": peak}
    spent = {
        "points_s": time.perf_counter() - started,
        "points_worker_s": busy,
        "points_solved": len(solvable),
        "working_points_reused": gaps_reused,
    }
    timings = manifest["timings"]
    for name, seconds in spent.items():  # summed over all rounds
        timings[name] = timings.get(name, 0) + seconds
    return len(pending)


def _finish(
    plan: Planned, store: Store, manifest: dict[str, Any], workers: Workers, started: float
) -> None:
    """Build the tables and close the manifest."""
    give_back_memory()  # that of workers' results, which are written
    workers.report("tables", 0, 1)
    tables_started = time.perf_counter()
    points, facts = as_kind(plan.kind).build_tables(plan, store, workers)
    pa.default_memory_pool().release_unused()  # rankings and pictures need memory next
    extra_seconds = facts.pop("seconds", {})  # points solved for the tables alone
    manifest |= facts
    now = time.perf_counter()
    tables_s = now - tables_started - sum(extra_seconds.values())
    manifest["timings"] |= {"tables_s": tables_s, **extra_seconds, "total_s": now - started}
    solved = points["status"].isin(SOLVED)
    manifest["n_failed"] = int((~solved).sum())
    manifest["n_inaccurate"] = int((points["status"] == INACCURATE).sum())
    manifest["peak_memory_mb"]["parent"] = peak_memory_mb()
    manifest["status"] = "complete"
    manifest[FINISHED_AT] = f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC"
    write_manifest(store.directory, manifest)
    workers.report("tables", 1, 1)
    _expect_solved(plan, store.directory, points)


def _expect_solved(plan: Planned, directory: Path, points: pd.DataFrame) -> None:
    """Raise ResultsError, with the reasons, where no row of a finished run is ok."""
    if (points["status"] == "ok").any():
        return
    what = "is inaccurate" if (points["status"] == INACCURATE).any() else "failed"
    counts = failure_counts(points["status"])
    raise ResultsError(
        f"{directory}: every {plan.kind.row_word} {what} ({counts}), the first with: "
        f"{points['message'].iloc[0]}"
    )


@contextmanager
def reading_earlier_files(store: Store) -> Iterator[None]:
    """Turn unforeseen errors into a ContradictionError where results were there before.

    Types and lengths are checked as rows are read, but not every value: the files may be at fault.
    """
    earlier = bool(store.journal.entries)
    try:
        yield
    except SquealstudyError:
        raise
    except FAILURES as error:
        if not earlier:
            raise
        raise ContradictionError(
            f"{store.directory}: what is finished there does not fit together "
            f"({unforeseen(error)[1]}): its files are not as a run of this version writes them, or "
            "this is a mistake of ours; --fresh makes all anew. SQUEALSTUDY_DEBUG=1 shows where"
        ) from error
