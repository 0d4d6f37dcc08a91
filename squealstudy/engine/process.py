"""Worker processes: their end with the parent, their memory."""

from __future__ import annotations

import contextlib
import os
import resource
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

WATCH_S = 0.5
STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")
_watched: set[int] = set()


def watch_parent(parent: int) -> None:
    """End this process when `parent` is gone: a killed run leaves no worker behind."""
    if parent in _watched or os.getpid() == parent:
        return
    _watched.add(parent)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(WATCH_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def peak_memory_mb() -> float:
    """Largest resident size of this process so far, MB.

    From /proc where there is one: getrusage gives a worker its parent's size at the fork.
    """
    if STATUS.is_file():
        return _status_mb("VmHWM")
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def _status_mb(name: str) -> float:
    fields = dict(line.split(":", 1) for line in STATUS.read_text().splitlines())
    return float(fields[name].split()[0]) / 1024.0


@dataclass
class MemoryAbove:
    """Largest resident size within `memory_above`, MB above that before; NaN where unknown."""

    megabytes: float = float("nan")


@contextlib.contextmanager
def memory_above() -> Iterator[MemoryAbove]:
    """Watch the memory of what runs inside; Linux only, elsewhere NaN."""
    found = MemoryAbove()
    try:
        RESET.write_text("5")  # the peak begins again at the present size
        before = _status_mb("VmRSS")
    except OSError:
        yield found
        return
    yield found
    found.megabytes = max(0.0, _status_mb("VmHWM") - before)
