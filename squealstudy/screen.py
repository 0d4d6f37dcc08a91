"""What all screens share: tables of one style, name-value lines, notes, warnings, progress bars.

Functions return what `rich` renders, on a terminal as in a notebook; `show` prints it.
"""

from __future__ import annotations

import contextlib
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from io import StringIO
from typing import Any

from rich.console import Console, RenderableType
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
from rich.text import Text

Rows = list[tuple[str, str]]
INTERRUPTED = 130
NARROW = 6  # least width of a column: figures are never cut
LEAST_WIDTH = 110  # of the ranking; a narrower terminal wraps its lines, nothing is cut
COLUMNS: dict[str, dict[str, Any]] = {
    "number": {"justify": "right", "no_wrap": True, "min_width": NARROW},
    "value": {"justify": "right", "overflow": "fold", "min_width": NARROW},  # of a parameter
    "word": {"no_wrap": True},
    "text": {"overflow": "fold"},
}
console = Console(
    width=max(shutil.get_terminal_size().columns, LEAST_WIDTH), markup=False, highlight=False
)
messages = Console(stderr=True, markup=False)


def show(*parts: RenderableType) -> None:
    """Print to stdout."""
    for part in parts:
        console.print(part)


def as_text(parts: Iterable[RenderableType]) -> str:
    """What `show` would print, in lines of at most LEAST_WIDTH characters."""
    written = Console(width=LEAST_WIDTH, markup=False, highlight=False, file=StringIO())
    with written.capture() as captured:
        for part in parts:
            written.print(part)
    return captured.get()


def warning(text: str) -> None:
    """Print a warning to stderr."""
    messages.print(f"warning: {text}", highlight=False, soft_wrap=True)


def grid(*columns: str, rows: Iterable[Iterable[str]]) -> Table:
    """A table of texts.

    Parameters
    ----------
    *columns : str
        Titles, each after its kind (a key of COLUMNS) and a colon, as ``word:energy in``; without
        one a number.
    rows : iterable of iterable of str
    """
    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in columns:
        kind, colon, title = column.partition(":")
        if not colon or kind not in COLUMNS:  # a title that has a colon itself
            kind, title = "number", column
        table.add_column(title, **COLUMNS[kind])
    for row in rows:
        table.add_row(*row)
    return table


def facts(rows: Iterable[tuple[str, str]]) -> Table:
    """Name-value lines, aligned."""
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in rows:
        table.add_row(name, value)
    return table


def notes(*texts: str) -> Text:
    """What stands beneath a table, a line each; empty ones are left out."""
    return Text("\n".join(text for text in texts if text), style="dim")


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
    """A bar for each stage with the expected remaining time, on stderr or in a notebook."""
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
        disable=not (messages.is_terminal or messages.is_jupyter),
    ) as bars:
        tasks: dict[str, TaskID] = {}

        def report(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=total)
            bars.update(tasks[stage], completed=done, total=total)

        yield report
