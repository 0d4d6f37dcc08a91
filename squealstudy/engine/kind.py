"""All that differs between kinds of study, as the runner, the store and the screens use it."""

from __future__ import annotations

import warnings
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
RENAMED_HOOKS = {  # methods of kinds by their names up to version 0.3
    "patience": "seconds_without_workers",
    "ready": "make_models",
    "beside": "side_studies",
    "grown": "extended_plan",
    "build": "make_missing_models",
    "place": "usable_workers",
}


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
        """What is computed, in a word; `as_kind` gives the object."""
        ...

    @property
    def owner(self) -> tuple[str, str, str]:
        """Name, kind and model of the study, by which its results directory is recognised."""
        ...

    @property
    def tasks(self) -> Points:
        """The plan's design points."""
        ...

    @property
    def study_hash(self) -> str:
        """Hash of all that decides the tables."""
        ...


class Kind:
    """A kind of study, with defaults for all methods but those it must define.

    Attributes
    ----------
    name : str
        Name of the kind in study files and manifests.
    description : str
        Description for people.
    section : str
        Name of its own section in the study file; empty where it has none.
    definition : type
        Pydantic model of the whole file.
    tables : tuple of str
        Files of a complete results directory; the first has a row for each design point, with its
        status.
    schema : pyarrow.Schema
        Columns of its chunk files.
    columns : mapping of str -> sequence of Column
        Meaning of its tables' columns, by the files' names without suffix; for the kinds of this
        package they are in `squealstudy.columns`.
    row_word : str
        Word for what a row stands for, in the singular.
    of_methods : bool
        Whether it measures methods, and has no design points of a model of its own.
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

    def __init_subclass__(cls) -> None:
        """Make methods with former names available under today's names, and the other way round."""
        super().__init_subclass__()
        for old, new in RENAMED_HOOKS.items():
            if old in vars(cls):
                text = f"{cls.__name__}.{old} is called {new} now"
                warnings.warn(text, DeprecationWarning, stacklevel=2)
                setattr(cls, new, vars(cls)[old])
            elif new in vars(cls):
                setattr(cls, old, vars(cls)[new])

    @property
    def rows_word(self) -> str:
        """Word for its rows in the plural, for progress."""
        return f"{self.row_word}s"

    # -- the study file --------------------------------------------------------------------------
    def read(self, source: SourceText, tables: Mapping[str, Any]) -> Any:
        """The study that the tables of a file describe; StudyFileError where they are wrong."""
        raise NotImplementedError

    def plan(self, study: Any) -> Planned:
        """The study resolved into its design points; StudyFileError."""
        raise NotImplementedError

    def owner(self, study: Any) -> tuple[str, str, str]:
        """Name, kind and model of a study, by which its results directory is recognised."""
        owner: tuple[str, str, str] = self.plan(study).owner
        return owner

    def n_points(self, study: Any) -> int:
        """Number of design points that a study begins with, without making them; by default 0."""
        return 0

    def check_count(self, study: Any, yes: bool) -> None:
        """Do `check_limit` for the points that a study begins with, before they are made."""

    def check_limit(self, plan: Any, yes: bool) -> None:
        """Raise StudyFileError where there are more design points than the file allows."""

    # -- a run -----------------------------------------------------------------------------------
    def seconds_without_workers(self, plan: Any) -> float:
        """Seconds for which tasks are done in this process, before worker processes are started."""
        return 0.0

    def make_models(self, plan: Any, workers: Workers, warn: Warn) -> tuple[Any, dict[str, str]]:
        """Make the models that all design points need.

        Returns
        -------
        plan
            The plan, or one with better models.
        failures : dict of str -> str
            Reasons why models could not be made, by their keys.

        Raises
        ------
        StudyFileError, SquealstudyError
            Where the models show a mistake in the file, or no model can be made.
        """
        return plan, {}

    def side_studies(self, plan: Any) -> Mapping[str, Planned]:
        """Studies that a run solves before its own, by folders of their results below its own.

        The study in the folder ``variants/a`` is named by this study's name, ``_`` and ``a``.
        """
        return {}

    def extended_plan(self, plan: Any, store: Store) -> Any:
        """The plan with further design points that finished rows ask for, or the same plan."""
        return plan

    def make_missing_models(self, plan: Any, workers: Workers) -> dict[str, str]:
        """Make the models of a plan that are not made yet; by key why some could not be."""
        return {}

    def warnings(self, plan: Any) -> list[str]:
        """Warnings about what may go wrong in a run."""
        return []

    def usable_workers(self, plan: Any, workers: Workers) -> Workers:
        """Workers that can do its tasks, which may need files of this machine."""
        return workers

    def tasks(self, plan: Any, points: Any, workers: Workers) -> Iterable[Any]:
        """Tasks, one for each call of `solve`; what they need is made before the first.

        `points` are some of the plan's (`Points`). There may be a million: yield tasks one by one.
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
        """The same work as tasks of one design point each; they differ in `task.points` alone."""
        if not hasattr(task, "points"):
            return (task.at(np.array([k])) for k in range(len(task)))
        points = task.points
        each = ((p,) for p in points) if isinstance(points, tuple) else self.single_tasks(points)
        return (replace(task, points=point) for point in each)

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
        """The screen of its results; by default their first table."""
        return KindScreen(tuple(Path(name).stem for name in self.tables), self.row_word)

    # -- the manifest ----------------------------------------------------------------------------
    def manifest(self, plan: Any) -> dict[str, Any]:
        """Facts of the study for the manifest, beside those of every study."""
        return {}

    def timings(self, plan: Any, failures: Mapping[str, str]) -> dict[str, float]:
        """Seconds of the stages before the design points."""
        return {}


def as_kind(kind: StudyKind) -> Kind:
    """The kind, as a `Kind`; TypeError for one that does not derive from it."""
    if not isinstance(kind, Kind):
        raise TypeError(f"the kind of study '{kind.name}' does not derive from Kind")
    return kind
