"""A cluster of dask.distributed that does tasks instead of local processes.

Only this process writes results. Models whose keys a task names are sent to the workers; files that
a task adds to a worker's cache come back with its result (engine/cluster_worker.py).
"""

from __future__ import annotations

import contextlib
import io
import pickle
import queue
import re
import time
import warnings
from asyncio import CancelledError
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any, TypeVar
from uuid import uuid4

import numpy as np

from squealstudy.engine import cluster_worker
from squealstudy.engine.cache import contents, folders_of, keep_contents, prepared_path
from squealstudy.engine.cluster_scheduler import ALONE, client_of, quiet, retries_limited
from squealstudy.engine.cluster_worker import (
    SAME_VERSIONS_ADVICE,
    Answer,
    Setting,
    answer,
    difference,
    in_cache,
    shared_value,
)
from squealstudy.engine.keys import HASH_DIGITS
from squealstudy.errors import MachineError
from squealstudy.extensions import extension_files, sources_of
from squealstudy.paths import cache_directory
from squealstudy.wording import plural

if TYPE_CHECKING:
    from distributed import Client, Future

# tasks that each worker has at a time: it does one, the others wait there
TASKS_IN_FLIGHT_PER_WORKER = 3
CLOSE_TIMEOUT_S = 2.0  # s, longest wait for a scheduler's answer when closing
POLL_INTERVAL_S = 2.0  # s, least time between counts of the workers, longest wait for a task
ALL_DIED = "every worker that tried it died"
MAX_MODELS_SENT = 8  # most models that the scheduler stores, not counting those of waiting tasks
KEY = re.compile(rb"[0-9a-f]{%d,}" % HASH_DIGITS)

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")
ResultOfLost = Callable[[Any, str], Any]


@dataclass(frozen=True)
class Worker:
    """A worker: its address, number of threads, and the facts of `cluster_worker.facts`."""

    address: str
    threads: int
    versions: Mapping[str, str]
    limit_mb: float
    used_mb: float


class _DiedError(Exception):
    """A task ended every worker that tried it."""


@dataclass
class _SentModel:
    """A model that was sent: names of its folders in the cache here, and of those sent so far."""

    names_here: set[str] = field(default_factory=set)
    names_sent: set[str] = field(default_factory=set)
    parcels: list[Future] = field(default_factory=list)


class Cluster:
    """Workers behind a scheduler, for one run.

    Parameters
    ----------
    client : distributed.Client
    warn : callable
        Called with a message where there is no worker.

    Attributes
    ----------
    members : list of Worker
        Workers that the cluster had when the run began.
    run : str
        Prefix of the keys of its tasks.
    """

    def __init__(self, client: Client, warn: Callable[[str], None]) -> None:
        self.client, self.warn = client, warn
        self.members: list[Worker] = []
        self.run, self._count = f"squealstudy-{uuid4().hex[:8]}", 0
        self._n_workers, self._counted_at_s = 0, -np.inf
        self._models: dict[str, _SentModel] = {}
        self._present: set[str] = set()  # keys of models in the cache when tasks began
        self._looked_up: set[str] = set()  # of those, keys of models that tasks have needed since
        self._setting: tuple[Setting, Future] | None = None
        self._shared: Future = None

    @property
    def name(self) -> str:
        """Address of the scheduler."""
        return str(self.client.scheduler.address) if self.client.scheduler else "the scheduler"

    @property
    def size(self) -> int:
        """Number of workers, counted at most every POLL_INTERVAL_S; 1 where there is none."""
        if time.monotonic() - self._counted_at_s > POLL_INTERVAL_S:
            before, self._n_workers = self._n_workers, len(self._threads())
            self._counted_at_s = time.monotonic()
            if before and not self._n_workers:
                self.warn(f"{self.name}: no worker is left; waiting for others")
        return max(1, self._n_workers)

    def _threads(self) -> dict[str, int]:
        """Number of threads by worker's address; MachineError where no scheduler answers."""
        try:
            return dict(self.client.nthreads())
        except Exception as error:
            raise self._lost_scheduler() from error

    def _lost_scheduler(self) -> MachineError:
        return MachineError(f"{self.name}: the scheduler does not answer any more")

    def workers(self) -> list[Worker]:
        """Wait for a worker, then return all of them; MachineError where one cannot be used."""
        threads = self._threads()
        if not threads:
            self.warn(f"{self.name}: no worker yet; waiting for one")
        while not threads:
            time.sleep(0.2)
            threads = self._threads()
        facts_of = self.client.run(cluster_worker.facts, on_error="return")
        for address, facts in facts_of.items():
            if isinstance(facts, Exception):
                raise MachineError(
                    f"worker {address} cannot be used ({type(facts).__name__}: {facts}): "
                    f"{SAME_VERSIONS_ADVICE}"
                )
            if text := difference(cluster_worker.versions(), facts["versions"]):
                raise MachineError(f"worker {address} has {text}: {SAME_VERSIONS_ADVICE}")
        several = [n for n in threads.values() if n > 1]
        if several:
            self.warn(
                f"{plural(len(several), 'worker')} of {len(threads)} have several threads, of "
                "which one is used: start more workers of one thread each (--nthreads 1)"
            )
        return [Worker(a, threads.get(a, 1), **facts) for a, facts in sorted(facts_of.items())]

    # -- tasks -----------------------------------------------------------------------------------
    def each(
        self,
        function: Callable[[TaskT], ResultT],
        tasks: Iterator[TaskT],
        lost: ResultOfLost | None,
    ) -> Iterator[ResultT]:
        """Yield results of a function of each task, as they come; see `Workers.each`.

        Raises
        ------
        MachineError
            Where the scheduler is lost; where a task ends every worker that tries it and `lost`
            makes no result of it.
        """
        task_of: dict[Future, TaskT] = {}
        ended: queue.SimpleQueue[Future] = queue.SimpleQueue()
        suspects: list[TaskT] = []
        models = prepared_path("")
        self._present = {p.name for p in models.iterdir()} if models.is_dir() else set()
        self._looked_up.clear()
        self._shared = self._sent_setting()

        def begin(some: Iterator[TaskT], most: int, kind: str = "") -> None:
            for task in islice(some, max(0, most - len(task_of))):
                future = self._submit(function, task, kind)
                task_of[future] = task
                future.add_done_callback(ended.put)

        try:
            begin(tasks, TASKS_IN_FLIGHT_PER_WORKER * self.size)
            while task_of:
                if (future := self._next(ended)) is None:
                    begin(tasks, TASKS_IN_FLIGHT_PER_WORKER * self.size)  # workers may have come
                    continue
                try:
                    task_result = self._result(future)
                except _DiedError:
                    suspects.append(task_of[future])
                    self._cancel([future])
                    del task_of[future]
                    begin(tasks, TASKS_IN_FLIGHT_PER_WORKER * self.size)
                    continue
                del task_of[future], future
                begin(tasks, TASKS_IN_FLIGHT_PER_WORKER * self.size)
                yield task_result
            for task in suspects:  # most died only because they ran beside the one that kills
                begin(iter([task]), 1, ALONE)
                (future,) = task_of
                try:
                    while self._next(ended) is not future:
                        pass
                    task_result = self._result(future)
                except _DiedError as error:
                    if lost is None:
                        raise MachineError(str(error)) from None
                    task_result = lost(task, str(error))
                self._cancel([future])  # a kept traceback may keep this frame and its future
                task_of.clear()
                del future
                yield task_result
        finally:
            if task_of:
                self._cancel([*task_of])

    def _next(self, ended: queue.SimpleQueue[Future]) -> Future | None:
        """The next task that has ended; None where none has within POLL_INTERVAL_S."""
        try:
            return ended.get(timeout=POLL_INTERVAL_S)
        except queue.Empty:
            if self.client.status != "running":
                raise self._lost_scheduler() from None
            return None

    def _result(self, future: Future) -> Any:
        """The result of a task; _DiedError where every worker that tried it died."""
        from distributed import KilledWorker

        try:
            answer: Answer = future.result()
        except KilledWorker as error:
            last = getattr(error.last_worker, "address", "")
            raise _DiedError(f"{ALL_DIED}, the last at {last}: out of memory, or killed") from error
        except (Exception, CancelledError) as error:
            if self.client.status != "running":
                raise self._lost_scheduler() from error
            if isinstance(error, CancelledError):
                text = f"{self.name}: tasks of this run were cancelled there"
                raise MachineError(text) from error
            raise
        for name, files in answer.cached_files.items():
            keep_contents(prepared_path(name), files)
            self._models.setdefault(name.partition("/")[0], _SentModel()).names_here.add(name)
        return answer.task_result

    def _cancel(self, futures: list[Future]) -> None:
        with contextlib.suppress(Exception):  # where the scheduler is gone, so are the tasks
            self.client.cancel(futures)

    def release(self) -> None:
        """Release what was sent, so that the scheduler drops it."""
        self._models.clear()
        self._setting = self._shared = None

    # -- what is sent with tasks -----------------------------------------------------------------
    def _submit(self, function: Callable[[TaskT], ResultT], task: TaskT, kind: str = "") -> Future:
        call = _pickled((function, task))
        models = [self._model(key) for key in _keys(call) & self._present]
        cached_keys = frozenset().union(*(model.names_here for model in models))
        parcels = [parcel for model in models for parcel in model.parcels]
        return self._send(answer, self._shared, parcels, cached_keys, call, kind=kind)

    def _sent_setting(self) -> Future:
        """The `Setting` of all tasks, sent anew where extensions were added."""
        sources = [sources_of(path) for path in extension_files()]
        setting = Setting(cluster_worker.versions(), sources)
        if self._setting is None or self._setting[0] != setting:
            self._setting = setting, self._send(shared_value, setting)
        return self._setting[1]

    def _model(self, key: str) -> _SentModel:
        """A model that a task names; those of its folders that were not sent yet are sent now."""
        model = self._models.pop(key, None) or _SentModel()
        self._models[key] = model
        if key not in self._looked_up:
            self._looked_up.add(key)
            top = prepared_path("")
            folders = {p.relative_to(top).as_posix(): p for p in folders_of(key)}
            if new := {n: contents(p) for n, p in folders.items() if n not in model.names_sent}:
                model.parcels.append(self._send(shared_value, new))
            model.names_sent |= folders.keys()
            model.names_here |= folders.keys()
        while len(self._models) > MAX_MODELS_SENT:
            del self._models[next(iter(self._models))]
        return model

    def _send(self, function: Callable[..., Any], *arguments: Any, kind: str = "") -> Future:
        self._count += 1
        key = f"{self.run}-{self._count}{kind}"
        with warnings.catch_warnings():  # about large arguments, which is intended
            warnings.simplefilter("ignore", UserWarning)
            return self.client.submit(function, *arguments, key=key, pure=False)


def _keys(call: bytes) -> set[str]:
    """All texts in a pickle that look like keys, in strings or in arrays of strings."""
    keys: set[str] = set()
    for run in KEY.findall(call.replace(b"\0", b"")):
        keys.update(run[i : i + HASH_DIGITS].decode() for i in range(len(run) - HASH_DIGITS + 1))
    return keys


def _pickled(call: Any) -> bytes:
    """A pickle whose paths in this cache become paths in the cache of the process that reads it."""
    import cloudpickle

    base = cache_directory()

    class Pickler(cloudpickle.Pickler):  # type: ignore[misc]
        def reducer_override(self, value: Any) -> Any:
            if isinstance(value, PurePath) and value.is_relative_to(base):
                return in_cache, (value.relative_to(base).as_posix(),)
            return super().reducer_override(value)

    file = io.BytesIO()
    Pickler(file, protocol=pickle.HIGHEST_PROTOCOL).dump(call)
    return file.getvalue()


@contextlib.contextmanager
def connected(client: Client | str | Path, warn: Callable[[str], None]) -> Iterator[Cluster]:
    """Connect to the cluster of a client, or of a scheduler by its address or its file.

    It has at least one worker, and all have the versions of this process.

    Raises
    ------
    MachineError
        Where dask.distributed is missing, no scheduler answers, or a worker has other versions.
    """
    try:
        import distributed
    except ImportError:
        raise MachineError(
            "a scheduler needs dask.distributed: pip install 'squealstudy[cluster]'"
        ) from None
    if isinstance(client, distributed.Client):
        with _checked(client, warn) as cluster:
            yield cluster
        return
    with quiet():
        own_client = client_of(str(client))
        try:
            with _checked(own_client, warn) as cluster:
                yield cluster
        finally:
            with contextlib.suppress(Exception):  # the scheduler may be gone
                own_client.close(timeout=CLOSE_TIMEOUT_S)


@contextlib.contextmanager
def _checked(client: Client, warn: Callable[[str], None]) -> Iterator[Cluster]:
    """The cluster with its workers, released when the block ends."""
    cluster = Cluster(client, warn)
    cluster.members = cluster.workers()
    try:
        with retries_limited(client, cluster.run):
            yield cluster
    finally:
        cluster.release()
