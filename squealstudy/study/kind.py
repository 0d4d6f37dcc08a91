"""What differs between kinds of study; the runner, the store and the screens know only this."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import pyarrow as pa

from squealstudy.study.parallel import Progress, Workers
from squealstudy.study.plan import Plan
from squealstudy.study.tasks import PointTask, Solved

if TYPE_CHECKING:
    import pandas as pd


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

    def accurate(self, plan: Plan, failures: Mapping[str, str], workers: Workers) -> Plan:
        """The plan whose reduced models are good enough for the study; by default as it is."""
        return plan

    def begin(self, plan: Plan) -> None:
        """Begin, in other processes, what can be made beside the structures; `prepare` waits."""
        return

    def prepare(self, plan: Plan, report: Progress) -> None:
        """What must be there before workers start, beside the structures."""
        ...

    def tasks(self, plan: Plan, points: Sequence[PointTask], jobs: int) -> list[Any]:
        """Work for one call of `solve` each."""
        ...

    def solve(self, task: Any) -> Solved:
        """Rows of the design points of a task, in a worker."""
        ...

    def failed_row(self, point_id: str, status: str, message: str) -> dict[str, Any]:
        """Chunk row of a point that could not be solved."""
        ...

    def verify(
        self, plan: Plan, directory: Path, failures: Mapping[str, str], workers: Workers
    ) -> list[dict[str, Any]]:
        """Checks of finished points against a better model, for the manifest."""
        return []

    def build_tables(
        self, plan: Plan, directory: Path, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write the tables from the chunk files; the points' table, and facts for the manifest."""
        ...

    def time_point(self, plan: Plan, task: PointTask) -> float | None:
        """Seconds of one design point on one core; None where it has no working point."""
        ...
