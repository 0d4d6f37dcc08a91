"""How many worker processes a run gets: what we may use, not what the machine has."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from squealstudy.machine import available_memory_mb, cores, peak_memory_mb
from squealstudy.wording import in_digits, plural


def worker_count(
    jobs: int | None, found: Mapping[str, Any] | None, warn: Callable[[str], None]
) -> int:
    """Worker processes of a run: as many as were asked for, else as cores and memory allow.

    A worker is taken to need what the largest of the earlier run needed whose manifest was `found`,
    or what this process has taken so far. `warn` is told where memory
    decides, or where more were asked for.
    """
    known = (found or {}).get("peak_memory_mb", {})
    earlier = float(known.get("largest_worker", 0.0))
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
