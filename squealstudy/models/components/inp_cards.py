"""Keyword files of Abaqus and CalculiX as cards: a keyword, its parameters, its lines of data."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from squealstudy.errors import ModelError
from squealstudy.models.components.inp_keywords import MATTERS
from squealstudy.models.matrices.text import NUMBER, TextFile, shortened

DEEPEST = 20  # files that include each other
REAL = re.compile(NUMBER, re.ASCII)
WHOLE = re.compile(r"[+-]?[0-9]{1,18}", re.ASCII)
FORTRAN = str.maketrans("dD", "eE")  # its double exponents
FROM_FILES = ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE")  # of whose data INPUT names a file
COMMAS = re.compile(r',(?=(?:[^"]*"[^"]*")*[^"]*$)')  # those outside quotes


class Line(NamedTuple):
    """A line of a file, counted from 0."""

    file: TextFile
    place: int

    @property
    def text(self) -> str:
        """The keyword line as it stands in the file."""
        return self.file.lines[self.place]

    def error(self, message: str) -> ModelError:
        """The error to raise about it: file, line, message."""
        return self.file.error(self.place, message)

    def words(self) -> list[str]:
        """What stands between commas; of a comma at the end nothing follows."""
        found = [w.strip() for w in self.text.split(",")]
        return found[:-1] if len(found) > 1 and not found[-1] else found

    def whole(self, word: str, what: str) -> int:
        """A word as a whole number; ModelError where it is none."""
        if not WHOLE.fullmatch(word):
            raise self.error(f"expected {what}, found '{shortened(word)}'")
        return int(word)

    def real(self, word: str, what: str) -> float:
        """A word as a finite number, Fortran's exponents among them; ModelError for others."""
        value = float(word.translate(FORTRAN)) if REAL.fullmatch(word) else float("nan")
        if not abs(value) < float("inf"):
            raise self.error(f"expected {what}, found '{shortened(word)}'")
        return value


@dataclass
class Card:
    """A keyword with what belongs to it.

    Attributes
    ----------
    keyword : str
        In capitals, without star and blanks: SOLIDSECTION.
    parameters : dict of str -> str
        By their names in capitals without blanks; empty text where there is no value.
    line : Line
        That of the keyword.
    data : list of Line
        Without comments and empty lines.
    unused : list of str
        Parameters that `check` has passed over.
    """

    keyword: str
    parameters: dict[str, str]
    line: Line
    data: list[Line] = field(default_factory=list)
    unused: list[str] = field(default_factory=list)

    @property
    def shown(self) -> str:
        """The keyword as in messages: with its star, as the file writes it."""
        return " ".join(self.line.text.split(",")[0].split()).upper()

    def error(self, message: str) -> ModelError:
        """The error to raise about the card."""
        return self.line.error(message)

    def value(self, name: str) -> str:
        """A parameter that must be there; ModelError where it is not."""
        if not self.parameters.get(name):
            raise self.error(f"{self.shown} needs {name}=...")
        return self.parameters[name]

    def check(self, known: Collection[str]) -> None:
        """ModelError where the card has a parameter that matters and is not among the known ones.

        Others are noted in `unused`.
        """
        self.unused = [name for name in self.parameters if name not in known]
        for name in self.unused:
            if name in MATTERS.get(self.keyword, ()):
                wanted = ", ".join(sorted(known)) or "none"
                raise self.error(
                    f"{self.shown}: the parameter {name} is not supported; supported: {wanted}"
                )

    def numbers(self, what: str, least: int, most: int) -> list[tuple[Line, float]]:
        """All numbers of all its lines, `least` to `most` of them, with their lines."""
        found = [
            (line, line.real(word, what)) for line in self.data for word in line.words() if word
        ]
        if not least <= len(found) <= most:
            wanted = f"{least}" if least == most else f"{least} to {most}"
            line = self.data[-1] if self.data else self.line
            raise line.error(
                f"{self.shown}: expected {wanted} numbers ({what}), found {len(found)}"
            )
        return found


def read_cards(path: Path) -> list[Card]:
    """The cards of a file and of those that it includes, which are sought in its folder.

    Raises
    ------
    ModelError
        An absent file; data before the first keyword; a parameter written twice.
    """
    cards: list[Card] = []
    lines = list(_flattened(_read(path, None), path.parent, 0))
    at = 0
    while at < len(lines):
        line = lines[at]
        at += 1
        if not line.text.lstrip().startswith("*"):
            if not cards:
                if line.text.lstrip()[:1] not in "0123456789+-.,":
                    continue  # a title
                raise line.error(f"expected a keyword, found '{shortened(line.text)}'")
            cards[-1].data.append(line)
            continue
        text = line.text
        while text.rstrip().endswith(",") and at < len(lines) and "*" not in lines[at].text[:1]:
            text += lines[at].text
            at += 1
        cards.append(_card(text, line))
        if "INPUT" in cards[-1].parameters and cards[-1].keyword in FROM_FILES:
            file = _read(path.parent / cards[-1].parameters.pop("INPUT"), line)
            cards[-1].data += list(_flattened(file, path.parent, 1))
    return cards


def _read(path: Path, wanted_by: Line | None) -> TextFile:
    try:
        return TextFile.read(path)
    except (OSError, EOFError) as error:
        reason = "there is no such file" if not path.exists() else str(error)
        message = f"{path} cannot be read: {reason}"
        raise (ModelError(message) if wanted_by is None else wanted_by.error(message)) from error


def _flattened(file: TextFile, folder: Path, depth: int) -> Iterator[Line]:
    """Lines without comments and empty ones, included files in their places."""
    for index, text in enumerate(file.lines):
        if not text.strip() or text.lstrip().startswith("**"):
            continue
        line = Line(file, index)
        if text.lstrip().startswith("*") and _keyword(text) == "INCLUDE":
            if depth == DEEPEST:
                raise line.error(f"more than {DEEPEST} files include each other")
            included = _read(folder / _card(text, line).value("INPUT"), line)
            yield from _flattened(included, folder, depth + 1)
        else:
            yield line


def _keyword(text: str) -> str:
    return "".join(text.split(",")[0].split()).lstrip("*").upper()


def _card(text: str, line: Line) -> Card:
    parameters: dict[str, str] = {}
    for part in COMMAS.split(text)[1:]:
        if not part.strip():
            continue
        name, _, value = part.partition("=")
        name = "".join(name.split()).upper()
        if name in parameters:
            raise line.error(f"the parameter {name} is there twice")
        parameters[name] = value.strip().strip('"')
    return Card(_keyword(text), parameters, line)
