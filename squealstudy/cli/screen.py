"""What all commands print: facts, warnings, a progress bar with ETA."""

from __future__ import annotations

import contextlib
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

INTERRUPTED = 130
NARROW = 6  # least width of a column: figures are never cut
LEAST_WIDTH = 110  # of the ranking; a narrower terminal wraps its lines, nothing is cut
console = Console(
    width=max(shutil.get_terminal_size().columns, LEAST_WIDTH), markup=False, highlight=False
)
messages = Console(stderr=True, markup=False)


def warning(text: str) -> None:
    """Print a warning to stderr."""
    messages.print(f"warning: {text}", highlight=False, soft_wrap=True)


def facts(rows: Sequence[tuple[str, str]]) -> None:
    """Print name-value lines, aligned."""
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in rows:
        table.add_row(name, value)
    console.print(table)


def broken_rules(rules: Sequence[tuple[str, int]]) -> str:
    """What should hold, and how many design points break it."""
    return "; ".join(f"{count} break '{rule}'" for rule, count in rules)


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Say how an interrupted run goes on."""
    try:
        yield
    except KeyboardInterrupt:
        sys.stderr.write("squealstudy: interrupted; the same command goes on where it was\n")
        raise SystemExit(INTERRUPTED) from None


@contextlib.contextmanager
def progress_bars() -> Iterator[Callable[[str, int, int], None]]:
    """A bar for each stage, with the expected remaining time, on stderr."""
    with Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("ETA"),
        TimeRemainingColumn(),
        console=messages,
        transient=True,
        disable=not messages.is_terminal,
    ) as bars:
        tasks: dict[str, TaskID] = {}

        def report(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=total)
            bars.update(tasks[stage], completed=done, total=total)

        yield report
