"""Common parts of all screens: tables, name-value lines, notes, warnings.

Functions return what `rich` renders on a terminal or in a notebook; `show` prints it.
"""

from __future__ import annotations

import contextlib
import re
import shlex
import shutil
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from itertools import zip_longest
from typing import TYPE_CHECKING
from unicodedata import category

from rich.cells import cell_len, set_cell_size
from rich.console import Console, ConsoleOptions, OverflowMethod, RenderableType, RenderResult
from rich.table import Table
from rich.text import Text

from squealstudy.faults import named

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

Rows = list[tuple[str, str]]
STDOUT = "standard output"
FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")  # first characters of what spreadsheets compute
NUMBERS = re.compile(r"[-+\d.,eE\s]*")
NO_BREAK = "\u00a0"  # a blank at which no line is broken; it is shown as any other blank
WORDS = re.compile(rf"(?:\S|{NO_BREAK})+[^\S{NO_BREAK}]*|\s+")  # pieces of a text
NAME_BREAKS = "_./"  # characters after which a name that is too long is broken
PIECES = re.compile(r"[^\s_]+[\s_]*|[\s_]+")  # pieces of a title, whose names have underscores
MOST_ACROSS, MOST_UP = 45, 30  # points of a map of letters
LEAST_WIDTH = 80  # characters; a narrower terminal wraps lines, and nothing is cut
WIDTH_OF_FILES = 110  # characters of a line in files, pipes and pages
WIDTH_OF_SENTENCES = 100  # characters of a line of sentences there
# columns of a grid: numbers and values are aligned right, and only texts are broken into lines
NUMBER, VALUES, WORD, TEXT = "number", "value", "word", "text"
GAP = 2  # characters between columns
MIN_NUMBER_WIDTH = 4  # least characters of a column of numbers
MIN_TEXT_WIDTH = 12  # characters of a column of texts, at least if its words are as long


class _Screen(Console):
    def on_broken_pipe(self) -> None:
        """Raise the error of a broken pipe, which the command handles."""
        raise


console = _Screen(
    width=max(shutil.get_terminal_size((WIDTH_OF_FILES, 24)).columns, LEAST_WIDTH),
    markup=False,
    highlight=False,
)
messages = Console(stderr=True, markup=False)


def plain(text: str) -> str:
    """A text with control characters as escapes: no text of a file may control a terminal."""
    if text.isprintable():
        return text
    return "".join(c if c == "\n" or category(c)[0] != "C" else ascii(c)[1:-1] for c in text)


def show(*parts: RenderableType, unbroken: bool = False) -> None:
    """Print to stdout; texts are broken between words to the width of the screen.

    `unbroken`: texts are paths or commands to be copied, and each stays in one line. So does a text
    with a word that is longer than a line.
    """
    with named(STDOUT):
        for part in parts:
            to_file = not (console.is_terminal or console.is_jupyter)
            width = WIDTH_OF_SENTENCES if to_file else console.width
            is_text = isinstance(part, str)
            longest_word = max(map(len, str(part).split()), default=0) if is_text else 0
            is_line = is_text and (unbroken or longest_word > width)
            overflow: OverflowMethod | None = "ignore" if is_line else None
            text_or_part = plain(str(part)) if is_text else part
            if not to_file:
                console.print(text_or_part, crop=False, overflow=overflow)
                continue
            with console.capture() as captured:
                console.print(
                    text_or_part,
                    crop=False,
                    overflow=overflow,
                    width=width if is_text and not is_line else None,
                )
            console.file.write(_without_trailing_blanks(captured.get()))


def _without_trailing_blanks(text: str) -> str:
    """A text for files and pages, without blanks at the ends of lines."""
    return re.sub(r"[ \t]+$", "", text, flags=re.MULTILINE)


def write(text: str) -> None:
    """Write a text to stdout unchanged."""
    with named(STDOUT):
        console.file.write(text)
        console.file.flush()


def show_csv(table: pd.DataFrame) -> None:
    """Write all columns of a table to stdout as CSV.

    A text that a spreadsheet would compute (``=1+1``) gets an apostrophe before it.
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
    """A text that no spreadsheet takes for a formula; numbers with signs are unchanged."""
    return f"'{text}" if text[:1] in FORMULA and not NUMBERS.fullmatch(text) else text


def as_text(parts: Iterable[RenderableType], width: int = WIDTH_OF_FILES) -> str:
    """Text that `show` would print, in lines of at most `width` characters."""
    written = Console(
        width=width, markup=False, highlight=False, file=StringIO(), force_jupyter=False
    )
    with written.capture() as captured:
        for part in parts:
            written.print(part, crop=False)
    return _without_trailing_blanks(captured.get())


def warning(text: str) -> None:
    """Print a warning to stderr; an error of writing it is ignored."""
    with contextlib.suppress(OSError):
        messages.print(f"warning: {plain(text)}", highlight=False, soft_wrap=True)


class Grid:
    """A table of texts, at most as wide as the screen: titles are broken first, then texts.

    Numbers and words are never broken, so that a table of very many columns may be wider.

    Parameters
    ----------
    kinds : sequence of str
        Kind of each column: NUMBER, VALUES, WORD or TEXT.
    titles : sequence of str
        Title of each column.
    rows : sequence of sequence of str
        Cells of each row.
    """

    def __init__(
        self, kinds: Sequence[str], titles: Sequence[str], rows: Sequence[Sequence[str]]
    ) -> None:
        self.kinds, self.titles, self.rows = kinds, titles, rows

    def __rich_console__(self, _: Console, options: ConsoleOptions) -> RenderResult:
        widths = self.widths(options.max_width)
        heads = [_in_lines(t, w, PIECES) for t, w in zip(self.titles, widths, strict=True)]
        deepest = max(map(len, heads), default=0)
        yield self._line([[""] * (deepest - len(h)) + h for h in heads], widths, "bold")
        for row in self.rows:
            cells = [
                _in_lines(cell, width, WORDS) if kind == TEXT else [cell]
                for kind, cell, width in zip(self.kinds, row, widths, strict=True)
            ]
            yield self._line(cells, widths, "")

    def widths(self, available: int) -> list[int]:
        """Width of each column, in characters, if `available` ones are to suffice."""
        columns = [[row[k] for row in self.rows] for k in range(len(self.titles))]
        longest = [max(map(cell_len, cells), default=0) for cells in columns]
        min_widths = [MIN_NUMBER_WIDTH if k in (NUMBER, VALUES) else 0 for k in self.kinds]
        widths = [
            max(cell_len(t), long, w)
            for t, long, w in zip(self.titles, longest, min_widths, strict=True)
        ]
        available -= GAP * (len(widths) - 1)
        narrow = [
            max(_longest_piece(t, PIECES), 0 if kind == TEXT else long, w)
            for kind, t, long, w in zip(self.kinds, self.titles, longest, min_widths, strict=True)
        ]
        between_words = [
            max(_longest_piece(t, WORDS), n) for t, n in zip(self.titles, narrow, strict=True)
        ]
        for widths_at_most in (between_words, narrow):
            savings = {
                k: widths[k] - widths_at_most[k]
                for k, kind in enumerate(self.kinds)
                if kind != TEXT
            }
            for k in sorted(savings, key=savings.__getitem__, reverse=True):
                if sum(widths) > available:
                    widths[k] = widths_at_most[k]
        texts = [k for k, kind in enumerate(self.kinds) if kind == TEXT]
        for k in texts:
            in_words = max((_longest_piece(cell, WORDS) for cell in columns[k]), default=0)
            narrow[k] = max(narrow[k], min(in_words, MIN_TEXT_WIDTH))
        while sum(widths) > available:
            wide = [k for k in texts if widths[k] > narrow[k]]
            if not wide:
                break
            widths[max(wide, key=widths.__getitem__)] -= 1
        return widths

    def _line(self, cells: Sequence[Sequence[str]], widths: Sequence[int], style: str) -> Text:
        """A row with as many lines as its highest cell."""
        lines = []
        for of_line in zip_longest(*cells, fillvalue=""):
            parts = [
                " " * max(w - cell_len(c), 0) + c
                if kind in (NUMBER, VALUES)
                else set_cell_size(c, w)
                for kind, c, w in zip(self.kinds, of_line, widths, strict=True)
            ]
            lines.append((" " * GAP).join(parts).replace(NO_BREAK, " ").rstrip())
        return Text("\n".join(lines), style=style, no_wrap=True, overflow="ignore")


def _longest_piece(text: str, pieces: re.Pattern[str]) -> int:
    return max(map(cell_len, map(str.strip, pieces.findall(text))), default=0)


def _in_lines(text: str, width: int, pieces: re.Pattern[str]) -> list[str]:
    """A text in lines of at most `width` characters, broken between pieces if possible."""
    lines = [""]
    for piece in pieces.findall(text):
        if cell_len(lines[-1] + piece.rstrip()) > width and lines[-1]:
            lines.append("")
        left_over = lines[-1] + piece
        while cell_len(left_over.rstrip()) > width:
            cut = max(left_over.rfind(mark, 0, width) for mark in NAME_BREAKS) + 1 or width
            lines[-1], left_over = left_over[:cut], left_over[cut:]
            lines.append("")
        lines[-1] = left_over
    return [line.rstrip() for line in lines]


def grid(*columns: str, rows: Iterable[Iterable[str]]) -> Grid:
    """A table of texts.

    Parameters
    ----------
    *columns : str
        Titles, each after its kind and a colon, as ``word:energy in``; without a kind it is number.
    rows : iterable of iterable of str
        Cells of each row.
    """
    kinds, titles = [], []
    for column in columns:
        kind, colon, title = column.partition(":")
        if not colon or kind not in (NUMBER, VALUES, WORD, TEXT):  # a title may have a colon itself
            kind, title = NUMBER, column
        kinds.append(kind)
        titles.append(plain(title))
    return Grid(kinds, titles, [[plain(cell) for cell in row] for row in rows])


def letter_map(
    names: tuple[str, str],
    values: tuple[Sequence[float], Sequence[float]],
    words: Sequence[str],
    letters: Mapping[str, str],
) -> list[RenderableType]:
    """A grid of two parameters as letters, the first parameter to the right and the second up.

    Empty if the points are no full grid, or one that is too large for a screen.

    Parameters
    ----------
    names : (str, str)
        Names of both parameters, with their units.
    values : (sequence of float, sequence of float)
        Values of both parameters at each point.
    words : sequence of str
        Word of each point, a key of `letters`.
    letters : mapping of str -> str
        Letter of each word.
    """
    x, y = (sorted(set(map(float, axis_values))) for axis_values in values)
    word_at = {(float(a), float(b)): w for a, b, w in zip(*values, words, strict=True)}
    is_full_grid = len(word_at) == len(words) == len(x) * len(y)
    if not is_full_grid or len(x) > MOST_ACROSS or len(y) > MOST_UP or set(words) - set(letters):
        return []
    labels = [f"{v:.6g}" for v in reversed(y)]
    width = max(map(len, labels))
    lines = [
        f"{label:>{width}}  {' '.join(letters[word_at[a, b]] for a in x)}"
        for label, b in zip(labels, reversed(y), strict=True)
    ]
    meaning = ", ".join(f"{letters[w]} {w.replace('_', ' ')}" for w in letters if w in set(words))
    return [
        plain(names[1]),
        Text("\n".join(lines)),
        notes(f"to the right: {names[0]}, {x[0]:.6g} to {x[-1]:.6g} ({len(x)} values)", meaning),
    ]


def command_text(verb: str, path: Path, *options: str) -> str:
    """Text of a command on a file or folder, to be copied."""
    return shlex.join(["squealstudy", verb, str(path), *options])


def held_together(texts: Iterable[str]) -> str:
    """Texts joined by commas, for a column of texts; lines are broken only between them."""
    return ", ".join(text.replace(" ", NO_BREAK) for text in texts)


def heading(title: str) -> Text:
    """Heading of a block of lines."""
    return Text(title, style="bold")


def facts(rows: Iterable[tuple[str, str]]) -> Table:
    """Lines of names and texts, aligned."""
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for name, text in rows:
        table.add_row(plain(name), plain(text))
    return table


def notes(*texts: str) -> Text:
    """Notes beneath a table, one in each line; empty ones are left out."""
    return Text("\n".join(plain(text) for text in texts if text), style="dim")
