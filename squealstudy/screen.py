"""What all screens share: tables of one style, name-value lines, notes, warnings.

Functions return what `rich` renders, on a terminal as in a notebook; `show` prints it.
"""

from __future__ import annotations

import contextlib
import re
import shutil
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from typing import TYPE_CHECKING, Any
from unicodedata import category

from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from squealstudy.faults import named

if TYPE_CHECKING:
    import pandas as pd

Rows = list[tuple[str, str]]
STDOUT = "standard output"
FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")  # how texts begin that spreadsheets compute
NUMBERS = re.compile(r"[-+\d.,eE\s]*")
MIN_COLUMN_WIDTH = 6  # least width of a column: figures are never cut
MOST_ACROSS, MOST_UP = 45, 30  # points of a map of letters
LEAST_WIDTH = 110  # of the ranking; a narrower terminal wraps its lines, nothing is cut
COLUMNS: dict[str, dict[str, Any]] = {
    "number": {"justify": "right", "no_wrap": True, "min_width": MIN_COLUMN_WIDTH},
    "value": {
        "justify": "right",
        "overflow": "fold",
        "min_width": MIN_COLUMN_WIDTH,
    },  # of a parameter
    "word": {"no_wrap": True},
    "text": {"overflow": "fold"},
}


class _Screen(Console):
    def on_broken_pipe(self) -> None:
        """Let the command say what becomes of it."""
        raise


console = _Screen(
    width=max(shutil.get_terminal_size().columns, LEAST_WIDTH), markup=False, highlight=False
)
messages = Console(stderr=True, markup=False)


def plain(text: str) -> str:
    """A text with control characters as escapes: what a file says must not steer a terminal."""
    if text.isprintable():
        return text
    return "".join(c if c == "\n" or category(c)[0] != "C" else ascii(c)[1:-1] for c in text)


def show(*parts: RenderableType) -> None:
    """Print to stdout."""
    with named(STDOUT):
        for part in parts:
            console.print(plain(part) if isinstance(part, str) else part)


def write(text: str) -> None:
    """Write a text to stdout as it is."""
    with named(STDOUT):
        console.file.write(text)
        console.file.flush()


def show_csv(table: pd.DataFrame) -> None:
    """Write all columns of a table to stdout as CSV.

    A text that a spreadsheet would compute (``=1+1``) begins with an apostrophe.
    """
    table_to_write = table.copy()
    for name in table_to_write.columns:
        if table_to_write[name].dtype.kind not in "biufM":
            table_to_write[name] = [
                _no_formula(v) if isinstance(v, str) else v for v in table_to_write[name]
            ]
    table_to_write.columns = [_no_formula(str(name)) for name in table_to_write.columns]
    write(table_to_write.to_csv(index=False))


def _no_formula(text: str) -> str:
    """A text that no spreadsheet takes for a formula; numbers with signs stay."""
    return f"'{text}" if text[:1] in FORMULA and not NUMBERS.fullmatch(text) else text


def as_text(parts: Iterable[RenderableType]) -> str:
    """What `show` would print, in lines of at most LEAST_WIDTH characters."""
    written = Console(
        width=LEAST_WIDTH, markup=False, highlight=False, file=StringIO(), force_jupyter=False
    )
    with written.capture() as captured:
        for part in parts:
            written.print(part)
    return captured.get()


def warning(text: str) -> None:
    """Print a warning to stderr; a log that cannot be written ends no run."""
    with contextlib.suppress(OSError):
        messages.print(f"warning: {plain(text)}", highlight=False, soft_wrap=True)


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
        table.add_row(*map(plain, row))
    return table


def letter_map(
    names: tuple[str, str],
    values: tuple[Sequence[float], Sequence[float]],
    words: Sequence[str],
    letters: Mapping[str, str],
) -> list[RenderableType]:
    """A grid of two parameters as letters, the first to the right and the second up.

    Nothing where the points are no whole grid, or one that is too large for a screen.

    Parameters
    ----------
    names : (str, str)
        With their units, as axes have them.
    values : (sequence of float, sequence of float)
        Of each point.
    words : sequence of str
        What is found at each point; keys of `letters`.
    letters : mapping of str -> str
    """
    x, y = (sorted(set(map(float, axis_values))) for axis_values in values)
    at = {(float(a), float(b)): w for a, b, w in zip(*values, words, strict=True)}
    whole = len(at) == len(words) == len(x) * len(y)
    if not whole or len(x) > MOST_ACROSS or len(y) > MOST_UP or set(words) - set(letters):
        return []
    labels = [f"{v:.6g}" for v in reversed(y)]
    width = max(map(len, labels))
    lines = [
        f"{label:>{width}}  {' '.join(letters[at[a, b]] for a in x)}"
        for label, b in zip(labels, reversed(y), strict=True)
    ]
    meaning = ", ".join(f"{letters[w]} {w.replace('_', ' ')}" for w in letters if w in set(words))
    return [
        plain(names[1]),
        Text("\n".join(lines)),
        notes(f"to the right: {names[0]}, {x[0]:.6g} to {x[-1]:.6g} ({len(x)} values); {meaning}"),
    ]


def facts(rows: Iterable[tuple[str, str]]) -> Table:
    """Name-value lines, aligned."""
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for name, text in rows:
        table.add_row(plain(name), plain(text))
    return table


def notes(*texts: str) -> Text:
    """What stands beneath a table, a line each; empty ones are left out."""
    return Text("\n".join(plain(text) for text in texts if text), style="dim")
