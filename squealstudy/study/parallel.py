"""Tasks on parallel worker processes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from joblib import Parallel, parallel_config

from squealstudy.errors import SquealstudyError

MAX_CHUNK = 16  # points: what a kill can lose at most, per worker
CHUNKS_A_WORKER = 8
Item = TypeVar("Item")


def in_parallel(jobs: int, tasks: Sequence[Any]) -> Iterator[Any]:
    """Results of delayed tasks as they come, on loky workers with one BLAS thread each."""
    if not tasks:
        return
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


def split_chunks(tasks: Sequence[Item], jobs: int) -> list[Sequence[Item]]:
    """Consecutive points in chunks small enough to balance the workers and to lose little."""
    size = max(1, min(MAX_CHUNK, math.ceil(len(tasks) / (CHUNKS_A_WORKER * jobs))))
    return [tasks[i : i + size] for i in range(0, len(tasks), size)]
