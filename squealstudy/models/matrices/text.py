"""Lines of a text file with numbers, compressed or not, and errors that name a line."""

from __future__ import annotations

import bz2
import gzip
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from squealstudy.errors import ModelError

OPENERS: dict[str, Callable[..., Any]] = {".gz": gzip.open, ".bz2": bz2.open}
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][+-]?\d+)?"
COUNT = re.compile(r"[0-9]{1,18}", re.ASCII)
LONGEST_SHOWN = 40


@dataclass(frozen=True)
class TextFile:
    """A file's path and its lines, without their ends."""

    path: Path
    lines: list[str]

    @classmethod
    def read(cls, path: Path) -> TextFile:
        """The lines of a file; OSError, EOFError where it cannot be read or decompressed."""
        opener = OPENERS.get(path.suffix.lower(), open)
        with opener(path, "rt", encoding="utf-8-sig", errors="replace") as handle:
            return cls(path, handle.read().split("\n"))

    def line(self, index: int) -> str:
        """A line, from 0; ModelError where the file ends before."""
        if index >= len(self.lines):
            raise ModelError(f"{self.path} ends at line {len(self.lines)}: expected more")
        return self.lines[index]

    def error(self, index: int, message: str) -> ModelError:
        """The error to raise about a line, from 0."""
        return ModelError(f"{self.path}, line {index + 1}: {message}")

    def counts(self, index: int, words: list[str], expected: str) -> list[int]:
        """Whole numbers, not negative, of a line of the header; ModelError for others."""
        if not all(COUNT.fullmatch(word) for word in words):
            raise self.error(index, f"expected {expected}, found '{shortened(self.line(index))}'")
        return [int(word) for word in words]


def shortened(text: str) -> str:
    """A text of the file, short enough for a message."""
    text = " ".join(text.split())
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."
