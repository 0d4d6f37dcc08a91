"""Tasks on parallel worker processes; those of a few seconds in this one."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from squealstudy.errors import SquealstudyError

MAX_CHUNK = 16  # points: what a kill can lose at most, per worker
CHUNKS_A_WORKER = 8
Item = TypeVar("Item")


Call = tuple[Callable[..., Any], *tuple[Any, ...]]  # a function and its arguments


def in_parallel(jobs: int, calls: Sequence[Call], patience: float = 0.0) -> Iterator[Any]:
    """Results of calls as they come, on loky workers with one BLAS thread each.

    Parameters
    ----------
    jobs : int
        Worker processes.
    calls : sequence of (function, *arguments)
    patience : float
        Seconds for which calls are made in this process: a worker takes longer to start than a
        small study to run.

    Raises
    ------
    SquealstudyError
        Where a worker process dies.
    """
    started = time.perf_counter()
    done = 0
    while done < len(calls) and (jobs == 1 or time.perf_counter() - started < patience):
        function, *arguments = calls[done]
        done += 1
        yield function(*arguments)
    if done < len(calls):
        yield from _on_workers(min(jobs, len(calls) - done), calls[done:])


def _on_workers(workers: int, calls: Sequence[Call]) -> Iterator[Any]:
    from concurrent.futures.process import BrokenProcessPool

    from joblib import Parallel, delayed, parallel_config

    tasks = [delayed(function)(*arguments) for function, *arguments in calls]
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


def split_chunks(tasks: Sequence[Item], jobs: int) -> list[Sequence[Item]]:
    """Consecutive points in chunks small enough to balance the workers and to lose little."""
    size = max(1, min(MAX_CHUNK, math.ceil(len(tasks) / (CHUNKS_A_WORKER * jobs))))
    return [tasks[i : i + size] for i in range(0, len(tasks), size)]
