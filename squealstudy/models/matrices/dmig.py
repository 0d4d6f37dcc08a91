"""Reads matrices from Nastran's DMIG cards: punched files (``.pch``) and bulk data (``.bdf``).

Small, large and free fields (MSC Nastran Quick Reference Guide, DMIG). All other cards are passed
over, so that the file may be a whole deck. PARAM WTMASS of a deck does not multiply the matrices
(same guide, M2GG, remarks).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.matrices.labelled import LabelledMatrix, labelled_matrix
from squealstudy.models.matrices.text import COUNT, TextFile, shortened

CARD = "DMIG"
FIELDS, LARGE_FIELDS = 8, 4  # fields of a line after its first
WIDTH, LARGE_WIDTH, FIRST = 8, 16, 8
SCALED = re.compile(  # a line that multiplies selected matrices: PARAM CK2, or K2GG = 2.0*NAME
    r"\s*PARAM\*?[\s,]+(?P<name>C[KMB]2|CK42)[\s,]+(?P<factor>[^\s,$]+)"
    r"|\s*(?P<command>K42GG|[KMB]2(?:GG|PP))\s*=[^$]*\*",
    re.I,
)
MORE_FIELDS = "more than eight fields behind the name of a card"
FIELDS_PER_ENTRY = 4  # fields of an entry: node, direction, real and imaginary part
SQUARE, SYMMETRIC = 1, 6  # forms
REAL_TYPES = (1, 2)
NUMBER = re.compile(
    r"(?P<digits>[+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd](?P<power>[+-]?\d+)|(?P<bare>[+-]\d+))?",
    re.ASCII,
)


@dataclass
class _Card:
    """Fields of a card after its name, and the line of each."""

    fields: list[str]
    lines: list[int]

    def at(self, field: int) -> str:
        return self.fields[field] if field < len(self.fields) else ""

    def line(self, field: int) -> int:
        return self.lines[min(field, len(self.lines) - 1)]


@dataclass
class _Matrix:
    """Entries of a matrix, as its cards give them."""

    symmetric: bool
    places: list[tuple[int, int, int, int]] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)


def read_dmig(path: Path, name: str | None = None, square: bool = False) -> LabelledMatrix:
    """The matrix of a name, or the only one of a file. If `square`, it may be unsymmetric.

    Raises
    ------
    ModelError
        A card is malformed (with its line); the matrix is rectangular or complex, or
        `labelled_matrix` refuses it; there is no such matrix, or several and no name; the deck
        multiplies matrices by a factor.
    """
    text = TextFile.read(path)
    for k, line in enumerate(text.lines):
        scaled = SCALED.match(line)
        if scaled is not None and not _is_one(scaled["factor"]):
            what = scaled["name"] or scaled["command"]
            raise text.error(k, f"{what.upper()} multiplies matrices: they are read as they stand")
    matrices: dict[str, _Matrix] = {}
    for card in _cards(text):
        _add(text, card, matrices)
    listed = ", ".join(matrices) or "none"
    if not matrices:
        raise ModelError(f"{path} has no DMIG card")
    if name is None and len(matrices) > 1:
        raise ModelError(f"{path} holds the matrices {listed}: expected the name of one")
    chosen = next(iter(matrices)) if name is None else name.upper()
    if chosen not in matrices:
        raise ModelError(f"{path} has no matrix '{name}'; its matrices are {listed}")
    matrix = matrices[chosen]

    def refused(k: int, message: str) -> ModelError:
        return text.error(matrix.lines[k], message)

    if not matrix.values:
        raise ModelError(f"{path}: the matrix {chosen} has no entries")
    entries = np.array(matrix.places, dtype=np.int64)
    values = np.array(matrix.values)
    both_triangles = not matrix.symmetric
    return labelled_matrix(
        entries, values, refused, both_triangles, scalars=True, square=square and both_triangles
    )


def _is_one(factor: str | None) -> bool:
    """Whether the text of a factor is the number 1."""
    match = NUMBER.fullmatch(factor or "")
    return (
        match is not None
        and float(match["digits"]) == 1
        and not int(match["power"] or match["bare"] or 0)
    )


def _cards(text: TextFile) -> Iterator[_Card]:
    """The DMIG cards of a file, with their continuations."""
    card: _Card | None = None
    goes_on = False
    for number, line in enumerate(text.lines):
        plain = line.split("$", 1)[0].rstrip()
        if not plain.strip():
            continue
        plain = continued(plain, goes_on)
        goes_on = plain.endswith(",")
        first, fields = fields_of(plain)
        if first.upper().rstrip("*") == CARD:
            if card is not None:
                yield card
            card = _Card([], [])
        elif first and first[0] not in "+*":
            if card is not None:
                if not first[0].isalpha():
                    raise text.error(number, f"expected a card, found '{shortened(plain)}'")
                yield card
            card = None
        if card is not None:
            if has_more_fields(plain):
                raise text.error(number, MORE_FIELDS)
            card.fields += fields
            card.lines += [number] * len(fields)
    if card is not None:
        yield card


def continued(line: str, goes_on: bool) -> str:
    """A line with its first field empty where one that `goes_on` is continued by data alone."""
    return f",{line}" if goes_on and NUMBER.fullmatch(line.split(",")[0].strip()) else line


def has_more_fields(line: str) -> bool:
    """Whether a line in free fields has data behind its eighth field."""
    beyond = [word.strip() for word in line.split(",")[FIELDS + 1 :]]
    return any(beyond[1:]) or (bool(beyond) and beyond[0][:1] not in ("", "+", "*"))


def fields_of(line: str) -> tuple[str, list[str]]:
    """The first field of a line, and those after it: 8, or 4 large ones."""
    if "," in line:
        first, *others = (word.strip() for word in line.split(","))
        if not line[:FIRST].strip():  # a continuation, whatever it holds
            first, others = "", [first, *others] if first else others
        elif " " in first:  # blanks separate fields as well
            first, *more = first.split()
            others = [*more, *others]
    else:
        line = line.expandtabs(WIDTH)
        first = line[:FIRST].strip()
        others = []
    count = LARGE_FIELDS if "*" in first else FIELDS
    if not others and "," not in line:
        width = LARGE_WIDTH if "*" in first else WIDTH
        others = [line[FIRST + k * width : FIRST + (k + 1) * width].strip() for k in range(count)]
    return first, (others + [""] * count)[:count]


def _add(text: TextFile, card: _Card, matrices: dict[str, _Matrix]) -> None:
    """Add a card to its matrix: its head, or entries of one of its columns."""
    name = card.at(0).upper()
    if not name:
        raise text.error(card.line(0), "expected the name of a matrix")
    if card.at(1) == "0":
        _check_head(text, card)
        if name in matrices:
            raise text.error(card.line(0), f"the matrix {name} has a head already")
        matrices[name] = _Matrix(symmetric=card.at(2) == str(SYMMETRIC))
        return
    if name not in matrices:
        what = f"expected a card with 0 in field 3 before the columns of {name}"
        raise text.error(card.line(0), what)
    matrix = matrices[name]
    column = _whole_number(text, card, 1, "a node"), _whole_number(text, card, 2, "a direction")
    for start in range(FIELDS_PER_ENTRY, len(card.fields), FIELDS_PER_ENTRY):
        if not any(card.fields[start : start + FIELDS_PER_ENTRY]):
            continue
        row = (
            _whole_number(text, card, start, "a node"),
            _whole_number(text, card, start + 1, "a direction"),
        )
        if card.at(start + 3) and _real(text, card, start + 3):
            raise text.error(card.line(start + 3), "expected real values, found an imaginary part")
        matrix.places.append((*row, *column))
        matrix.values.append(_real(text, card, start + 2))
        matrix.lines.append(card.line(start))


def _check_head(text: TextFile, card: _Card) -> None:
    """Raise ModelError unless the head of a matrix states a real square or symmetric one."""
    form, kind = (_whole_number(text, card, k, "a whole number") for k in (2, 3))
    if form not in (SQUARE, SYMMETRIC):
        what = f"expected a square or symmetric matrix (form 1 or 6), found form {form}"
        raise text.error(card.line(2), what)
    if kind not in REAL_TYPES:
        raise text.error(card.line(3), f"expected real values (type 1 or 2), found type {kind}")


def _whole_number(text: TextFile, card: _Card, field: int, expected: str) -> int:
    """A whole number. An empty direction is 0, that of a scalar point."""
    word = card.at(field) or ("0" if expected == "a direction" else "")
    if not COUNT.fullmatch(word):
        raise text.error(card.line(field), f"expected {expected}, found '{shortened(word)}'")
    return int(word)


def _real(text: TextFile, card: _Card, field: int) -> float:
    """A number as Nastran writes it: 1.5-3 and 1.5D-3 are 0.0015."""
    word = card.at(field)
    match = NUMBER.fullmatch(word)
    if match is None:
        raise text.error(card.line(field), f"expected a number, found '{shortened(word)}'")
    number = float(f"{match['digits']}e{match['power'] or match['bare'] or 0}")
    if not np.isfinite(number):
        raise text.error(card.line(field), f"a number too large: '{shortened(word)}'")
    return number
