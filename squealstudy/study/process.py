"""Worker processes: their end with the parent, their memory."""

from __future__ import annotations

import os
import resource
import threading
import time
from pathlib import Path

WATCH_S = 0.5
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
    status = Path("/proc/self/status")
    if status.is_file():
        fields = dict(line.split(":", 1) for line in status.read_text().splitlines())
        return float(fields["VmHWM"].split()[0]) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
