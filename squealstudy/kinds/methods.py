"""Common parts of the kinds of study that measure methods: their file, runs and plan."""

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
    """The checked file of a study of methods."""

    kind: Kind
    source: SourceText
    definition: Definition

    def error(self, keys: KeyPath, message: str) -> StudyFileError:
        """The error to raise about a key of the file."""
        return self.source.error(keys, message)


@dataclass(frozen=True)
class Run:
    """What such studies have in place of a design point: a cell of a map, or a measurement."""

    point_id: str
    content: Any


class Runs(tuple[Run, ...]):
    """Runs in their order."""

    @property
    def ids(self) -> np.ndarray:
        """Ids (n,) of the runs, of 16 bytes each."""
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
        The study's file, as the kind's `read` returned it.
    model : str
        Name of the model or case on which methods are tried.
    tasks : Runs
        The runs.
    facts : sequence of (str, str)
        Name and text of each fact that `check` prints.
    content : Any
        What else the kind needs of the file.
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
        """Name, kind and model of the study, by which a results directory belongs to it."""
        return self.study.definition.study.name, self.kind.name, self.model

    @property
    def study_hash(self) -> str:
        """Hash of all that the tables depend on."""
        return content_hash([self.tasks.ids.astype(str).tolist(), self.study.source.text])
