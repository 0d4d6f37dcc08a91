"""The study an experiment is made on, and variants of it with some keys changed."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from squealstudy.errors import StudyFileError
from squealstudy.study.definition import Study, resolve_study
from squealstudy.study.source import SourceText, parse_toml, read_text

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
        tables = copy.deepcopy(dict(self.tables))
        for key, value in changes.items():
            try:
                set_key(tables, key, value)
            except KeyError as error:
                message = f"'{error.args[0]}' is no table of single keys in this file"
                raise StudyFileError(message, self.source.path, key) from None
        return resolve_study(self.source, tables)


def read_base(path: Path) -> BaseStudy:
    """Read and check a study file that an experiment is made on; StudyFileError."""
    source = SourceText(path, read_text(path))
    tables = parse_toml(path, source.text)
    return BaseStudy(source, tables, resolve_study(source, tables))


def set_key(tables: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key, ``transient.step``, in nested tables; tables on the way are made.

    A key that the file writes in quotes, dots and all, is the one that is set.
    """
    name, _, rest = key.partition(".")
    if key in tables or not rest:
        tables[key] = value
        return
    inner = tables.setdefault(name, {})
    if not isinstance(inner, dict):
        raise KeyError(name)
    set_key(inner, rest, value)
