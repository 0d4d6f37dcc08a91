"""Connecting to a scheduler of dask.distributed, and limiting its retries of tasks."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from squealstudy.errors import MachineError

if TYPE_CHECKING:
    from distributed import Client
    from distributed.diagnostics.plugin import SchedulerPlugin

CONNECT_TIMEOUT_S = 10.0
NAME = "squealstudy"
MAX_WORKER_DEATHS_PER_TASK = 2  # after these a task waits until it can run alone
ALONE = "-alone"  # suffix of the keys of tasks that run alone: they fail with the next death


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Silence the log of dask.distributed; errors are told in one sentence."""
    names = [n for n in logging.root.manager.loggerDict if n.partition(".")[0] == "distributed"]
    before = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)


def client_of(scheduler: str) -> Client:
    """A client of a scheduler, which is given by address or file; MachineError without answer."""
    from distributed import Client

    scheduler_file = Path(scheduler)
    if "://" not in scheduler and not scheduler_file.is_file():
        raise MachineError(
            f"{scheduler}: expected the address of a scheduler, tcp://host:8786, or its file"
        )
    by_file: dict[str, Any] = {"scheduler_file": scheduler} if scheduler_file.is_file() else {}
    try:
        return Client(
            **by_file or {"address": scheduler},
            timeout=CONNECT_TIMEOUT_S,
            set_as_default=False,
            name=NAME,
        )
    except (OSError, ValueError, KeyError) as error:
        raise MachineError(f"{scheduler}: no scheduler answers there ({error})") from error


@contextlib.contextmanager
def retries_limited(client: Client, run: str) -> Iterator[None]:
    """Let tasks whose keys begin with `run` fail after MAX_WORKER_DEATHS_PER_TASK worker deaths.

    Those whose keys end with ALONE fail with the first death. dask's own limit (`allowed-failures`,
    3 by default) is the same for the tasks of all clients. So these tasks start with a count of
    deaths above zero.
    """
    client.register_plugin(_suspicion(run, MAX_WORKER_DEATHS_PER_TASK, ALONE), name=run)
    try:
        yield
    finally:
        with contextlib.suppress(Exception):  # of a scheduler that is gone
            client.unregister_scheduler_plugin(run)


def _suspicion(run: str, deaths: int, alone: str) -> SchedulerPlugin:
    """A plugin that starts the count of deaths of tasks whose keys begin with `run` above zero.

    Its class is local, so that its code is sent and the scheduler does not need this package.
    """
    from distributed.diagnostics.plugin import SchedulerPlugin

    class Suspicion(SchedulerPlugin):  # type: ignore[misc]
        def update_graph(self, scheduler: Any, *, tasks: list[str], **_: Any) -> None:
            for key in tasks:
                if str(key).startswith(run):
                    deaths_left = 1 if str(key).endswith(alone) else deaths
                    begin = max(0, scheduler.allowed_failures + 1 - deaths_left)
                    task = scheduler.tasks[key]
                    task.suspicious = max(task.suspicious, begin)

    return Suspicion()
