"""What a worker does for the table of onsets: root finding between two design points."""

from __future__ import annotations

from dataclasses import dataclass

from squealstudy.errors import SquealstudyError
from squealstudy.kinds.complex_modes.between import Between
from squealstudy.modes.tracking.onsets import Onset, Samples, refine_onset
from squealstudy.modes.tracking.refinement import Modes

FAILED = "failed"


@dataclass(frozen=True)
class OnsetTask:
    """Onsets of some modes between two design points, for a worker to refine.

    Attributes
    ----------
    rows : list of int
        Of the table.
    places : list of (int, int)
        Place of each mode among those of both ends.
    between : Between
        Around the first point.
    column : int
        Coordinate of the parameter.
    low, high : Modes
        At the first and at the second point, whose coordinate is `end`.
    """

    rows: list[int]
    places: list[tuple[int, int]]
    between: Between
    column: int
    end: float
    low: Modes
    high: Modes
    tolerance: float
    precision: float


def refine_task(task: OnsetTask) -> list[tuple[int, Onset | str]]:
    """Refined onsets by row of the table, or why there is none: the status of an error."""
    start = task.between.x

    def solve(value: float) -> Modes:
        x = start.copy()
        x[task.column] = value
        return task.between.solve(x)

    samples = Samples(
        low=float(start[task.column]),
        at_low=task.low,
        high=task.end,
        at_high=task.high,
        solve=solve,
    )
    found: list[tuple[int, Onset | str]] = []
    for row, places in zip(task.rows, task.places, strict=True):
        try:
            onset = refine_onset(samples, *places, task.tolerance, task.precision)
        except SquealstudyError as error:
            found.append((row, getattr(error, "status", FAILED)))
        else:
            found.append((row, onset))
    return found
