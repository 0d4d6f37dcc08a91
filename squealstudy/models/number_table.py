"""Text files of numbers below a line of names, as for measured faces and values over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.wording import did_you_mean, shown

LARGEST_BYTES = 64 * 2**20  # of a file, enough for a million rows
Line = tuple[int, list[str]]  # line number from 1, and cells


def read_lines(path: Path, example: str) -> tuple[Line, list[Line]]:
    """The line of names, and all lines below it that are not empty.

    Cells are separated by semicolons, tabs, commas or blanks: the first of these that the line of
    names has. `example` are the expected names, for messages.

    Raises
    ------
    ModelError
        The file does not exist, is no text, is too large or empty.
    """
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise ModelError(f"{path.name}: larger than {LARGEST_BYTES // 2**20} MB")
        text = path.read_text("utf-8-sig")
    except UnicodeDecodeError:
        raise ModelError(f"{path.name} is no text") from None
    except OSError as error:
        text = "there is no file" if not path.exists() else f"{error.strerror or error}:"
        raise ModelError(f"{text} {path}") from None
    lines = [(k, line) for k, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not lines:
        raise ModelError(f"{path.name} is empty: expected a line of names, {example}")
    separator = next((c for c in ";\t," if c in lines[0][1]), None)
    first, *others = [(k, cells_of(line, separator)) for k, line in lines]
    return first, others


def cells_of(line: str, separator: str | None) -> list[str]:
    """The cells of a line; None separates at blanks."""
    if separator is None:
        return line.split()
    return [cell.strip() for cell in line.split(separator)]


def numbers_of(path: Path, line: int, cells: list[str], count: int) -> list[float]:
    """The cells of a line as `count` finite numbers; ModelError where they are not."""
    if len(cells) != count:
        raise ModelError(f"{path.name}, line {line}: expected {count} numbers, got {len(cells)}")
    try:
        values = [float(cell.replace("_", "?")) for cell in cells]  # Python reads 1_0 as ten
    except ValueError:
        cells_text = shown(", ".join(cells))
        raise ModelError(f"{path.name}, line {line}: expected numbers, got {cells_text}") from None
    if not np.isfinite(values).all():
        cells_text = shown(", ".join(cells))
        raise ModelError(f"{path.name}, line {line}: expected finite numbers, got {cells_text}")
    return values


def read_columns(path: Path, names: Sequence[str]) -> tuple[list[int], list[list[float]]]:
    """Line numbers, and the numbers (n_rows, n_names) in the columns of these names.

    Other columns are passed over.

    Raises
    ------
    ModelError
        As in `read_lines` and `numbers_of`; a column is missing, or is there twice.
    """
    expected = ", ".join(names)
    (number, words), lines = read_lines(path, expected)
    titles = [name.lower() for name in words]
    for name in names:
        if titles.count(name) != 1:
            what = "there is no column" if name not in titles else "there are two columns"
            hint = did_you_mean(name, titles) if name not in titles else ""
            raise ModelError(
                f"{path.name}, line {number}: {what} '{name}', expected a line of names "
                f"with {expected}, got {shown(', '.join(words))}{hint}"
            )
    columns = [titles.index(name) for name in names]
    rows = []
    for line, cells in lines:
        if len(cells) != len(titles):
            raise ModelError(
                f"{path.name}, line {line}: expected {len(titles)} cells, got {len(cells)}"
            )
        rows.append(numbers_of(path, line, [cells[column] for column in columns], len(names)))
    return [line for line, _ in lines], rows
