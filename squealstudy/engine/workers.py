"""The only place that hands tasks to workers; work of a few seconds stays in this process.

Workers are processes of this machine or of a cluster (engine/cluster.py). Their number, the number
of design points in a task, and results that pass between workers and a run are defined here.
"""

from __future__ import annotations

import atexit
import errno
import math
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial, wraps
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import pyarrow as pa
from threadpoolctl import ThreadpoolController

from squealstudy.engine.design_points import DesignPoints
from squealstudy.errors import MachineError
from squealstudy.extensions import extension_files, start_worker
from squealstudy.machine.processes import cut_lifeline, lifeline, starting_processes
from squealstudy.machine.resources import (
    MOST_WORKERS,
    available_memory_mb,
    cores,
    keep_free_memory,
    peak_memory_mb,
)
from squealstudy.paths import cache_directory
from squealstudy.progress import Progress as Progress
from squealstudy.wording import in_digits, plural

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing.connection import Connection
    from pathlib import Path

    from squealstudy.engine.cluster import Cluster
FIRST_POINTS = 16  # most points of a task before any has been timed
MOST_POINTS = 4096  # most design points of a task, and of a chunk file
TARGET_TASK_S = 2.0  # s, longest duration that a task is given points for
LEAST_SECONDS = 0.1  # s: a shorter task is not worth sending
# the points left are divided into so many tasks for each worker, so that workers end together
TASKS_A_WORKER = 8


@dataclass
class Pace:
    """How many design points a task has: as many as a worker solves in about two seconds.

    Attributes
    ----------
    seconds : float
        Time of a point in the last finished task, s; 0 before any is finished.
    """

    seconds: float = 0.0

    def took(self, points: int, seconds: float) -> None:
        """Record how many seconds a finished task of so many points took."""
        self.seconds = max(seconds, 1e-9) / max(points, 1)

    def size(self, n_points: int, jobs: int) -> int:
        """Number of points in the next task, where `n_points` are left for `jobs` workers."""
        fair = math.ceil(n_points / (TASKS_A_WORKER * jobs))
        if not self.seconds:
            return max(1, min(FIRST_POINTS, fair))
        min_points, max_points = (int(s / self.seconds) for s in (LEAST_SECONDS, TARGET_TASK_S))
        return max(1, min(MOST_POINTS, max_points, max(fair, min_points)))

    def parts(self, points: DesignPoints, jobs: int, min_points: int = 1) -> Iterator[DesignPoints]:
        """Yield parts of the points, each of one structure, with as many as `size` says then.

        They are no smaller than a structure's points divided evenly into parts of `min_points` or
        somewhat less.
        """
        n_left = len(points)
        for _, rows in points.of_structures():
            start, even = 0, math.ceil(len(rows) / math.ceil(len(rows) / min_points))
            while start < len(rows):
                size = min(max(self.size(n_left, jobs), even), len(rows) - start)
                yield points.at(rows[start : start + size])
                start, n_left = start + size, n_left - size


# tasks drawn for each worker: one that it does, the others wait for it
TASKS_IN_FLIGHT_PER_WORKER = 3
TOO_MANY_FILES = (errno.EMFILE, errno.ENFILE)

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")
ArgumentsT = ParamSpec("ArgumentsT")


def silent(stage: str, done: int, total: int, failed: int = 0) -> None:
    """Report no progress."""


def at_once() -> float:
    """Return 0 s: tasks go to worker processes at once."""
    return 0.0


@dataclass(frozen=True)
class Workers:
    """Workers with one BLAS thread each, and the function that reports their progress.

    Attributes
    ----------
    jobs : int
        Number of workers; a single local one is this process itself.
    report : callable
        Called with (stage, done, total, failed).
    seconds_without_workers : callable
        Returns for how many seconds tasks are done in this process before workers are started,
        which takes longer than a small study. Workers of a cluster run already: they get all tasks,
        unless it returns infinity.
    pace : Pace
        Time that design points have taken, which decides how many a task has.
    cluster : Cluster or None
        The cluster that the workers belong to; None: processes of this machine.
    """

    jobs: int = 1
    report: Progress = silent
    seconds_without_workers: Callable[[], float] = at_once
    cluster: Cluster | None = None
    pace: Pace = field(default_factory=Pace, kw_only=True)

    @property
    def at_home(self) -> Workers:
        """Workers of this machine, for tasks that need its files."""
        return self if self.cluster is None else replace(self, jobs=cores(), cluster=None)

    def threads(self, tasks: int) -> int:
        """Threads that each of so many tasks may use: 1, but `jobs` for a single task run here."""
        return self.jobs if tasks == 1 and self.cluster is None else 1

    def each(
        self,
        function: Callable[[TaskT], ResultT],
        tasks: Iterable[TaskT],
        stage: str = "",
        total: int | None = None,
        lost: Callable[[TaskT, str], ResultT] | None = None,
    ) -> Iterator[ResultT]:
        """Yield results of a function of each task, as they come; none is kept here.

        Tasks are drawn when a worker is about to need them: never are more than
        `TASKS_IN_FLIGHT_PER_WORKER` for each worker in memory.

        Parameters
        ----------
        function : callable
        tasks : iterable
        stage : str
            Name under which progress is reported; empty: it is not reported.
        total : int or None
            Number of tasks, for progress, where `tasks` has no length.
        lost : callable or None
            Takes a task that ended every worker of a cluster that tried it, and what happened;
            returns a result for it.

        Raises
        ------
        MachineError
            Where a worker process dies, or none can start. In a cluster: where the scheduler is
            lost, or a task ends every worker and there is no `lost`.
        """
        n_known = len(tasks) if isinstance(tasks, Sized) else 0
        total = n_known if total is None else total
        if stage and total:
            self.report(stage, 0, total)
        for done, answer in enumerate(self._found(function, iter(tasks), lost), start=1):
            if stage:
                self.report(stage, done, max(done, total))
            yield answer

    def _found(
        self,
        function: Callable[[TaskT], ResultT],
        tasks: Iterator[TaskT],
        lost: Callable[[TaskT, str], ResultT] | None,
    ) -> Iterator[ResultT]:
        """Results in the order in which they are ready, from this process or from workers."""
        started, limit_s = time.perf_counter(), self.seconds_without_workers()
        if self.cluster is not None and math.isfinite(limit_s):
            yield from self.cluster.each(function, tasks, lost)
            return
        drawn = list(islice(tasks, 2))
        in_this_process = self.jobs == 1 or len(drawn) == 1
        tasks = chain(drawn, tasks)
        for task in tasks:
            if not in_this_process and time.perf_counter() - started >= limit_s:
                yield from self._on_processes(function, chain((task,), tasks))
                return
            yield _on_one_thread(function, task)

    def _on_processes(
        self, function: Callable[[TaskT], ResultT], tasks: Iterator[TaskT]
    ) -> Iterator[ResultT]:
        """Results of tasks that worker processes of this machine solve."""
        from concurrent.futures import FIRST_COMPLETED, Future, wait
        from concurrent.futures.process import BrokenProcessPool

        with warnings.catch_warnings():  # joblib says what it cannot do where /dev/shm is full
            warnings.simplefilter("ignore")
            from joblib import wrap_non_picklable_objects

        executor = _executor(self.jobs, lifeline(), extension_files(), cache_directory())
        begun: set[Future[ResultT]] = set()

        def begin(number: int) -> None:
            calls = [partial(_on_one_thread, function, task) for task in islice(tasks, number)]
            with starting_processes():  # lambdas too: models have them, and extensions may
                begun.update(executor.submit(wrap_non_picklable_objects(call)) for call in calls)

        try:
            begin(TASKS_IN_FLIGHT_PER_WORKER * self.jobs)
            while begun:
                done = wait(begun, return_when=FIRST_COMPLETED).done
                begun -= done
                while done:
                    begin(1)
                    yield done.pop().result()
        except BrokenProcessPool as error:
            cut_lifeline()
            raise MachineError(
                "a worker process died (out of memory, or killed): give fewer --jobs"
            ) from error
        except BaseException:  # nobody waits for the others any more
            cut_lifeline()
            raise


@lru_cache(maxsize=1)
def _executor(
    jobs: int, line: Connection, files: tuple[Path, ...], _cache: Path
) -> ProcessPoolExecutor:
    """Worker processes, which stay for later tasks because they take long to start.

    Other extensions need new processes, whose kernels know other laws. So does another cache,
    because a process keeps the environment that it was started in.
    """
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    jobs = min(jobs, MOST_WORKERS)
    try:
        with starting_processes():
            return ProcessPoolExecutor(jobs, get_context("spawn"), start_worker, (line, files))
    except OSError as error:
        if error.errno in TOO_MANY_FILES:
            raise
        raise MachineError(
            "worker processes cannot start, for there is no memory for them to share: free "
            "some space in /dev/shm, or give --jobs 1"
        ) from error


atexit.register(_executor.cache_clear)  # its end needs modules, which go after this


@lru_cache(maxsize=1)
def _thread_pools(_modules: frozenset[str]) -> ThreadpoolController:
    """Thread pools of this process; looked up again only where loaded libraries changed."""
    return ThreadpoolController()


def one_thread() -> AbstractContextManager[object]:
    """A context in which BLAS has one thread."""
    return _thread_pools(frozenset(sys.modules)).limit(limits=1)


def on_one_thread(function: Callable[ArgumentsT, ResultT]) -> Callable[ArgumentsT, ResultT]:
    """The function run with one BLAS thread: for small matrices several would be slower."""

    @wraps(function)
    def limited(*args: ArgumentsT.args, **kwargs: ArgumentsT.kwargs) -> ResultT:
        with one_thread():
            return function(*args, **kwargs)

    return limited


def _on_one_thread(function: Callable[[TaskT], ResultT], task: TaskT) -> ResultT:
    keep_free_memory()
    with one_thread():
        return function(task)


@dataclass(frozen=True)
class Solved:
    """Rows and files that a kind of study returns for some design points.

    Attributes
    ----------
    rows : sequence of dict
        One row for each design point, with the columns of the kind's chunk files.
    files : mapping of str -> Table, or mapping of names to arrays
        Contents of Parquet or npz files beside the tables, by path in the results directory.
    known : int
        Number of points whose working point an earlier study had solved.
    table : Table or None
        The rows as a table of the kind's chunk files, in place of `rows`.
    """

    rows: Sequence[dict[str, Any]]
    files: Mapping[str, pa.Table | Mapping[str, Any]] = field(default_factory=dict)
    known: int = 0
    table: pa.Table | None = None


def worker_count(
    jobs: int | None, manifest: Mapping[str, Any] | None, warn: Callable[[str], None]
) -> int:
    """Number of worker processes of a run: `jobs`, or None: as cores and memory allow.

    A worker is assumed to need as much memory as the largest worker of the earlier run with this
    `manifest`, or as this process has taken so far. `warn` is called where memory limits the
    number, or where more workers were asked for.
    """
    peak_memory = (manifest or {}).get("peak_memory_mb", {})
    earlier = float(peak_memory.get("largest_worker", 0.0))
    each, available, allowed = max(earlier, peak_memory_mb()), available_memory_mb(), cores()
    fit = max(1, int(available / each))
    short = f"each needs about {in_digits(each)} MB, and {in_digits(available)} MB are left"
    if jobs is None:
        if fit < allowed:
            warn(f"{plural(fit, 'worker')} on {plural(allowed, 'core')}: {short}")
        return min(allowed, fit)
    if jobs > allowed:
        warn(f"--jobs {jobs}: more workers than the {plural(allowed, 'core')} are no faster")
    if jobs > fit:
        warn(f"--jobs {jobs}: {short}")
    return jobs
