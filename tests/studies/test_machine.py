"""What depends on the machine: locks, cores and memory within limits."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

from squealstudy.engine import workers
from squealstudy.engine.manifest import locked
from squealstudy.errors import MachineError, ResultsError
from squealstudy.machine import resources as machine
from squealstudy.machine.processes import InterruptedRun, interruptible

GIVE_BACK = """
import numpy as np
import psutil
from squealstudy.machine.resources import give_back_memory
resident = lambda: psutil.Process().memory_info().rss / 2**20
parts = [np.ones(12_000) for _ in range(2000)]  # each too small to be mapped by itself
last = parts[-1]
parts.clear()
held = resident()
give_back_memory()
print(held - resident())
"""
KEEP = """
import resource
import numpy as np
from squealstudy.engine.workers import Workers

def point(number):
    faults = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    np.ones(100)
    at_first = faults()
    for _ in range(20):
        parts = [np.ones(250_000) for _ in range(8)]  # 16 MB
        del parts
    return faults() - at_first

print(*Workers(1).each(point, [0, 1]))
"""
HOLD = """
import sys
import time
from pathlib import Path
from squealstudy.machine.locks import lock
with lock(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.mark.skipif(not machine.STATUS.is_file(), reason="Linux alone")
def test_free_memory_goes_back_below_what_is_in_use():
    if not hasattr(machine.ctypes.CDLL(None), "malloc_trim"):
        pytest.skip("the C library cannot")
    done = subprocess.run(
        [sys.executable, "-c", GIVE_BACK], check=True, capture_output=True, text=True
    )
    assert float(done.stdout) > 150  # of 192 MB


def test_arrays_are_mapped_one_by_one_within_alone(monkeypatch):
    """What that saves is measured: 150 MB beside a reduction of the coarse brake."""
    asked = []
    monkeypatch.setattr(machine, "_of_glibc", lambda *call: asked.append(call))
    with pytest.raises(ZeroDivisionError), machine.memory_returned():  # noqa: PT012 - as of failures
        assert asked == [("mallopt", -3, 2**20)]
        1 / 0  # noqa: B018
    assert asked[1:] == [("mallopt", -3, 2**25), ("malloc_trim", 0)]


@pytest.mark.skipif(not machine.STATUS.is_file(), reason="Linux alone")
def test_what_a_task_frees_serves_the_next_arrays():
    """Else each of 20 turns would take some 4,000 pages anew."""
    if not hasattr(machine.ctypes.CDLL(None), "mallopt"):
        pytest.skip("the C library cannot")
    done = subprocess.run([sys.executable, "-c", KEEP], check=True, capture_output=True, text=True)
    first, second = map(int, done.stdout.split())
    assert first < 20_000
    assert second < 2_000


def test_a_lock_dies_with_its_process(tmp_path):
    path = tmp_path / ".lock"
    command = [sys.executable, "-c", HOLD, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout.readline().strip() == b"held"
        with (
            pytest.raises(ResultsError, match="another run is writing here"),
            locked(tmp_path),
        ):
            pass
        holder.kill()
        holder.wait()
        with locked(tmp_path):
            pass


@pytest.mark.parametrize("code", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_without_locks_is_named(tmp_path, monkeypatch, code):
    """As on a network disk whose server has none; a lock that outlives its process is no help."""
    fcntl = pytest.importorskip("fcntl")

    def none(*_):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(fcntl, "flock", none)
    with pytest.raises(MachineError, match="cannot lock files") as found, locked(tmp_path):
        pass
    assert str(tmp_path) in str(found.value)


@pytest.fixture
def groups(tmp_path, monkeypatch):
    """Writes control groups: `groups("0::/a/b", {"a/cpu.max": "50000 100000"})`."""
    monkeypatch.setattr(machine, "GROUPS", tmp_path)
    monkeypatch.setattr(machine, "OWN_GROUPS", tmp_path / "own")
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    process = SimpleNamespace(cpu_affinity=lambda: list(range(64)))
    monkeypatch.setattr(machine.psutil, "Process", lambda: process)
    free = SimpleNamespace(available=64 * 2**30)
    monkeypatch.setattr(machine.psutil, "virtual_memory", lambda: free)

    def write(own, files):
        (tmp_path / "own").write_text(own + "\n")
        for name, text in files.items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text + "\n")

    return write


@pytest.mark.parametrize(
    ("own", "files", "cores"),
    [
        ("0::/", {}, 64),
        ("0::/", {"cpu.max": "max 100000"}, 64),
        ("0::/", {"cpu.max": "150000 100000"}, 2),
        ("0::/", {"cpu.max": "10000 100000"}, 1),
        ("0::/user/run", {"user/cpu.max": "300000 100000", "user/run/cpu.max": "max 100000"}, 3),
        (
            "4:cpu,cpuacct:/docker/x",  # not there: the container sees its own group as the top
            {"cpu/cpu.cfs_quota_us": "400000", "cpu/cpu.cfs_period_us": "100000"},
            4,
        ),
        (
            "4:cpu,cpuacct:/",
            {"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"},
            64,
        ),
    ],
)
def test_cores_are_those_of_the_control_groups(groups, own, files, cores):
    groups(own, files)
    assert machine.cores() == cores


def test_cores_are_those_of_the_affinity(groups, monkeypatch):
    groups("0::/", {"cpu.max": "800000 100000"})
    process = SimpleNamespace(cpu_affinity=lambda: [3, 5])
    monkeypatch.setattr(machine.psutil, "Process", lambda: process)
    assert machine.cores() == 2


@pytest.mark.parametrize(
    ("own", "files", "megabytes"),
    [
        ("0::/", {}, 65536),
        ("0::/", {"memory.max": "max"}, 65536),
        (
            "0::/a",
            {
                "a/memory.max": str(1000 * 2**20),
                "a/memory.current": str(700 * 2**20),
                "a/memory.stat": f"anon 5\ninactive_file {200 * 2**20}",
            },
            500,
        ),
        (
            "7:memory:/job",
            {
                "memory/job/memory.limit_in_bytes": str(2**63 - 4096),
                "memory/memory.limit_in_bytes": str(300 * 2**20),
                "memory/memory.usage_in_bytes": str(400 * 2**20),
            },
            0,
        ),
    ],
)
def test_available_memory_is_what_the_control_groups_leave(groups, own, files, megabytes):
    groups(own, files)
    assert machine.available_memory_mb() == megabytes


@pytest.mark.parametrize(
    ("jobs", "cores", "available", "count", "text"),
    [
        (None, 4, 4000.0, 4, ""),
        (None, 4, 1100.0, 2, "2 workers on 4 cores: each needs about 500 MB, and 1100 MB are left"),
        (None, 4, 100.0, 1, "1 worker on 4 cores"),
        (4, 4, 4000.0, 4, ""),
        (8, 4, 8000.0, 8, "--jobs 8: more workers than the 4 cores are no faster"),
        (4, 4, 1100.0, 4, "--jobs 4: each needs about 500 MB, and 1100 MB are left"),
    ],
)
def test_workers_are_as_many_as_cores_and_memory_allow(
    monkeypatch, jobs, cores, available, count, text
):
    earlier = {"peak_memory_mb": {"largest_worker": 500.0}}
    monkeypatch.setattr(workers, "cores", lambda: cores)
    monkeypatch.setattr(workers, "available_memory_mb", lambda: available)
    monkeypatch.setattr(workers, "peak_memory_mb", lambda: 100.0)
    told = []
    assert workers.worker_count(jobs, earlier, told.append) == count
    assert len(told) == bool(text)
    assert not text or text in told[0]


class _Finalised:
    """Signals this process as it is removed, where an exception is dropped."""

    def __init__(self, number: int) -> None:
        self.number = number

    def __del__(self) -> None:
        os.kill(os.getpid(), self.number)
        time.sleep(0.2)


@pytest.mark.skipif(os.name == "nt", reason="a signal ends the process there")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_during_a_finaliser_ends_the_run_without_a_traceback(number, capfd, request):
    own = signal.signal(number, signal.default_int_handler)  # a background job ignores SIGINT
    request.addfinalizer(lambda: signal.signal(number, own))
    before = sys.unraisablehook
    with pytest.raises(InterruptedRun) as told, interruptible():  # noqa: PT012
        end = _Finalised(number)
        del end
        time.sleep(5.0)
        pytest.fail("the signal was dropped")
    assert told.value.exit_code == 128 + number
    assert capfd.readouterr().err == ""
    assert sys.unraisablehook is before


def test_other_exceptions_that_python_drops_are_told_as_before(monkeypatch):
    class Broken:
        def __del__(self) -> None:
            raise ValueError("in a finaliser")

    found = []
    monkeypatch.setattr(sys, "unraisablehook", lambda what: found.append(what.exc_value))
    with interruptible():
        Broken()
    assert [str(error) for error in found] == ["in a finaliser"]
