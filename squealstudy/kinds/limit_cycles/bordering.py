"""Folds and Hopf points of branches continued over a second swept parameter: borders of verdicts.

Workers follow them after all branches are solved, one task for each plane of the two parameters.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from squealstudy.cycles.borders import BorderPoint, fold_near, follow_border
from squealstudy.cycles.branch import RANGE
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.folds import FOLD
from squealstudy.cycles.oscillator import MAX_UNPROJECTED_COORDINATES
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import REAL, TEXT
from squealstudy.engine.rows import WHOLE_NUMBER as COUNT
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.limit_cycles.continued import (
    MAX_FREQUENCY_CHANGE,
    SAME_FOLD_SHARE,
    Mark,
    ended,
)
from squealstudy.kinds.limit_cycles.designs import CyclesRequest, DesignLine
from squealstudy.kinds.limit_cycles.onset import onset_near
from squealstudy.mechanics.failures import FAILURES
from squealstudy.study.design import DesignPoint

BRACKET_HALF_WIDTH = 1e-3  # half-width of the first bracket of an onset, over the range
BORDER_FIELDS = (
    ("border_id", TEXT),
    ("event", TEXT),
    ("n_step", COUNT),
    ("along", TEXT),
    ("value", REAL),
    ("over", TEXT),
    ("over_value", REAL),
    ("line_difference", REAL),
    ("criticality", TEXT),
    ("border_end", TEXT),
    ("frequency_hz", REAL),
    ("torque_rms", REAL),
    ("contact_velocity", REAL),
    ("n_harmonics", COUNT),
    ("balance_residual", REAL),
)


@dataclass(frozen=True)
class PlaneTask:
    """Borders over two parameters, all others fixed.

    Attributes
    ----------
    request : CyclesRequest
    base : DesignPoint
        A design point of the plane.
    along, over : str
        Names of the two parameters.
    bounds : (low, high)
        Range of the first parameter.
    values : tuple of float
        Values of the second one, ascending.
    marks : tuple of (float, Mark)
        Folds and Hopf points of the plane's lines, each after the second parameter's value.
    """

    request: CyclesRequest
    base: DesignPoint
    along: str
    over: str
    bounds: tuple[float, float]
    values: tuple[float, ...]
    marks: tuple[tuple[float, Mark], ...]


def planes(
    plan: Plan, request: CyclesRequest, along: str, over: str, marks: Sequence[Mark]
) -> Iterator[PlaneTask]:
    """Tasks, one for each plane on which branches have folds or Hopf points."""
    tasks = plan.tasks
    swept = [s.name for s in plan.study.sweeps]
    others = np.delete(plan.swept, [swept.index(along), swept.index(over)], axis=1)
    _, plane = np.unique(
        np.column_stack([others, tasks.structure_index]), axis=0, return_inverse=True
    )
    first, second = tasks.column(along), tasks.column(over)
    row_of_point = {tasks[k].point_id: k for k in range(len(first))}
    for number in range(int(plane.max(initial=-1)) + 1):
        on_plane = np.flatnonzero(plane == number)
        marks_and_rows = [(row_of_point[mark.point_id], mark) for mark in marks]
        chosen = [(float(second[k]), mark) for k, mark in marks_and_rows if plane[k] == number]
        if chosen:
            bounds = float(first[on_plane].min()), float(first[on_plane].max())
            values = tuple(float(v) for v in np.unique(second[on_plane]))
            base = tasks[int(on_plane[0])]
            yield PlaneTask(request, base, along, over, bounds, values, tuple(chosen))


def follow_borders(task: PlaneTask) -> tuple[list[dict[str, Any]], list[str]]:
    """Rows of the borders of a plane, each followed once, and messages about failed ones."""
    plane = Plane(task)
    borders: list[tuple[Mark, list[BorderPoint], tuple[str, str]]] = []
    rows, not_followed, differences = [], list[str](), dict[tuple[int, int], float]()
    for over, mark in sorted(task.marks, key=lambda m: (m[1].event, m[0], m[1].motion.parameter)):
        position = plane.place_on_borders(borders, over, mark)
        if position is None:
            try:
                borders.append((mark, *plane.border(over, mark)))
            except FAILURES as error:
                not_followed.append(
                    f"{mark.event} at {task.along} {mark.motion.parameter:g}: {error}"
                )
                continue
            position = plane.place_on_borders(borders, over, mark)
        if position is not None:
            parameter_value = borders[position[0]][1][position[1]].motion.parameter
            differences[position] = parameter_value - mark.motion.parameter
    for number, (mark, points, ends) in enumerate(borders):
        border_rows = [plane.row(mark, k, point) for k, point in enumerate(points)]
        for k, row in enumerate(border_rows):
            row["border_id"] = f"{mark.point_id}-{mark.event}-{number + 1}"
            row["line_difference"] = differences.get((number, k), np.nan)
        border_rows[0]["border_end"], border_rows[-1]["border_end"] = ends
        rows += border_rows
    return rows, not_followed


@dataclass(frozen=True)
class Plane:
    """Folds and Hopf points at values of the second parameter."""

    task: PlaneTask

    @property
    def width(self) -> float:
        """Range of the first parameter."""
        return self.task.bounds[1] - self.task.bounds[0]

    def line(self, over: float) -> DesignLine:
        """The line of designs at a value of the second parameter."""
        task = self.task
        values = {**task.base.values, task.over: over}
        first, last = (task.base.with_values(values | {task.along: v}) for v in task.bounds)
        return DesignLine(task.request, first, last, task.bounds)

    def fold(self, over: float, guess: PeriodicMotion) -> BorderPoint:
        """The fold at a value of the second parameter."""
        line = self.line(over)
        fold = BorderPoint(over, *fold_near(line.oscillator, guess, line.bounds))
        self._inside(fold.motion.parameter)
        if reason := ended(line, fold.motion):
            raise ConvergenceError(reason, "the fold's cycle is too small or too large")
        return fold

    def onset(self, over: float, guess: PeriodicMotion) -> BorderPoint:
        """The Hopf point at a value of the second parameter."""
        onset_value, hz, criticality = onset_near(
            self.line(over), guess, BRACKET_HALF_WIDTH * self.width
        )
        self._inside(onset_value)
        motion = replace(guess, omega=2.0 * np.pi * hz, parameter=onset_value)
        return BorderPoint(over, motion, criticality=criticality)

    def _inside(self, value: float) -> None:
        low, high = self.task.bounds
        if not low <= value <= high:
            raise ConvergenceError(RANGE, "beyond the range of the parameter followed")

    def border(self, over: float, mark: Mark) -> tuple[list[BorderPoint], tuple[str, str]]:
        """The border through a fold or a Hopf point, both ways.

        Raises
        ------
        ConvergenceError
            Where the mark is not found again, or the model is too large.
        """
        if (
            mark.event == FOLD
            and self.line(over).oscillator(mark.motion.parameter).n > MAX_UNPROJECTED_COORDINATES
        ):
            raise ConvergenceError(
                "too_large",
                f"folds of more than {MAX_UNPROJECTED_COORDINATES} coordinates are not continued",
            )
        locate = self.fold if mark.event == FOLD else self.onset
        start = locate(over, mark.motion)
        (down, first), (up, last) = (
            follow_border(locate, start, self.task.values, side, self.width) for side in (-1.0, 1.0)
        )
        return [*down[:0:-1], *up], (first, last)

    def place_on_borders(
        self,
        borders: Sequence[tuple[Mark, list[BorderPoint], tuple[str, str]]],
        over: float,
        mark: Mark,
    ) -> tuple[int, int] | None:
        """Number of the border that passes a mark of a line, and index of its point; or None."""
        for number, (border_mark, points, _) in enumerate(borders):
            for k, point in enumerate(points if border_mark.event == mark.event else []):
                is_near = (
                    abs(point.motion.parameter - mark.motion.parameter)
                    < SAME_FOLD_SHARE * self.width
                )
                has_same_frequency = (
                    abs(point.motion.omega / mark.motion.omega - 1.0) < MAX_FREQUENCY_CHANGE
                )
                if point.over == over and is_near and has_same_frequency:
                    return number, k
        return None

    def row(self, mark: Mark, k: int, point: BorderPoint) -> dict[str, Any]:
        """Row of the table of borders."""
        motion, levels = point.motion, {"torque_rms": 0.0, "contact_velocity": 0.0}
        if mark.event == FOLD:
            all_levels = self.line(point.over).contact(motion.parameter).levels(motion)
            levels = {name: all_levels[name] for name in levels}
        return {
            "point_id": mark.point_id,
            "event": mark.event,
            "n_step": k,
            "along": self.task.along,
            "value": motion.parameter,
            "over": self.task.over,
            "over_value": point.over,
            "criticality": point.criticality,
            "border_end": "",
            "frequency_hz": motion.omega / (2.0 * np.pi),
            "n_harmonics": motion.harmonics if mark.event == FOLD else 0,
            "balance_residual": point.residual,
            **levels,
        }
