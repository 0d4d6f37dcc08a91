"""Definitions of columns in result tables: a sentence, and the error where it is known."""

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
    """Definition of a column, or of all columns whose names match a pattern.

    Attributes
    ----------
    name : str
        Regular expression that matches the whole name.
    definition : str
        One sentence in plain words.
    errors : tuple of str
        Columns of the same table that hold its bounds or its error.
    leaves_out : str
        Without such columns: what the number leaves out, or why it needs no error.
    holds : str
        NUMBERS, TEXTS, FLAGS or LISTS; empty if it may be any.
    """

    name: str
    definition: str
    errors: tuple[str, ...] = ()
    leaves_out: str = ""
    holds: str = ""

    def fits(self, name: str) -> bool:
        """Whether it defines the column of that name."""
        return self._pattern.fullmatch(name) is not None

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        return re.compile(self.name)

    @property
    def metadata(self) -> dict[bytes, bytes]:
        """The definition as metadata of a Parquet field."""
        texts = {DEFINITION: self.definition, ERROR: ", ".join(self.errors)}
        texts[LEAVES_OUT] = self.leaves_out
        return {key: text.encode() for key, text in texts.items() if text}


Tables = Mapping[str, Sequence[Column]]  # columns of a kind's tables, by file name without ending
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
    """A column that is true, false or missing."""
    return Column(name, definition, holds=FLAGS)


def same_in(columns: Sequence[Column], *names: str) -> tuple[Column, ...]:
    """The columns that have these names."""
    by_name = {c.name: c for c in columns}
    return tuple(by_name[name] for name in names)


def unit_of(column: str, table: str = "") -> str | None:
    """Unit of a column that is no parameter; empty for a pure number, None if it is no number."""
    return units_of([column], OWN_UNITS.get(table, {})).get(column)


def column_names(pattern: str) -> list[str]:
    """The names that a regular expression of columns matches, with a star for what varies."""
    choices = re.search(r"\(([^()]*)\)", pattern)
    if choices:
        ends = pattern[: choices.start()], pattern[choices.end() :]
        parts = (ends[0] + choice + ends[1] for choice in choices[1].split("|"))
        return [name for part in parts for name in column_names(part)]
    return [re.sub(r"\\[dw]\+|\.\+", "*", name) for name in pattern.split("|")]
