"""The one place that hands tasks to workers; work of a few seconds stays in this process.

Workers are processes of this machine or those of a cluster (engine/cluster.py). How many there are,
how many design points a task has, and what passes between a run and its workers.
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
FIRST_POINTS = 16  # points of a task while nothing is known of their time
MOST_POINTS = 4096  # design points of a task, and of a chunk file
TARGET_TASK_S = 2.0  # duration of a task that is aimed at
LEAST_SECONDS = 0.1  # a shorter task is not worth sending
TASKS_A_WORKER = 8  # tasks of the points that remain: so workers end together


@dataclass
class Pace:
    """How many design points a task has: as many as a worker solves in about two seconds.

    Attributes
    ----------
    seconds : float
        Of a point in the last finished task; 0 where none is.
    """

    seconds: float = 0.0

    def took(self, points: int, seconds: float) -> None:
        """Learn from a finished task."""
        self.seconds = max(seconds, 1e-9) / max(points, 1)

    def size(self, n_points: int, jobs: int) -> int:
        """Points of the next task, where so many are left for so many workers."""
        fair = math.ceil(n_points / (TASKS_A_WORKER * jobs))
        if not self.seconds:
            return max(1, min(FIRST_POINTS, fair))
        min_points, max_points = (int(s / self.seconds) for s in (LEAST_SECONDS, TARGET_TASK_S))
        return max(1, min(MOST_POINTS, max_points, max(fair, min_points)))

    def parts(self, points: DesignPoints, jobs: int, min_points: int = 1) -> Iterator[DesignPoints]:
        """Consecutive points of one structure each, as many at a time as `size` says then.

        Where that is less than `min_points`, nearly so many, of even parts.
        """
        n_left = len(points)
        for _, rows in points.of_structures():
            start, even = 0, math.ceil(len(rows) / math.ceil(len(rows) / min_points))
            while start < len(rows):
                size = min(max(self.size(n_left, jobs), even), len(rows) - start)
                yield points.at(rows[start : start + size])
                start, n_left = start + size, n_left - size


# tasks a worker that are drawn: one at work, others wait for it to be free
TASKS_IN_FLIGHT_PER_WORKER = 3
TOO_MANY_FILES = (errno.EMFILE, errno.ENFILE)

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")
ArgumentsT = ParamSpec("ArgumentsT")


def silent(stage: str, done: int, total: int, failed: int = 0) -> None:
    """Progress that nobody is told of."""


def at_once() -> float:
    """No seconds: tasks go to worker processes at once."""
    return 0.0


@dataclass(frozen=True)
class Workers:
    """Workers, one BLAS thread each, and who is told how far they are.

    Attributes
    ----------
    jobs : int
        How many; with one local one all is done in this process.
    report : callable
        Told (stage, done, total, failed).
    seconds_without_workers : callable
        Seconds for which tasks are done in this process: a worker takes longer to start than a
        small study to run. Workers of a cluster have started: they get all tasks, unless it is
        infinite.
    pace : Pace
        What design points have taken, by which tasks are cut.
    cluster : Cluster or None
        Whose workers they are; None for processes of this machine.
    """

    jobs: int = 1
    report: Progress = silent
    seconds_without_workers: Callable[[], float] = at_once
    cluster: Cluster | None = None
    pace: Pace = field(default_factory=Pace, kw_only=True)

    @property
    def at_home(self) -> Workers:
        """Workers of this machine, for what needs its files."""
        return self if self.cluster is None else replace(self, jobs=cores(), cluster=None)

    def threads(self, tasks: int) -> int:
        """Threads that each of so many tasks may use: of a single one all, where it runs here."""
        return self.jobs if tasks == 1 and self.cluster is None else 1

    def each(
        self,
        function: Callable[[TaskT], ResultT],
        tasks: Iterable[TaskT],
        stage: str = "",
        total: int | None = None,
        lost: Callable[[TaskT, str], ResultT] | None = None,
    ) -> Iterator[ResultT]:
        """Results of a function of each task, as they come; none is kept here.

        Tasks are drawn when a worker is about to need them: of a long iterable never more than
        `TASKS_IN_FLIGHT_PER_WORKER` a worker are there at once.

        Parameters
        ----------
        function : callable
        tasks : iterable
        stage : str
            Name under which progress is told; none without.
        total : int or None
            Number of tasks, for progress, where `tasks` has no length.
        lost : callable or None
            Makes the result of a task that ended every worker of a cluster that tried it, of the
            task and of what happened.

        Raises
        ------
        MachineError
            Where a worker process dies, or none can start; in a cluster where the scheduler is
            lost, or such a task has no result.
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
    """Processes that stay for the next tasks: they take longer to start than most tasks.

    With other extensions others start, whose kernels know other laws; with another cache as well,
    for processes have the environment in which they start.
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


atexit.register(_executor.cache_clear)  # while modules are there, which it looks up at its end


@lru_cache(maxsize=1)
def _thread_pools(_modules: frozenset[str]) -> ThreadpoolController:
    """Thread pools of this process; looked up again only where loaded libraries changed."""
    return ThreadpoolController()


def one_thread() -> AbstractContextManager[object]:
    """With one thread of BLAS."""
    return _thread_pools(frozenset(sys.modules)).limit(limits=1)


def on_one_thread(function: Callable[ArgumentsT, ResultT]) -> Callable[ArgumentsT, ResultT]:
    """The function with one thread of BLAS: for small matrices more of them wait for each other."""

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
        One a design point, with the columns of the kind's chunk files.
    files : mapping of str -> Table, or mapping of names to arrays
        What belongs beside the tables, by its path in the results directory: Parquet or npz.
    known : int
        Points whose working point an earlier study had found.
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
    """Worker processes of a run: as many as were asked for, else as cores and memory allow.

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
