"""Reads text files with numbers, compressed or not, with errors that name the line."""

from __future__ import annotations

import bz2
import gzip
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.files import OF_TEXT, expect_room, read_whole

# functions that open compressed files, by the ending of their names
OPENERS: dict[str, Callable[..., Any]] = {".gz": gzip.open, ".bz2": bz2.open}
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][+-]?\d+)?"
COUNT = re.compile(r"[0-9]{1,18}", re.ASCII)
LONGEST_SHOWN = 40  # most characters of a line that a message quotes
CHARACTERS_PER_PART = 2**26  # characters that are decompressed at once
LINE_BYTES = 70  # memory of a line besides its characters
MAX_LETTERS = 2 * 10**9  # characters of a decompressed file: a deck of 20 million elements


@dataclass(frozen=True)
class TextFile:
    """A file's path and its lines, without their ends."""

    path: Path
    lines: list[str]

    @classmethod
    def read(cls, path: Path) -> TextFile:
        """Read the lines of a file; OSError, EOFError where it cannot be read or decompressed.

        Devices and pipes, which might never end, are refused, and so are files that are too long
        when they are decompressed.
        """
        if path.exists() and not path.is_file():
            raise OSError("it is no file")
        opener = OPENERS.get(path.suffix.lower())
        if opener is None:
            text = read_whole(path).decode("utf-8-sig", errors="replace")
        else:
            with opener(path, "rt", encoding="utf-8-sig", errors="replace") as handle:
                text = _unpacked(handle)
        if len(text) > MAX_LETTERS:
            raise OSError(f"it is longer than {MAX_LETTERS:.0e} characters")
        text = text.replace("\r\n", "\n").replace("\r", "\n")
        expect_room(len(text) + LINE_BYTES * text.count("\n"))
        return cls(path, text.split("\n"))

    def line(self, index: int) -> str:
        """A line, from 0; ModelError where the file ends before."""
        if index >= len(self.lines):
            raise ModelError(f"{self.path} ends at line {len(self.lines)}: expected more")
        return self.lines[index]

    def error(self, index: int, message: str) -> ModelError:
        """The error to raise about a line, from 0."""
        return ModelError(f"{self.path}, line {index + 1}: {message}")

    def counts(self, index: int, words: list[str], expected: str) -> list[int]:
        """Words of a line as whole numbers, 0 or more; ModelError if a word is no such number."""
        if not all(COUNT.fullmatch(word) for word in words):
            raise self.error(index, f"expected {expected}, found '{shortened(self.line(index))}'")
        return [int(word) for word in words]


def _unpacked(handle: IO[str]) -> str:
    """The text of a compressed file; an error where there is not enough memory for it."""
    pieces, letters = [], 0
    while letters <= MAX_LETTERS and (part := handle.read(CHARACTERS_PER_PART)):
        pieces.append(part)
        letters += len(part)
        expect_room(OF_TEXT * letters)
    return "".join(pieces)


def shortened(text: str) -> str:
    """A text of the file, short enough for a message."""
    text = " ".join(text.split())
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


FORTRAN = str.maketrans("dD", "eE")  # exponents of double precision in Fortran: 1.5D-3
COMMAS = str.maketrans("dD,", "eE ")
WHOLE_NUMBER = r"[+-]?\d+"


def read_table(
    text: TextFile,
    line_numbers: Sequence[int],
    before: Sequence[str],
    *,
    whole: bool = False,
    commas: bool = False,
) -> np.ndarray:
    """Read a table from lines of a file: an array with the fields `before` and ``value``.

    Parameters
    ----------
    text : TextFile
    line_numbers : sequence of int
        Lines, from 0.
    before : sequence of str
        Names of the whole numbers before the value.
    whole : bool
        Whether the value is a whole number too.
    commas : bool
        Whether commas may stand between the numbers.

    Raises
    ------
    ModelError
        The first line that has anything else.
    """
    fields = [*((name, np.int64) for name in before), ("value", np.int64 if whole else np.float64)]
    if not line_numbers:
        return np.zeros(0, fields)
    words = [*(WHOLE_NUMBER for _ in before), WHOLE_NUMBER if whole else NUMBER]
    pattern = re.compile((r"(?:\s*,\s*|\s+)" if commas else r"\s+").join(words), re.ASCII)
    expected = " and ".join([*before, "an integer" if whole else "a value"])

    def check() -> None:
        for i in line_numbers:
            if not pattern.fullmatch(text.lines[i].strip()):
                raise text.error(i, f"expected {expected}, found '{shortened(text.lines[i])}'")

    if commas:
        check()  # NumPy would read two commas side by side as one
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # NumPy warns if it reads an integer as a float
            lines = (text.lines[i].translate(COMMAS if commas else FORTRAN) for i in line_numbers)
            numbers = np.loadtxt(lines, np.dtype(fields), comments=None, ndmin=1)
    except (ValueError, DeprecationWarning, OverflowError):
        check()
        raise
    finite = np.isfinite(numbers["value"])
    if not finite.all():
        i = line_numbers[int((~finite).argmax())]
        raise text.error(i, f"expected a finite value, found '{shortened(text.lines[i])}'")
    return numbers
