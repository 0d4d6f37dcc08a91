"""What differs between kinds of study; the runner, the store and the screens know only this."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import pyarrow as pa
from pydantic import BaseModel

from squealstudy.engine.parallel import Workers
from squealstudy.engine.tasks import Solved
from squealstudy.study.source import SourceText

if TYPE_CHECKING:
    import pandas as pd

    from squealstudy.engine.kind_screen import KindScreen
    from squealstudy.engine.measurement import Measuring

Warn = Callable[[str], None]


class Identified(Protocol):
    """A design point, or what stands for one: it has a row of its own."""

    @property
    def point_id(self) -> str:
        """Hash of all that decides its row."""
        ...


class Planned(Protocol):
    """A study resolved into what has to be solved."""

    @property
    def kind(self) -> Kind:
        """What is computed."""
        ...

    @property
    def owner(self) -> tuple[str, str, str]:
        """Name, kind and model of the study: whose results directory it is."""
        ...

    @property
    def tasks(self) -> Sequence[Identified]:
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
    rows_word : str
        What its rows are, for progress.
    of_methods : bool
        It measures methods, and has no design points of a model of its own.
    """

    name: str
    description: str
    section: str = ""
    definition: type[BaseModel]
    tables: tuple[str, ...]
    schema: pa.Schema
    rows_word: str = "design points"
    of_methods: bool = False

    # -- the study file --------------------------------------------------------------------------
    def read(self, source: SourceText, tables: Mapping[str, Any]) -> Any:
        """The study that the tables of a file describe; StudyFileError where they are wrong."""
        raise NotImplementedError

    def plan(self, study: Any) -> Planned:
        """The study resolved into its design points; StudyFileError."""
        raise NotImplementedError

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

    def grown(self, plan: Any, directory: Path) -> Any:
        """The plan with all design points that the finished ones ask for; else the plan itself."""
        return plan

    def build(self, plan: Any, workers: Workers) -> dict[str, str]:
        """Make the models that a plan which has grown needs besides; reasons of failure by key."""
        return {}

    def warnings(self, plan: Any) -> list[str]:
        """What may go wrong in a run."""
        return []

    def tasks(self, plan: Any, points: Sequence[Any], workers: Workers) -> list[Any]:
        """Work for one call of `solve` each, and whatever that needs made first."""
        raise NotImplementedError

    def solve(self, task: Any) -> Solved:
        """Rows of the design points of a task, in a worker."""
        raise NotImplementedError

    def unsolvable(self, plan: Any, point: Any, failures: Mapping[str, str]) -> str:
        """Why a design point cannot be solved; empty where it can."""
        return ""

    def failed_row(self, point_id: str, status: str, message: str) -> dict[str, Any]:
        """Row of a design point that could not be solved."""
        raise NotImplementedError

    def verify(
        self, plan: Any, directory: Path, failures: Mapping[str, str], workers: Workers
    ) -> list[dict[str, Any]]:
        """Checks of finished points against a better model, for the manifest."""
        return []

    def build_tables(
        self, plan: Any, directory: Path, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write the tables from the chunk files; the first of them, and facts for the manifest."""
        raise NotImplementedError

    def measuring(self) -> Measuring | None:
        """How methods are timed on studies of this kind; None where they cannot be."""
        return None

    @property
    def screen(self) -> KindScreen:
        """What is shown of its results; without more than this, its first table."""
        from squealstudy.engine.kind_screen import KindScreen

        return KindScreen(tuple(Path(name).stem for name in self.tables), self.rows_word)

    # -- what is said of it ----------------------------------------------------------------------
    def manifest(self, plan: Any) -> dict[str, Any]:
        """Facts of the study for the manifest, beside those of every study."""
        return {}

    def timings(self, plan: Any, failures: Mapping[str, str]) -> dict[str, float]:
        """Seconds of the stages before the design points."""
        return {}
