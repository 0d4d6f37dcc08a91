"""A scheduler and workers of dask.distributed on this machine, each a process of its own."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import psutil

import squealstudy

GIVEN = filter(None, [os.environ.get("PYTHONPATH")])
OWN = map(str, (Path(squealstudy.__file__).parents[1], Path(__file__).parent))
MODULES = os.pathsep.join([*GIVEN, *OWN])
LONGEST = 60.0  # s, on a machine in use
SCHEDULER = "from distributed.cli.dask_scheduler import main; main()"
WORKER = "from distributed.cli.dask_worker import main; main()"


class Loopback:
    """A cluster that shares nothing with the tests but the loopback device.

    Workers have one thread, and a cache each. All ends with `close`, and without it soon after the
    tests, once the scheduler has been `idle` for long.
    """

    def __init__(self, folder: Path, idle: str = "600s") -> None:
        from distributed import Client

        self.folder = folder
        self._processes: list[subprocess.Popen] = []
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        self.file = folder / "scheduler.json"
        options = ["--host", "127.0.0.1", "--port", str(port), "--idle-timeout", idle]
        options += ["--scheduler-file", str(self.file), "--no-dashboard"]
        self.scheduler = self._start("scheduler", SCHEDULER, *options)
        deadline = time.monotonic() + LONGEST
        while not self.file.exists():
            assert time.monotonic() < deadline
            assert self.scheduler.poll() is None
            time.sleep(0.05)
        self.client = Client(self.address, set_as_default=False, timeout=LONGEST)

    def _start(self, name: str, code: str, *options: str, **environment: str) -> subprocess.Popen:
        with (self.folder / f"{name}.log").open("w") as log:
            process = subprocess.Popen(
                [sys.executable, "-c", code, *options],
                stdout=log,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                env=os.environ | {"PYTHONPATH": MODULES} | environment,
            )
        self._processes.append(process)
        return process

    def cache(self, name: str) -> Path:
        """The cache of a worker."""
        return self.folder / f"cache-{name}"

    def add(self, *names: str, nanny: bool = False, threads: int = 1, before: str = "") -> None:
        """Start workers and wait for them; `before` is Python that they execute first."""
        expected = len(self.client.nthreads()) + len(names)
        for name in names:
            options = [self.address, "--name", name, "--nthreads", str(threads)]
            options += ["--nanny" if nanny else "--no-nanny", "--no-dashboard"]
            options += ["--death-timeout", "20s", "--memory-limit", "2GB"]
            options += ["--local-directory", str(self.folder / f"local-{name}")]
            given = {"SQUEALSTUDY_CACHE": str(self.cache(name))}
            self._start(name, f"{before}\n{WORKER}", *options, **given)
        self.client.wait_for_workers(expected, timeout=LONGEST)

    def workers(self) -> list[int]:
        """Process numbers of the workers."""
        return list(self.client.run(os.getpid).values())

    def kill_worker(self, index: int = -1) -> None:
        """As the kernel does where memory runs out; until the scheduler knows."""
        expected = len(self.client.nthreads()) - 1
        self._processes[index].kill()
        while len(self.client.nthreads()) > expected:
            time.sleep(0.05)

    def kill_scheduler(self) -> None:
        """At once."""
        self.scheduler.kill()

    def left(self) -> list[str]:
        """Tasks of squealstudy that the scheduler knows of."""

        def keys(dask_scheduler):
            return [str(key) for key in dask_scheduler.tasks]

        found = self.client.run_on_scheduler(keys)
        return [key for key in found if key.startswith("squealstudy")]

    def close(self) -> None:
        """End all processes, whatever state they are in."""
        try:
            self.client.close(timeout=1)
        finally:
            for process in self._processes:
                try:
                    found = [*psutil.Process(process.pid).children(recursive=True)]
                except psutil.NoSuchProcess:
                    found = []
                for one in (process, *found):
                    try:
                        os.kill(one.pid, signal.SIGKILL)
                    except ProcessLookupError:
                        continue
                process.wait()
