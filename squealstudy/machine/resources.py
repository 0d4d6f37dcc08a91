"""Cores and memory that this process may use.

A container, a control group or a processor affinity may limit it to a part of the machine.
"""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil

BYTES_PER_MB = 2**20
# Python can wait for 61 processes on Windows
MOST_WORKERS = 61 if sys.platform == "win32" else 2**16
# files that only Linux has
STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")
GROUPS, OWN_GROUPS = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3  # numbers of these settings in <malloc.h>
# bytes from which glibc maps an array by itself: within `memory_returned`; else, its own maximum
MMAP_THRESHOLD_BYTES, MAPPED_LATER = 2**20, 2**25
KEPT_FREE = 2**28  # bytes of free memory that the process keeps


# -- cores ----------------------------------------------------------------------------------------
def cores() -> int:
    """Number of cores that this process may use, by the machine, affinity and control groups."""
    process = psutil.Process()
    allowed = len(process.cpu_affinity()) if hasattr(process, "cpu_affinity") else os.cpu_count()
    return max(1, min([allowed or 1, *_quotas()]))


def _quotas() -> Iterator[int]:
    """Number of cores that each control group with a limit allows, rounded up."""
    for group in _groups("cpu"):
        quota_text = _first(group, "cpu.max") or " ".join(
            (_first(group, "cpu.cfs_quota_us"), _first(group, "cpu.cfs_period_us"))
        )
        quota, _, period = quota_text.partition(" ")
        if quota.isdigit() and period.isdigit():  # else "max", -1 or nothing: no limit
            yield math.ceil(int(quota) / int(period))


def _groups(controller: str) -> Iterator[Path]:
    """Directories of the control groups of this process, and of their parents."""
    for line in _read(OWN_GROUPS).splitlines():
        _, controllers, name = line.split(":", 2)
        if controllers and controller not in controllers.split(","):
            continue
        top = GROUPS / controller if controllers else GROUPS  # of version 1, of version 2
        group = top / name.lstrip("/")
        yield from (group, *(p for p in group.parents if p.is_relative_to(top)))


def _first(group: Path, name: str) -> str:
    return _read(group / name).strip()


def _read(path: Path) -> str:
    """A file of the kernel; empty where there is none."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError:
        return ""


# -- memory ---------------------------------------------------------------------------------------
def available_memory_mb() -> float:
    """Memory [MB] that processes may still take without swapping or being killed."""
    return min([psutil.virtual_memory().available, *_remaining_bytes()]) / BYTES_PER_MB


def _remaining_bytes() -> Iterator[int]:
    """Bytes that each control group leaves; its cache of files counts as free."""
    names = (
        ("memory.max", "memory.current", "inactive_file"),
        ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
    )
    for group in _groups("memory"):
        for limit, used, cached in names:
            if (most := _first(group, limit)).isdigit():
                stat = dict(line.split() for line in _read(group / "memory.stat").splitlines())
                taken = int(_first(group, used) or 0) - int(stat.get(cached, 0))
                yield max(0, int(most) - taken)


def peak_memory_mb() -> float:
    """Largest resident size [MB] of this process so far."""
    if STATUS.is_file():  # getrusage would give a worker its parent's size at the fork
        return _status_mb("VmHWM")
    if sys.platform == "darwin":
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / BYTES_PER_MB
    return psutil.Process().memory_info().peak_wset / BYTES_PER_MB  # Windows


def _status_mb(name: str) -> float:
    fields = dict(line.split(":", 1) for line in _read(STATUS).splitlines())
    return float(fields[name].split()[0]) / 1024.0


def give_back_memory() -> None:
    """Return free memory of this process to the machine; Linux only.

    Otherwise the C library keeps it: gigabytes after the factorisation of a large matrix.
    """
    _of_glibc("malloc_trim", 0)


@contextlib.contextmanager
def memory_returned() -> Iterator[None]:
    """Return all memory that is freed within to the machine; Linux only.

    Meanwhile large arrays are mapped one by one. In a common heap an array that stays would keep
    the freed memory below it.
    """
    _of_glibc("mallopt", MMAP_THRESHOLD, MMAP_THRESHOLD_BYTES)
    try:
        yield
    finally:
        _of_glibc("mallopt", MMAP_THRESHOLD, MAPPED_LATER)
        give_back_memory()


def keep_free_memory() -> None:
    """Keep up to 256 MB of freed memory for the next arrays; Linux only.

    Otherwise the C library returns it at once, and the machine has to clear it again for the next
    design point.
    """
    _of_glibc("mallopt", MMAP_THRESHOLD, MAPPED_LATER)
    _of_glibc("mallopt", TRIM_THRESHOLD, KEPT_FREE)


def _of_glibc(name: str, *arguments: int) -> None:
    function = getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None
    if function is not None:  # other C libraries need not have it
        function(*arguments)


@dataclass
class MemoryAbove:
    """What `memory_above` measures.

    Attributes
    ----------
    megabytes : float
        Largest resident size within, above that before [MB]; NaN where it is not known.
    """

    megabytes: float = float("nan")


@contextlib.contextmanager
def memory_above() -> Iterator[MemoryAbove]:
    """Watch the memory of what runs inside; Linux only, elsewhere NaN."""
    above = MemoryAbove()
    try:
        RESET.write_text("5", encoding="utf-8")  # resets the peak to the present size
        before = _status_mb("VmRSS")
    except OSError:
        yield above
        return
    yield above
    above.megabytes = max(0.0, _status_mb("VmHWM") - before)
