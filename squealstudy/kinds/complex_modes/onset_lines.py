"""Lines of design points on which the onset of instability is measured, as a study finds it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from squealstudy.engine.method import Method
from squealstudy.engine.names import onset_parameter
from squealstudy.engine.parallel import Workers
from squealstudy.engine.plan import Plan
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.complex_modes.between import Neighbourhoods
from squealstudy.kinds.complex_modes.columns import read_columns
from squealstudy.kinds.complex_modes.counts import settled
from squealstudy.kinds.complex_modes.followed import follow_modes
from squealstudy.kinds.complex_modes.onsets import UNREFINED
from squealstudy.study.design import DesignPoint
from squealstudy.tables.crossings import FIRST_SEEN, INTO

Interval = tuple[float | None, float | None, float | None]  # value, bounds; None without one


class LinePlan(Plan):
    """Some design points of a plan that differ in the onset's parameter alone.

    Their identities, structures and method are those that they have in the whole plan.

    Parameters
    ----------
    whole : Plan
    rows : sequence of int
        Positions of the points among the whole plan's.
    """

    def __init__(self, whole: Plan, rows: Sequence[int]) -> None:
        super().__init__(whole.study, [whole.swept[i] for i in rows], whole.enriched)
        self.whole, self._rows = whole, tuple(rows)

    @property
    def along(self) -> str:
        """The parameter along which the onset is sought."""
        name = onset_parameter([sweep.name for sweep in self.study.sweeps])
        assert name is not None
        return name

    @cached_property
    def method(self) -> Method:
        """As the whole plan's points are solved."""
        return self.whole.method

    @cached_property
    def tasks(self) -> tuple[DesignPoint, ...]:
        """Identity and structure of each point."""
        return tuple(self.whole.tasks[i] for i in self._rows)

    @property
    def grid_shape(self) -> tuple[int, ...]:
        """A grid of one line."""
        return tuple(
            len(self._rows) if sweep.name == self.along else 1 for sweep in self.study.sweeps
        )


def find_onset(plan: LinePlan, directory: Path) -> tuple[Interval, float]:
    """The first onset on a line whose points are solved in a directory, and the range searched.

    Raises
    ------
    ConvergenceError
        Where a point of the line has no modes: the onset may lie there.
    """
    columns = read_columns(directory, [task.point_id for task in plan.tasks])
    points = columns.points.select(["point_id", "status", "message"]).to_pandas()
    try:
        bad = points[points["status"] != "ok"]
        if len(bad):
            raise ConvergenceError(bad["status"].iloc[0], bad["message"].iloc[0])
        for name in plan.study.shown_parameters:
            points[name] = [float(v[name]) for v in plan.shown_values]
        judged = settled(columns.lam, columns.error_rung, plan.method.tolerance)
        near = Neighbourhoods(plan, plan.whole)
        error = columns.error_rung
        found = follow_modes(plan, columns, points, judged, error, Workers(), near)
    finally:
        if columns.shapes is not None:
            columns.shapes.remove()
    assert found.onsets is not None
    x = np.sort(points[plan.along].to_numpy(float))
    return first_onset(found.onsets, x), float(np.ptp(x))


def first_onset(onsets: pd.DataFrame, x: np.ndarray) -> Interval:
    """The smallest onset in a table of one line, with its bounds.

    It is the smallest value of the parameter at which an oscillating mode turns unstable, or the
    first value where one is unstable there already.

    Parameters
    ----------
    onsets : DataFrame
        As `OnsetSearch.table` makes it.
    x : ndarray (n,)
        Values of the parameter, ascending.
    """
    into = onsets[onsets["direction"] == INTO]
    if not len(into):
        return None, None, None
    values = into["onset"].fillna(float(x[0])).to_numpy(float)  # unstable from the beginning on
    row = into.iloc[int(np.argmin(values))]
    value = float(values.min())
    return value, *_bounds(row, value, x)


def _bounds(row: pd.Series, value: float, x: np.ndarray) -> tuple[float, float]:
    """From the onset's own error estimate, or the points between which it lies."""
    if np.isfinite(row["error_estimate"]):
        error = float(row["error_estimate"])
        return value - error, value + error
    if row["status"] == UNREFINED[FIRST_SEEN]:
        return float(x[max(int(np.searchsorted(x, value)) - 1, 0)]), value
    low, high = row["bracket_low"], row["bracket_high"]
    return (float(low), float(high)) if np.isfinite(row["onset"]) else (value, value)
