"""The one place that hands tasks to worker processes; work of a few seconds stays in this one."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from threadpoolctl import threadpool_limits

from squealstudy.engine.process import watch_parent
from squealstudy.errors import SquealstudyError
from squealstudy.extensions import Extensions, extension_files

MAX_CHUNK = 16  # points: what a kill can lose at most, per worker
CHUNKS_A_WORKER = 8

_started_with: list[tuple[Path, ...]] = []  # files of the workers that may be there
Item = TypeVar("Item")
Found = TypeVar("Found")
Progress = Callable[[str, int, int], None]  # stage, done, total


def silent(stage: str, done: int, total: int) -> None:
    """Progress that nobody is told of."""


def _at_once() -> float:
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
    patience: Callable[[], float] = _at_once

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
            yield _on_one_thread(0, function, tasks[done - 1])
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


def _on_one_thread(parent: int, function: Callable[[Item], Found], task: Item) -> Found:
    """A task, in a worker that ends with the process `parent`, or in that itself (0)."""
    if parent:
        watch_parent(parent)
    with threadpool_limits(1):
        return function(task)


def _in_worker(
    _files: Extensions, parent: int, function: Callable[[Item], Found], task: Item
) -> Found:
    """A task in a worker, which has executed the files of the study when it gets here."""
    return _on_one_thread(parent, function, task)


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
