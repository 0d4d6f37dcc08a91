"""What experiments have in common for the runner and the screens, and which there are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import pyarrow as pa

from squealstudy.study.experiments.definition import Experiment, PrecisionFile
from squealstudy.study.parallel import Workers

if TYPE_CHECKING:
    import pandas as pd


class ExperimentKind(Protocol):
    """One experiment, checked: its runs by name, in the order in which they are made."""

    tables: tuple[str, ...]
    in_parallel: bool  # or each run alone on the machine, to be timed

    @property
    def schema(self) -> pa.Schema:
        """Of the chunk files."""
        ...

    def facts(self) -> list[tuple[str, str]]:
        """Name and value of what `check` says."""
        ...

    def prepare(self, workers: Workers) -> None:
        """What must be there before the first run."""
        ...

    def runs(self) -> list[Any]:
        """What `solve` takes, one after the other."""
        ...

    def ids(self, run: Any) -> list[str]:
        """Rows of a run's chunk file."""
        ...

    def solve(self, run: Any) -> list[dict[str, Any]]:
        """Make one run: the rows of its chunk file."""
        ...

    def build_tables(self, directory: Path) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write the tables; the one with a row a run or cell, and facts for the manifest."""
        ...


def experiment_kind(experiment: Experiment) -> ExperimentKind:
    """The experiment, resolved; StudyFileError where it cannot be made."""
    if isinstance(experiment, PrecisionFile):
        from squealstudy.study.experiments.work_precision.kind import WorkPrecision

        return WorkPrecision(experiment)
    from squealstudy.study.experiments.method_stability.kind import MethodStability

    return MethodStability(experiment)
