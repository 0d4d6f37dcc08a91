"""A kind of study from outside the package: steady sliding alone, no modes and no motion."""

from __future__ import annotations

import time
from collections.abc import Iterator
from types import MappingProxyType
from typing import Any

import pandas as pd
import pyarrow as pa

from squealstudy.columns import Column
from squealstudy.columns.everywhere import HEAD as HEAD_COLUMNS
from squealstudy.engine.cache import prepared_model
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.model_kind import ModelKind
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import HEAD, REAL, head, planned_rows, points_table, tabled
from squealstudy.engine.store import POINTS, Store
from squealstudy.engine.workers import Solved, Workers
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.modes.point import state_working_point
from squealstudy.study.design import DesignPoint
from squealstudy.study.kinds import register_kind

FIELDS = (("contact_force", REAL), ("largest_pressure", REAL))  # N, Pa
STATIC = "The error of the static solution and of the mesh."
COLUMNS = (
    *HEAD_COLUMNS,
    Column("contact_force", "Normal force of all contact points.", leaves_out=STATIC),
    Column("largest_pressure", "Largest contact pressure.", leaves_out=STATIC),
)


class SteadySliding(ModelKind):
    """Normal force and largest pressure of the contact in steady sliding."""

    name = "steady_sliding"
    description = "steady sliding"
    tables = (POINTS,)
    schema = pa.schema([pa.field(n, t, nullable=False) for n, t in (*HEAD, *FIELDS)])
    columns = MappingProxyType({"points": COLUMNS})

    def tasks(self, plan: Plan, points: DesignPoints, workers: Workers) -> Iterator[Any]:
        """Consecutive points, as many at a time as are solved in some seconds."""
        return workers.pace.parts(points, workers.jobs)

    def solve(self, task: DesignPoints) -> Solved:
        """A row a design point."""
        return Solved([self._row(point) for point in task])

    def _row(self, point: DesignPoint) -> dict[str, Any]:
        started = time.perf_counter()
        prepared = prepared_model(point.structure)
        try:
            found = state_working_point(prepared, point.state())
        except FAILURES as error:
            return self.failed_row(point.point_id, *reason(error))
        forces = prepared.model.area * found.contact_pressure
        return head(point.point_id, time.perf_counter() - started) | {
            "contact_force": float(forces.sum()),
            "largest_pressure": float(found.contact_pressure.max()),
        }

    def build_tables(
        self, plan: Plan, store: Store, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """The points."""
        table = points_table(plan, tabled(planned_rows(plan, store, self.schema), FIELDS))
        store.write_table(POINTS, table)
        return table.to_pandas(), {}


register_kind(SteadySliding())
