"""A line of a keyword file, with errors that name it."""

from __future__ import annotations

import re
from typing import NamedTuple

from squealstudy.errors import ModelError
from squealstudy.models.matrices.text import NUMBER, TextFile, shortened

REAL = re.compile(NUMBER, re.ASCII)
WHOLE_NUMBER = re.compile(r"[+-]?[0-9]{1,18}", re.ASCII)
FORTRAN = str.maketrans("dD", "eE")  # its double exponents


class Line(NamedTuple):
    """A line of a file; `place` counts from 0."""

    file: TextFile
    place: int

    @property
    def text(self) -> str:
        """The line as it stands in the file."""
        return self.file.lines[self.place]

    def error(self, message: str) -> ModelError:
        """The error to raise about the line: file, line number from 1, message."""
        return self.file.error(self.place, message)

    def words(self) -> list[str]:
        """Words between commas; a comma at the end adds none."""
        words = [w.strip() for w in self.text.split(",")]
        return words[:-1] if len(words) > 1 and not words[-1] else words

    def whole(self, word: str, expected: str) -> int:
        """A word as a whole number; ModelError where it is none."""
        if not WHOLE_NUMBER.fullmatch(word):
            raise self.error(f"expected {expected}, found '{shortened(word)}'")
        return int(word)

    def real(self, word: str, expected: str) -> float:
        """A word as a finite number, also with the exponent D of Fortran; else ModelError."""
        number = float(word.translate(FORTRAN)) if REAL.fullmatch(word) else float("nan")
        if not abs(number) < float("inf"):
            raise self.error(f"expected {expected}, found '{shortened(word)}'")
        return number
