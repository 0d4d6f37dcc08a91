"""The one place that hands tasks to worker processes; work of a few seconds stays in this one.

What passes between a run and its workers, their memory, and their end with the parent.
"""

from __future__ import annotations

import contextlib
import math
import os
import resource
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import pyarrow as pa
from threadpoolctl import threadpool_limits

from squealstudy.errors import SquealstudyError
from squealstudy.extensions import Extensions, extension_files

if TYPE_CHECKING:
    from squealstudy.engine.kind import Kind


MAX_CHUNK = 16  # points: what a kill can lose at most, per worker
CHUNKS_A_WORKER = 8
WATCH_S = 0.5
STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")

_started_with: list[tuple[Path, ...]] = []  # files of the workers that may be there
_watched: set[int] = set()
Item = TypeVar("Item")
Found = TypeVar("Found")
Progress = Callable[[str, int, int], None]  # stage, done, total


def silent(stage: str, done: int, total: int) -> None:
    """Progress that nobody is told of."""


def at_once() -> float:
    """The patience of work that goes to worker processes at once."""
    return 0.0


@dataclass(frozen=True)
class Workers:
    """Worker processes, one BLAS thread each, and who is told how far they are.

    Attributes
    ----------
    jobs : int
        Processes; with one all is done in this process.
    report : callable
        Told (stage, done, total).
    patience : callable
        Seconds for which tasks are done in this process: a worker takes longer to start than a
        small study to run.
    """

    jobs: int = 1
    report: Progress = silent
    patience: Callable[[], float] = at_once

    def each(
        self, function: Callable[[Item], Found], tasks: Sequence[Item], stage: str = ""
    ) -> Iterator[Found]:
        """Results of a function of each task, as they come.

        `stage` is the name under which progress is told; none without.

        Raises
        ------
        SquealstudyError
            Where a worker process dies.
        """
        if stage and tasks:
            self.report(stage, 0, len(tasks))
        for done, found in enumerate(self._found(function, tasks), start=1):
            if stage:
                self.report(stage, done, len(tasks))
            yield found

    def _found(self, function: Callable[[Item], Found], tasks: Sequence[Item]) -> Iterator[Found]:
        started, patience = time.perf_counter(), self.patience()
        alone = self.jobs == 1 or len(tasks) == 1
        done = 0
        while done < len(tasks) and (alone or time.perf_counter() - started < patience):
            done += 1
            yield _on_one_thread(function, tasks[done - 1])
        if done < len(tasks):
            yield from self._on_processes(function, tasks[done:])

    def _on_processes(
        self, function: Callable[[Item], Found], tasks: Sequence[Item]
    ) -> Iterator[Found]:
        from concurrent.futures.process import BrokenProcessPool

        from joblib import Parallel, delayed, parallel_config

        files = Extensions(extension_files())
        _renew_workers(files.paths)
        calls = [delayed(_in_worker)(files, os.getpid(), function, task) for task in tasks]
        try:
            with parallel_config(backend="loky", inner_max_num_threads=1):
                yield from Parallel(
                    n_jobs=min(self.jobs, len(tasks)),
                    return_as="generator_unordered",
                    batch_size=1,
                )(calls)
        except BrokenProcessPool as error:
            raise SquealstudyError(
                "a worker process died (out of memory, or killed); what is finished is kept, and "
                "the same command goes on from there, with fewer workers by --jobs"
            ) from error


def _on_one_thread(function: Callable[[Item], Found], task: Item) -> Found:
    with threadpool_limits(1):
        return function(task)


def _in_worker(
    _files: Extensions, parent: int, function: Callable[[Item], Found], task: Item
) -> Found:
    """A task in a worker, which has executed the files of the study when it gets here.

    The worker ends with the process `parent`.
    """
    watch_parent(parent)
    return _on_one_thread(function, task)


def _renew_workers(files: tuple[Path, ...]) -> None:
    """End workers that began without these files: their kernels know other laws."""
    from joblib.externals.loky import get_reusable_executor

    if _started_with and _started_with[-1] != files:
        get_reusable_executor().shutdown(wait=True)
    _started_with[:] = [files]


def split_chunks(tasks: Sequence[Item], jobs: int) -> list[Sequence[Item]]:
    """Consecutive points in chunks small enough to balance the workers and to lose little."""
    size = max(1, min(MAX_CHUNK, math.ceil(len(tasks) / (CHUNKS_A_WORKER * jobs))))
    return [tasks[i : i + size] for i in range(0, len(tasks), size)]


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


def peak_memory_mb() -> float:
    """Largest resident size of this process so far, MB.

    From /proc where there is one: getrusage gives a worker its parent's size at the fork.
    """
    if STATUS.is_file():
        return _status_mb("VmHWM")
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def _status_mb(name: str) -> float:
    fields = dict(line.split(":", 1) for line in STATUS.read_text().splitlines())
    return float(fields[name].split()[0]) / 1024.0


@dataclass
class MemoryAbove:
    """Largest resident size within `memory_above`, MB above that before; NaN where unknown."""

    megabytes: float = float("nan")


@contextlib.contextmanager
def memory_above() -> Iterator[MemoryAbove]:
    """Watch the memory of what runs inside; Linux only, elsewhere NaN."""
    found = MemoryAbove()
    try:
        RESET.write_text("5")  # the peak begins again at the present size
        before = _status_mb("VmRSS")
    except OSError:
        yield found
        return
    yield found
    found.megabytes = max(0.0, _status_mb("VmHWM") - before)


@dataclass(frozen=True)
class Solved:
    """What a kind of study found at some design points.

    Attributes
    ----------
    rows : sequence of dict
        One a design point, with the columns of the kind's chunk files.
    files : mapping of str -> Table, or mapping of names to arrays
        What belongs beside the tables, by its path in the results directory: Parquet or npz.
    known : int
        Points whose working point an earlier study had found.
    """

    rows: Sequence[dict[str, Any]]
    files: Mapping[str, pa.Table | Mapping[str, Any]] = field(default_factory=dict)
    known: int = 0


@dataclass(frozen=True)
class ChunkRows:
    """Rows that are written as one file, and what they took: seconds, MB of the worker."""

    table: pa.Table
    files: Mapping[str, pa.Table | Mapping[str, Any]]
    known: int
    wall_s: float
    peak_mb: float


def solve_chunk(kind: Kind, task: Any) -> ChunkRows:
    """What a worker does with a task of a kind of study; nothing is written here."""
    started = time.perf_counter()
    found = kind.solve(task)
    table = pa.Table.from_pylist(list(found.rows), schema=kind.schema)
    wall_s = time.perf_counter() - started
    return ChunkRows(table, found.files, found.known, wall_s, peak_memory_mb())
