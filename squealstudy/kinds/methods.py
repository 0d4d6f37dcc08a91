"""Common parts of the kinds that measure methods: their file, and whose results it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from pydantic import BaseModel, Field

from squealstudy.engine.keys import ID_TYPE, content_hash
from squealstudy.engine.kind import Kind
from squealstudy.errors import StudyFileError
from squealstudy.study.section import NamedSection
from squealstudy.study.source import SourceText
from squealstudy.study.toml_text import KeyPath

Definition = TypeVar("Definition", bound=BaseModel)


class MethodsStudySection(NamedSection):
    """Section [study] of a study of methods."""

    kind: str = Field(description="error against time of methods, or where a method fails")


@dataclass(frozen=True)
class MethodsFile(Generic[Definition]):
    """The file of a study of methods, as pydantic has checked it."""

    kind: Kind
    source: SourceText
    definition: Definition

    def error(self, keys: KeyPath, message: str) -> StudyFileError:
        """The error to raise about a key of the file."""
        return self.source.error(keys, message)


@dataclass(frozen=True)
class Run:
    """Stand-in for a design point: a cell of a map, or a measurement."""

    point_id: str
    content: Any


class Runs(tuple[Run, ...]):
    """Runs in their order."""

    @property
    def ids(self) -> np.ndarray:
        """Id (n,) of each, 16 bytes."""
        return np.array([run.point_id for run in self], dtype=ID_TYPE)

    def at(self, rows: np.ndarray) -> Runs:
        """The runs at these rows (m,) of all."""
        return Runs(self[i] for i in rows.tolist())


@dataclass(frozen=True)
class MethodsPlan:
    """A study of methods resolved into its runs.

    Attributes
    ----------
    study : MethodsFile
        Of the kind: what its `read` made of the file.
    model : str
        What its methods are tried on.
    tasks : Runs
    facts : sequence of (str, str)
        Name and value of what `check` says.
    content : Any
        What the kind made of the file.
    """

    study: Any
    model: str
    tasks: Runs
    facts: Sequence[tuple[str, str]]
    content: Any

    @property
    def kind(self) -> Kind:
        """The kind of study."""
        return self.study.kind

    @property
    def owner(self) -> tuple[str, str, str]:
        """Name, kind and model: whose results directory it is."""
        return self.study.definition.study.name, self.kind.name, self.model

    @property
    def study_hash(self) -> str:
        """Hash of all that decides the tables."""
        return content_hash([self.tasks.ids.astype(str).tolist(), self.study.source.text])
