"""Keyword files of Abaqus and CalculiX as cards: a keyword, its parameters, its lines of data."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from squealstudy.errors import ModelError
from squealstudy.models.components.inp_keywords import MATTERS
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.components.inp_parameters import KEYWORD as PARAMETER
from squealstudy.models.components.inp_parameters import Parameters
from squealstudy.models.matrices.text import TextFile, shortened

MAX_INCLUDE_DEPTH = 20  # how deep files may include each other
FROM_FILES = ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE")  # may read data from a file by INPUT
COMMAS = re.compile(r',(?=(?:[^"]*"[^"]*")*[^"]*$)')  # those outside quotes


@dataclass
class Card:
    """A keyword with its parameters and lines of data.

    Attributes
    ----------
    keyword : str
        In capitals, without star and blanks: SOLIDSECTION.
    parameters : dict of str -> str
        By their names in capitals without blanks; empty text where there is no value.
    line : Line
        That of the keyword.
    data : list of Line
        Lines below it, without comments and empty lines.
    unused : list of str
        Parameters that `check` passes over.
    """

    keyword: str
    parameters: dict[str, str]
    line: Line
    data: list[Line] = field(default_factory=list)
    unused: list[str] = field(default_factory=list)

    @property
    def shown(self) -> str:
        """The keyword with its star, in capitals, for messages."""
        return " ".join(self.line.text.split(",")[0].split()).upper()

    def error(self, message: str) -> ModelError:
        """The error to raise about the card."""
        return self.line.error(message)

    def value(self, name: str) -> str:
        """The value of a required parameter; ModelError where it is missing or empty."""
        if not self.parameters.get(name):
            raise self.error(f"{self.shown} needs {name}=...")
        return self.parameters[name]

    def check(self, supported: Collection[str]) -> None:
        """Raise ModelError about an unsupported parameter that changes the model.

        Other unsupported parameters are noted in `unused`.
        """
        self.unused = [name for name in self.parameters if name not in supported]
        for name in self.unused:
            if name in MATTERS.get(self.keyword, ()):
                names = ", ".join(sorted(supported)) or "none"
                raise self.error(
                    f"{self.shown}: the parameter {name} is not supported; supported: {names}"
                )

    def numbers(self, meaning: str, least: int, most: int) -> list[tuple[Line, float]]:
        """All numbers on the card, each with its line.

        ModelError where there are fewer than `least` or more than `most`, or a word is no number.
        """
        numbers = [
            (line, line.real(word, meaning)) for line in self.data for word in line.words() if word
        ]
        if not least <= len(numbers) <= most:
            expected = f"{least}" if least == most else f"{least} to {most}"
            line = self.data[-1] if self.data else self.line
            raise line.error(
                f"{self.shown}: expected {expected} numbers ({meaning}), found {len(numbers)}"
            )
        return numbers


def read_cards(path: Path) -> list[Card]:
    """The cards of a file and of those that it includes, which are in its folder.

    Raises
    ------
    ModelError
        A file does not exist; includes are nested too deep; data come before the first keyword; a
        parameter is written twice; ``*PARAMETER`` is wrong.
    """
    cards: list[Card] = []
    parameters = Parameters()
    lines = list(_flattened(_read(path, None), path.parent, 0))
    start = 0
    while start < len(lines):
        line = parameters.put_in(lines[start])
        start += 1
        if not line.text.lstrip().startswith("*"):
            if not cards:
                if line.text.lstrip()[:1] not in "0123456789+-.,":
                    continue  # a title
                raise line.error(f"expected a keyword, found '{shortened(line.text)}'")
            if cards[-1].keyword == PARAMETER:
                parameters.define(line)
            cards[-1].data.append(line)
            continue
        text = line.text
        while (
            text.rstrip().endswith(",") and start < len(lines) and "*" not in lines[start].text[:1]
        ):
            text += parameters.put_in(lines[start]).text
            start += 1
        cards.append(_card(text, line))
        if cards[-1].keyword == PARAMETER:
            parameters.check(cards[-1].parameters, line)
        if "INPUT" in cards[-1].parameters and cards[-1].keyword in FROM_FILES:
            file = _read(path.parent / cards[-1].parameters.pop("INPUT"), line)
            more = _flattened(file, path.parent, 1)
            cards[-1].data += [parameters.put_in(continuation) for continuation in more]
    return [card for card in cards if card.keyword != PARAMETER]


def _read(path: Path, line: Line | None) -> TextFile:
    try:
        return TextFile.read(path)
    except (OSError, EOFError) as error:
        reason = "there is no such file" if not path.exists() else str(error)
        message = f"{path} cannot be read: {reason}"
        raise (ModelError(message) if line is None else line.error(message)) from error


def _flattened(file: TextFile, folder: Path, depth: int) -> Iterator[Line]:
    """Lines that are neither comments nor empty, with included files in their places."""
    for index, text in enumerate(file.lines):
        if not text.strip() or text.lstrip().startswith("**"):
            continue
        line = Line(file, index)
        if text.lstrip().startswith("*") and _keyword(text) == "INCLUDE":
            if depth == MAX_INCLUDE_DEPTH:
                raise line.error(f"files include each other more than {MAX_INCLUDE_DEPTH} deep")
            included = _read(folder / _card(text, line).value("INPUT"), line)
            yield from _flattened(included, folder, depth + 1)
        else:
            yield line


def _keyword(text: str) -> str:
    return "".join(text.split(",")[0].split()).lstrip("*").upper()


def _card(text: str, line: Line) -> Card:
    """A card from its keyword line."""
    parameters: dict[str, str] = {}
    for part in COMMAS.split(text)[1:]:
        if not part.strip():
            continue
        name, _, setting = part.partition("=")
        name = "".join(name.split()).upper()
        if name in parameters:
            raise line.error(f"the parameter {name} is there twice")
        parameters[name] = setting.strip().strip('"')
    return Card(_keyword(text), parameters, line)
