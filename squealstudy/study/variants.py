"""The study an experiment is made on, and variants of it with some keys changed."""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from squealstudy.errors import StudyFileError
from squealstudy.study.definition import Study, resolve_study
from squealstudy.study.source import SourceText, parse_toml, read_text

PLACE = re.compile(r"(?P<name>\w+)\[(?P<number>\d+)\]")
Changes = Mapping[str, Any]  # dotted key of the study file -> value


@dataclass(frozen=True)
class BaseStudy:
    """A study file as it stands.

    Attributes
    ----------
    source : SourceText
    tables : mapping
        Its TOML.
    study : Study
        Checked and resolved, nothing changed.
    """

    source: SourceText
    tables: Mapping[str, Any]
    study: Study

    def variant(self, changes: Changes) -> Study:
        """The study with other values of some keys; StudyFileError about one it cannot take."""
        return resolve_study(self.source, changed(self.source, self.tables, changes))


def read_base(path: Path) -> BaseStudy:
    """Read and check a study file that an experiment is made on; StudyFileError."""
    source = SourceText(path, read_text(path))
    tables = parse_toml(path, source.text)
    return BaseStudy(source, tables, resolve_study(source, tables))


def changed(source: SourceText, tables: Mapping[str, Any], changes: Changes) -> dict[str, Any]:
    """A copy of a file's tables with other values of some keys; StudyFileError where one cannot be.

    A value of None takes the key out of the file.
    """
    copied = copy.deepcopy(dict(tables))
    for key, value in changes.items():
        try:
            _set_key(copied, key, value)
        except KeyError as error:
            message = f"'{error.args[0]}' is no table of single keys in this file"
            raise StudyFileError(message, source.path, key) from None
    return copied


def _set_key(tables: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key, ``transient.step``, in nested tables; tables on the way are made.

    A key that the file writes in quotes, dots and all, is the one that is set. ``sweep[1].num`` is
    that of the first of several tables of a name.
    """
    name, _, rest = key.partition(".")
    if key in tables or not rest:
        if value is None:
            tables.pop(key, None)
        else:
            tables[key] = value
        return
    if place := PLACE.fullmatch(name):
        listed = tables.get(place["name"])
        number = int(place["number"])
        if not isinstance(listed, list) or not 1 <= number <= len(listed):
            raise KeyError(name)
        _set_key(listed[number - 1], rest, value)
        return
    inner = tables.setdefault(name, {})
    if not isinstance(inner, dict):
        raise KeyError(name)
    _set_key(inner, rest, value)
