"""Definition of a column of result tables: one plain sentence, and its error where known."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from squealstudy.wording import OWN_UNITS, units_of

NUMBERS, TEXTS, FLAGS, LISTS = (
    "numbers",
    "texts",
    "flags",
    "lists of numbers",
)  # what a column may hold
DEFINITION, ERROR, LEAVES_OUT = b"definition", b"error", b"leaves_out"  # keys of field metadata


@dataclass(frozen=True)
class Column:
    """A column, or all whose names fit a pattern.

    Attributes
    ----------
    name : str
        Regular expression that fits the whole name.
    definition : str
        One plain sentence.
    errors : tuple of str
        Columns of the same table that hold its bounds or its error.
    leaves_out : str
        Where there are none: what the number leaves out, or why it needs none.
    holds : str
        NUMBERS, TEXTS, FLAGS or LISTS; empty where that is not said.
    """

    name: str
    definition: str
    errors: tuple[str, ...] = ()
    leaves_out: str = ""
    holds: str = ""

    def fits(self, name: str) -> bool:
        """Whether it describes the column of that name."""
        return self._pattern.fullmatch(name) is not None

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        return re.compile(self.name)

    @property
    def metadata(self) -> dict[bytes, bytes]:
        """The column as metadata of a Parquet field."""
        texts = {DEFINITION: self.definition, ERROR: ", ".join(self.errors)}
        texts[LEAVES_OUT] = self.leaves_out
        return {key: text.encode() for key, text in texts.items() if text}


Tables = Mapping[str, Sequence[Column]]  # of a kind, by the file's name without ending
PARAMETER = Column(
    ".+",
    "Value of this parameter at the design point.",
    leaves_out="It is given, not computed.",
    holds=NUMBERS,
)


def number(name: str, definition: str, *errors: str, leaves_out: str = "") -> Column:
    """A column of numbers, with its error columns or what it leaves out."""
    return Column(name, definition, errors, leaves_out, NUMBERS)


def count(name: str, definition: str) -> Column:
    """A column of whole numbers that are counted or numbered."""
    return Column(name, definition, leaves_out="It is counted: exact.", holds=NUMBERS)


def text(name: str, definition: str) -> Column:
    """A column of texts."""
    return Column(name, definition, holds=TEXTS)


def flag(name: str, definition: str) -> Column:
    """A column that tells whether something is so, or nothing."""
    return Column(name, definition, holds=FLAGS)


def same_in(columns: Sequence[Column], *names: str) -> tuple[Column, ...]:
    """The columns that have these names."""
    by_name = {c.name: c for c in columns}
    return tuple(by_name[name] for name in names)


def unit_of(column: str, table: str = "") -> str | None:
    """Unit of a column that is no parameter; None where it has none, empty for a pure number."""
    return units_of([column], OWN_UNITS.get(table, {})).get(column)


def column_names(pattern: str) -> list[str]:
    """The names that a regular expression of columns means, a star for what varies."""
    choices = re.search(r"\(([^()]*)\)", pattern)
    if choices:
        ends = pattern[: choices.start()], pattern[choices.end() :]
        parts = (ends[0] + choice + ends[1] for choice in choices[1].split("|"))
        return [name for part in parts for name in column_names(part)]
    return [re.sub(r"\\[dw]\+|\.\+", "*", name) for name in pattern.split("|")]
