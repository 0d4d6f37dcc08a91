"""Protocols of a kind of study, for study files, plans and tables.

`engine.kind.Kind` and `engine.model_kind.ModelKind`, which kinds derive from, say more: how their
design points are solved and shown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    import pyarrow as pa
    from pydantic import BaseModel

    from squealstudy.columns import Tables
    from squealstudy.study.sections import StudyDefinition
    from squealstudy.study.source import SourceText


class ScreenFacts(Protocol):
    """The tables that results of a kind have, and the columns they need; see `KindScreen`."""

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the tables."""
        ...

    @property
    def added_tables(self) -> tuple[str, ...]:
        """Tables of the kind that results of earlier versions do not have."""
        ...

    @property
    def row_word(self) -> str:
        """Word for a row of the first table, in the singular."""
        ...

    @property
    def unfinished(self) -> bool:
        """Whether results can be read while a later run of the study is not finished."""
        ...

    @property
    def needs(self) -> Mapping[str, Sequence[str]]:
        """Columns by table without which nothing can be shown."""
        ...


class StudyKind(Protocol):
    """A kind of study; see `Kind`."""

    @property
    def name(self) -> str:
        """Name as study files and manifests spell it."""
        ...

    @property
    def description(self) -> str:
        """What it computes, in a sentence."""
        ...

    @property
    def section(self) -> str:
        """Name of its own table in study files; empty where it has none."""
        ...

    @property
    def definition(self) -> type[BaseModel]:
        """Model of the whole file."""
        ...

    @property
    def tables(self) -> tuple[str, ...]:
        """Files of a complete results directory."""
        ...

    @property
    def schema(self) -> pa.Schema:
        """Schema of its chunk files."""
        ...

    @property
    def columns(self) -> Tables:
        """Definitions of the columns of its tables."""
        ...

    @property
    def row_word(self) -> str:
        """Word for a row, in the singular."""
        ...

    @property
    def of_methods(self) -> bool:
        """Whether it measures methods, and has no design points of a model of its own."""
        ...

    @property
    def screen(self) -> ScreenFacts:
        """The screen of its results."""
        ...

    def read(self, source: SourceText, tables: Mapping[str, Any]) -> Any:
        """The study that the tables of a file describe; StudyFileError where they are wrong."""
        ...


class ModelStudyKind(StudyKind, Protocol):
    """A kind whose design points are those of a model; see `ModelKind`."""

    @property
    def definition(self) -> type[StudyDefinition]:
        """Model of the whole file."""
        ...

    @property
    def file_defaults(self) -> Mapping[str, Mapping[str, Any]]:
        """Defaults, by table and key, that differ from those of a study of complex modes."""
        ...

    @property
    def begins_with(self) -> Mapping[str, float]:
        """Values of parameters in a study to start from."""
        ...

    @property
    def start(self) -> Mapping[str, Any]:
        """Further sections of a study to start from."""
        ...

    @property
    def short(self) -> Mapping[str, Sequence[str]]:
        """Keys of sections that matter most."""
        ...

    @property
    def tells_reduction(self) -> bool:
        """Whether its tables tell the error of the reduction, against a finer model."""
        ...

    @property
    def chooses_rung(self) -> bool:
        """Whether its design points are solved by a rung of reanalysis."""
        ...

    @property
    def has_fidelity(self) -> bool:
        """Whether its settings can be chosen by `[fidelity]`."""
        ...

    @property
    def needs_contact(self) -> bool:
        """Whether it needs contact, so that it cannot be of a family of matrices."""
        ...

    def resolver(self, study: Any) -> Callable[[dict[str, Any]], dict[str, Any]]:
        """Function that fills in values of design points which follow from the whole study."""
        ...

    def identity(self, plan: Any) -> list[Any]:
        """All that a design point's row depends on besides its structure and values."""
        ...

    def table_identity(self, plan: Any) -> list[Any]:
        """All that the tables depend on besides the rows."""
        ...

    def stacks(self, plan: Any) -> bool:
        """Whether it solves the points of a plan as a batch of small models."""
        ...

    def begin(self, plan: Any) -> None:
        """Start, in other processes, preparations that can run while structures are made."""
        ...
