"""What differs between kinds of study; the runner, the store and the screens know only this."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import pyarrow as pa

from squealstudy.study.plan import Plan
from squealstudy.study.tasks import ChunkReport, PointTask

if TYPE_CHECKING:
    import pandas as pd

Progress = Callable[[str, int, int], None]  # stage, done, total


class Kind(Protocol):
    """One kind of study; it warns of nothing and verifies nothing unless it says how."""

    @property
    def schema(self) -> pa.Schema:
        """Of its chunk files."""
        ...

    @property
    def tables(self) -> tuple[str, ...]:
        """Files of a complete results directory."""
        ...

    def check(self, plan: Plan) -> None:
        """Raise StudyFileError for what only the prepared models show."""
        ...

    def warnings(self, plan: Plan) -> list[str]:
        """What may go wrong in a run, from the prepared model of the first structure."""
        return []

    def accurate(
        self, plan: Plan, failures: Mapping[str, str], jobs: int, report: Progress
    ) -> Plan:
        """The plan whose reduced models are good enough for the study; by default as it is."""
        return plan

    def begin(self, plan: Plan) -> None:
        """Begin, in other processes, what can be made beside the structures; `prepare` waits."""
        return

    def prepare(self, plan: Plan, report: Progress) -> None:
        """What must be there before workers start, beside the structures."""
        ...

    def tasks(
        self, plan: Plan, directory: Path, points: Sequence[PointTask], jobs: int
    ) -> list[Any]:
        """Work for one call of `solve` each."""
        ...

    def solve(self, task: Any) -> ChunkReport:
        """Solve design points in a worker and write their chunk file."""
        ...

    def failed_row(self, point_id: str, status: str, message: str) -> dict[str, Any]:
        """Chunk row of a point that could not be solved."""
        ...

    def verify(
        self, plan: Plan, directory: Path, jobs: int, failures: Mapping[str, str], report: Progress
    ) -> list[dict[str, Any]]:
        """Checks of finished points against a better model, for the manifest."""
        return []

    def build_tables(
        self, plan: Plan, directory: Path, jobs: int, report: Progress
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write the tables from the chunk files; the points' table, and facts for the manifest."""
        ...

    def time_point(self, plan: Plan, task: PointTask) -> float | None:
        """Seconds of one design point on one core; None where it has no working point."""
        ...
