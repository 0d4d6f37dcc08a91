"""What commands print: rich tables of the ranking and of facts, a progress bar with ETA."""

from __future__ import annotations

import contextlib
import shutil
import sys
from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any

import pandas as pd
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

from squealstudy.analysis.tables.digits import in_digits

INTERRUPTED = 130
NARROW, WIDE = 6, 30  # least column widths: figures are never cut
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


def ranking(table: pd.DataFrame, along: str | None, unit: str) -> None:
    """Print the ranking of unstable modes."""
    if not len(table):
        console.print("No mode is unstable anywhere in the study.")
        return
    titles = ["mode", "Hz", "unstable", "growth 1/s", "damping %", *(["onset"] if along else [])]
    grid = Table(box=None, pad_edge=False, header_style="bold")
    for title in titles:
        grid.add_column(title, justify="right", no_wrap=True, min_width=NARROW)
    energies = bool(table["main_component"].any())  # a family of matrices has none
    if energies:
        grid.add_column("energy in", no_wrap=True, min_width=WIDE)
    grid.add_column("worst at", overflow="fold")
    for row in table.to_dict("records"):
        grid.add_row(
            _label(row),
            in_digits(row["frequency_hz"]),
            f"{100 * row['unstable_share']:.1f} %",
            in_digits(row["max_growth_rate"], 1),
            f"{100 * row['min_damping_ratio']:.3f}",
            *([_threshold(row)] if along else []),
            *([_energy(row)] if energies else []),
            ", ".join(value for _, value in _settings(row)),
        )
    console.print(grid)
    console.print(
        "unstable: share of the design points; growth, damping: at the worst point", style="dim"
    )
    names = ", ".join(name for name, _ in _settings(table.iloc[0].to_dict()))
    if names:
        console.print(f"worst at: {names}", style="dim")
    if along:
        name = f"{along} [{unit}]" if unit else along
        console.print(f"onset: {name} from which on the mode is unstable", style="dim")
    if table["ambiguous"].any():
        console.print("~ tracking was ambiguous somewhere on this mode's lines", style="dim")


def _energy(row: dict[Hashable, Any]) -> str:
    shares = ((row[f"{place}_component"], row[f"{place}_share"]) for place in ("main", "second"))
    return ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares if name)


def _settings(row: dict[Hashable, Any]) -> list[tuple[str, str]]:
    """Names and values of the worst point, from its text in the ranking."""
    parts = [part.rpartition("=") for part in str(row["at"]).split(", ") if "=" in part]
    return [(name, value) for name, _, value in parts]


def _label(row: dict[Hashable, Any]) -> str:
    name = str(row["track"]) if row["kind"] == "mode" else str(row["kind"])
    return f"~{name}" if row["ambiguous"] else name


def _threshold(row: dict[Hashable, Any]) -> str:
    value, kind = row["threshold"], row["threshold_kind"]
    if kind == "below range":
        return "below range"
    if not isinstance(value, float) or value != value:
        return "-"
    return f"{'<= ' if kind == 'first seen' else ''}{round(value, 9):.4g}"


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
