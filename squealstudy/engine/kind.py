"""What differs between kinds of study; the runner, the store and the screens know only this."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np
import pyarrow as pa
from pydantic import BaseModel

from squealstudy.columns import Tables
from squealstudy.engine.kind_screen import KindScreen
from squealstudy.engine.rows import failed_row
from squealstudy.engine.workers import Solved, Workers
from squealstudy.study.kind_protocols import StudyKind
from squealstudy.study.kinds import file_of_kind
from squealstudy.study.source import SourceText

if TYPE_CHECKING:
    import pandas as pd

    from squealstudy.engine.measurement import Measuring
    from squealstudy.engine.store import Store


Warn = Callable[[str], None]


class Identified(Protocol):
    """A design point, or what stands for one: it has a row of its own."""

    @property
    def point_id(self) -> str:
        """Hash of all that decides its row."""
        ...


class Points(Protocol):
    """Design points, or what stands for them, in their order."""

    @property
    def ids(self) -> np.ndarray:
        """Id (n,) of each, 16 bytes."""
        ...

    def at(self, rows: np.ndarray) -> Points:
        """The points at these rows (m,) of all."""
        ...

    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[Identified]: ...


class Planned(Protocol):
    """A study resolved into what has to be solved."""

    @property
    def kind(self) -> StudyKind:
        """What is computed; `as_kind` has all of it."""
        ...

    @property
    def owner(self) -> tuple[str, str, str]:
        """Name, kind and model of the study: whose results directory it is."""
        ...

    @property
    def tasks(self) -> Points:
        """Its design points."""
        ...

    @property
    def study_hash(self) -> str:
        """Hash of all that decides the tables."""
        ...


class Kind:
    """A kind of study; what it does not say it does without.

    Attributes
    ----------
    name : str
        As study files and manifests spell it.
    description : str
    section : str
        Its own table of the study file; empty where it has none.
    definition : type
        Pydantic model of the whole file.
    tables : tuple of str
        Files of a complete results directory; the first has a row a design point, with its status.
    schema : pyarrow.Schema
        Of its chunk files.
    columns : mapping of str -> sequence of Column
        What the numbers of its tables mean, by their files' names without ending; of the package's
        own kinds they stand in `squealstudy.columns`.
    row_word : str
        What a row is, in the singular.
    of_methods : bool
        It measures methods, and has no design points of a model of its own.
    """

    name: str
    description: str
    section: str = ""
    definition: type[BaseModel]
    tables: tuple[str, ...]
    schema: pa.Schema
    columns: Tables = MappingProxyType({})
    row_word: str = "design point"
    of_methods: bool = False

    @property
    def rows_word(self) -> str:
        """What its rows are, for progress."""
        return f"{self.row_word}s"

    # -- the study file --------------------------------------------------------------------------
    def read(self, source: SourceText, tables: Mapping[str, Any]) -> Any:
        """The study that the tables of a file describe; StudyFileError where they are wrong."""
        raise NotImplementedError

    def plan(self, study: Any) -> Planned:
        """The study resolved into its design points; StudyFileError."""
        raise NotImplementedError

    def owner(self, study: Any) -> tuple[str, str, str]:
        """Name, kind and model of a study: whose results directory it is."""
        owner: tuple[str, str, str] = self.plan(study).owner
        return owner

    def n_points(self, study: Any) -> int:
        """Number of design points that a study begins with, without making them; 0 of methods."""
        return 0

    def check_count(self, study: Any, yes: bool) -> None:
        """As `check_limit`, of the points that a study begins with, before they are made."""

    def check_limit(self, plan: Any, yes: bool) -> None:
        """Raise StudyFileError where there are more design points than the file allows."""

    # -- a run -----------------------------------------------------------------------------------
    def patience(self, plan: Any) -> float:
        """Seconds for which work is done without workers, which take longer to start."""
        return 0.0

    def ready(self, plan: Any, workers: Workers, warn: Warn) -> tuple[Any, dict[str, str]]:
        """Make what all design points need.

        Returns
        -------
        plan
            Perhaps with better models than before.
        failures : dict of str -> str
            Keys of models that could not be made, with the reasons.

        Raises
        ------
        StudyFileError, SquealstudyError
            For what only the models show of the file; where none can be made.
        """
        return plan, {}

    def beside(self, plan: Any) -> Mapping[str, Planned]:
        """Studies that are run before it, by the folders of their results below its own.

        A folder ``variants/a`` is that of the study of its name, ``_`` and ``a``.
        """
        return {}

    def grown(self, plan: Any, store: Store) -> Any:
        """The plan with all design points that the finished ones ask for; else the plan itself."""
        return plan

    def build(self, plan: Any, workers: Workers) -> dict[str, str]:
        """Make the models that a plan which has grown needs besides; reasons of failure by key."""
        return {}

    def warnings(self, plan: Any) -> list[str]:
        """What may go wrong in a run."""
        return []

    def place(self, plan: Any, workers: Workers) -> Workers:
        """Those of the workers that can do its tasks: they may need files of this machine."""
        return workers

    def tasks(self, plan: Any, points: Any, workers: Workers) -> Iterable[Any]:
        """Work for one call of `solve` each, and whatever that needs made first.

        `points` are some of the plan's (`Points`). A million of them are many tasks: they are
        best made as they are drawn.
        """
        raise NotImplementedError

    def solve(self, task: Any) -> Solved:
        """Rows of the design points of a task, in a worker."""
        raise NotImplementedError

    def unsolvable(self, plan: Any, points: Any, failures: Mapping[str, str]) -> dict[str, str]:
        """Why design points cannot be solved, by the ids of those that cannot."""
        return {}

    def points_of(self, task: Any) -> Iterable[Identified]:
        """The design points of a task: its `points`, or itself."""
        points: Iterable[Identified] = getattr(task, "points", task)
        return points

    def single_tasks(self, task: Any) -> Iterable[Any]:
        """The same work as tasks of one design point each; `task.points` is all that differs."""
        if not hasattr(task, "points"):
            return (task.at(np.array([k])) for k in range(len(task)))
        points = task.points
        each = ((p,) for p in points) if isinstance(points, tuple) else self.single_tasks(points)
        return (replace(task, points=one) for one in each)

    def failed_row(self, point_id: str, status: str, message: str) -> dict[str, Any]:
        """Row of a design point that could not be solved."""
        return failed_row(self.schema, point_id, status, message)

    def verify(
        self, plan: Any, store: Store, failures: Mapping[str, str], workers: Workers
    ) -> list[dict[str, Any]]:
        """Checks of finished points against a better model, for the manifest."""
        return []

    def build_tables(
        self, plan: Any, store: Store, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write the tables from the chunk files; the first of them, and facts for the manifest."""
        raise NotImplementedError

    def measuring(self) -> Measuring | None:
        """How methods are timed on studies of this kind; None where they cannot be.

        By default `MEASURING` of the file ``measuring.py`` in the folder of a kind of the package.
        """
        module = file_of_kind(self.name, "measuring")
        return None if module is None else cast("Measuring", module.MEASURING)

    @property
    def screen(self) -> KindScreen:
        """What is shown of its results; without more than this, its first table."""
        return KindScreen(tuple(Path(name).stem for name in self.tables), self.row_word)

    # -- what is said of it ----------------------------------------------------------------------
    def manifest(self, plan: Any) -> dict[str, Any]:
        """Facts of the study for the manifest, beside those of every study."""
        return {}

    def timings(self, plan: Any, failures: Mapping[str, str]) -> dict[str, float]:
        """Seconds of the stages before the design points."""
        return {}


def as_kind(kind: StudyKind) -> Kind:
    """A kind with all that a run asks of it; TypeError for one that does not derive from Kind."""
    if not isinstance(kind, Kind):
        raise TypeError(f"the kind of study '{kind.name}' does not derive from Kind")
    return kind
