"""`squealstudy warmup`."""

from __future__ import annotations

from squealstudy.analysis.transient.warmup import warm_kernels
from squealstudy.cli import screen
from squealstudy.kernels.jit import compiled_directory


def warmup_command(single: bool) -> None:
    """Compile the time-integration kernels, or find them compiled, and say where they are."""
    seconds = warm_kernels(single)
    screen.facts([("kernels", f"ready after {seconds:.1f} s, in {compiled_directory()}")])
