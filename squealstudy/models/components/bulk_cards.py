"""Cards of Nastran bulk data in small, large or free field format, with included files.

Also their coordinate systems.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.inp_cards import MAX_INCLUDE_DEPTH
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.matrices.dmig import (
    MORE_FIELDS,
    NUMBER,
    continued,
    fields_of,
    has_more_fields,
)
from squealstudy.models.matrices.text import COUNT, TextFile, shortened

BEGIN, END = re.compile(r"\s*BEGIN\b(\s+BULK\b)?", re.I), re.compile(r"\s*ENDDATA\b", re.I)
EQUATION = re.compile(r"DEQATN\b", re.I)
INCLUDE = re.compile(r"\s*INCLUDE\s+(?:'(?P<one>[^']*)'?|\"(?P<two>[^\"]*)\"?|(?P<bare>\S+))", re.I)


@dataclass
class BulkCard:
    """A card of bulk data.

    Attributes
    ----------
    name : str
        In capitals.
    fields : list of str
        The fields after the name, continuations included.
    lines : list of Line
        The line of each field.
    """

    name: str
    fields: list[str] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)

    def error(self, message: str, field: int = 0) -> ModelError:
        """The error to raise, with the line of a field."""
        line = self.lines[min(field, len(self.lines) - 1)]
        return line.error(f"{self.name}: {message}")

    def at(self, field: int) -> str:
        """A field, counted from 0 after the name; empty beyond the end of the card."""
        return self.fields[field] if field < len(self.fields) else ""

    def whole(self, field: int, expected: str, default: int | None = None) -> int:
        """A whole number. ModelError where it is something else, or empty without a default."""
        word = self.at(field)
        if not word and default is not None:
            return default
        if not COUNT.fullmatch(word.removeprefix("-")):
            raise self.error(f"expected {expected}, found '{shortened(word)}'", field)
        return int(word)

    def real(self, field: int, expected: str, default: float | None = None) -> float:
        """A number as Nastran writes it. ModelError as in `whole`."""
        word = self.at(field)
        if not word and default is not None:
            return default
        match = NUMBER.fullmatch(word)
        number = float("nan")
        if match is not None:
            number = float(f"{match['digits']}e{match['power'] or match['bare'] or 0}")
        if not abs(number) < float("inf"):
            raise self.error(f"expected {expected}, found '{shortened(word)}'", field)
        return number

    def listed(self, start: int, expected: str) -> list[int]:
        """Whole numbers from the field `start` on. A range is written as its ends and THRU."""
        words = [(i, w.upper()) for i, w in enumerate(self.fields) if i >= start and w]
        numbers: list[int] = []
        through = False
        for i, word in words:
            if word == "THRU" and numbers and not through:
                through = True
                continue
            number = self.whole(i, f"{expected} or THRU")
            numbers += range(numbers[-1] + 1, number + 1) if through else [number]
            through = False
        if through:
            raise self.error(f"expected {expected} after THRU", len(self.fields))
        return numbers


def read_bulk(path: Path) -> tuple[list[BulkCard], list[Line]]:
    """The cards of a deck, or of a file of cards alone, and the lines up to BEGIN BULK.

    Raises
    ------
    ModelError
        A file does not exist; includes are nested too deep; a continuation follows no card; a line
        has too many fields.
    """
    lines = list(_flattened(_read(path, None), path.parent, 0))
    first_line = next((i + 1 for i, line in enumerate(lines) if BEGIN.fullmatch(line.text)), 0)
    cards: list[BulkCard] = []
    goes_on = False
    for line in lines[first_line:]:
        if END.match(line.text):
            break
        if formula := EQUATION.match(line.text):  # which has commas of its own
            cards.append(BulkCard(formula[0].upper(), [""], [line]))
            continue
        if cards and cards[-1].name == "DEQATN" and line.text[:1] in "+* ,":
            continue
        text = continued(line.text, goes_on)
        goes_on = text.rstrip().endswith(",")
        first, fields = fields_of(text)
        if has_more_fields(text):
            raise line.error(MORE_FIELDS)
        if first and first[0] not in "+*":
            cards.append(BulkCard(first.upper().rstrip("*")))
        elif not cards:
            raise line.error(f"expected a card, found '{shortened(line.text)}'")
        cards[-1].fields += fields
        cards[-1].lines += [line] * len(fields)
    return cards, lines[:first_line]


def included(path: Path) -> Iterator[Path]:
    """The files that a deck includes, to any depth; none where one of them cannot be read."""
    try:
        lines = _flattened(_read(path, None), path.parent, 0)
        yield from dict.fromkeys(line.file.path for line in lines if line.file.path != path)
    except ModelError:  # its reader says what is wrong with it
        return


def _read(path: Path, wanted_by: Line | None) -> TextFile:
    """The file without comments."""
    try:
        file = TextFile.read(path)
    except (OSError, EOFError) as error:
        reason = "there is no such file" if not path.exists() else str(error)
        message = f"{path} cannot be read: {reason}"
        raise (ModelError(message) if wanted_by is None else wanted_by.error(message)) from error
    return TextFile(path, [line.split("$", 1)[0].rstrip() for line in file.lines])


def _flattened(file: TextFile, folder: Path, depth: int) -> Iterator[Line]:
    """Lines that are not empty, included files in their places."""
    for index, text in enumerate(file.lines):
        if not text.strip():
            continue
        line, named = Line(file, index), INCLUDE.match(text)
        if named is None:
            yield line
            continue
        if depth == MAX_INCLUDE_DEPTH:
            raise line.error(f"files include each other more than {MAX_INCLUDE_DEPTH} deep")
        name = named["one"] or named["two"] or named["bare"] or ""
        yield from _flattened(_read(folder / name.strip(), line), folder, depth + 1)


FLAT = 1e-10  # A, B and C are on one line if the sine between AB and AC is smaller


class Systems:
    """CORD2R, CORD2C and CORD2S cards by number."""

    def __init__(self, cards: Sequence[BulkCard]) -> None:
        self._cards: dict[int, BulkCard] = {}
        for card in cards:
            number = card.whole(0, "a number of the system")
            if number in self._cards:
                raise card.error(f"there is a coordinate system {number} already")
            self._cards[number] = card
        self._known: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def in_basic(self, card: BulkCard, field: int, x: np.ndarray) -> np.ndarray:
        """Basic coordinates (3,) of the point with coordinates x (3,) in a card's system.

        A field of the card names the system. ModelError where it does not exist, or where systems
        refer to each other.
        """
        return self._basic(card, field, x, ())

    def axes_at(self, card: BulkCard, field: int, x: np.ndarray) -> np.ndarray:
        """Axes of a card's system at x (3,), both in basic coordinates; rows (3, 3).

        A field of the card names the system. ModelError as in `in_basic`, and for a spherical
        system or a point on the axis of a cylindrical one.
        """
        number = card.whole(field, "a coordinate system", 0)
        self._basic(card, field, np.zeros(3), ())
        if number == 0:
            return np.eye(3)
        origin, axes = self._known[number]
        if self._cards[number].name == "CORD2R":
            return axes
        out = x - origin - ((x - origin) @ axes[2]) * axes[2]
        if self._cards[number].name == "CORD2S" or not np.linalg.norm(out) > 0:
            raise card.error(f"axes of the system {number} are not supported there", field)
        out = out / np.linalg.norm(out)
        return np.array([out, np.cross(axes[2], out), axes[2]])

    def _basic(
        self, card: BulkCard, field: int, x: np.ndarray, above: tuple[int, ...]
    ) -> np.ndarray:
        """A point x of a coordinate system in basic coordinates."""
        number = card.whole(field, "a coordinate system", 0)
        if number == 0:
            return x
        if number not in self._cards:
            raise card.error(f"there is no coordinate system {number} (CORD2R, C or S)", field)
        if number in above:
            raise card.error(f"the coordinate system {number} refers to itself", field)
        system = self._cards[number]
        if number not in self._known:
            self._known[number] = self._axes(system, (*above, number))
        origin, axes = self._known[number]
        if system.name == "CORD2R":
            local = x
        elif system.name == "CORD2C":
            r, angle = x[0], np.deg2rad(x[1])
            local = np.array([r * np.cos(angle), r * np.sin(angle), x[2]])
        else:
            r, polar, angle = x[0], np.deg2rad(x[1]), np.deg2rad(x[2])
            flat = r * np.sin(polar)
            local = np.array([flat * np.cos(angle), flat * np.sin(angle), r * np.cos(polar)])
        return origin + local @ axes

    def _axes(self, card: BulkCard, above: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Origin, and the axes as rows, of points A (origin), B (on z) and C (in the xz plane)."""
        abc = np.array([card.real(k, "a coordinate", 0.0) for k in range(2, 11)]).reshape(3, 3)
        a, b, c = (self._basic(card, 1, x, above) for x in abc)
        size = np.linalg.norm(b - a) * np.linalg.norm(c - a)
        if not np.linalg.norm(np.cross(b - a, c - a)) > FLAT * size:
            raise card.error("expected three points that are not on one line")
        z = (b - a) / np.linalg.norm(b - a)
        y = np.cross(z, c - a)
        y /= np.linalg.norm(y)
        return a, np.stack([np.cross(y, z), y, z])
