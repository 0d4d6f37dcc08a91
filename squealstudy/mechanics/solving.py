"""Design points one by one: steady sliding, linearised system, complex modes.

A batch is a loop over the points of each structure, which share its reduction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import nullcontext
from typing import TypeVar

from threadpoolctl import threadpool_limits

from squealstudy.mechanics.failures import FAILURES
from squealstudy.mechanics.reduction import Reduction
from squealstudy.mechanics.structures import Structures
from squealstudy.models.model_point import ModelPoint
from squealstudy.modes.point import (
    linearised_point,
    state_working_point,
)
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.linearise import LinearisedModel

ResultT = TypeVar("ResultT")
Solve = Callable[[ModelPoint, Reduction], ResultT]


def each(structures: Structures, solve: Solve[ResultT], single: bool) -> list[ResultT | Exception]:
    """Result of `solve`, or the error, at each design point in order.

    Raises
    ------
    One of FAILURES
        Where it is a `single` point that fails.
    """
    # matrices are so small that several threads wait for each other and take ten times as long
    meshed = structures.values.definition.meshed
    with threadpool_limits(1) if meshed else nullcontext():
        by_number = dict(_solved(structures, solve, single))
    return [by_number[number] for number in range(structures.values.count)]


def _solved(
    structures: Structures, solve: Solve[ResultT], single: bool
) -> Iterator[tuple[int, ResultT | Exception]]:
    """Yield number and result or error of each design point; a single one raises its error."""
    for first, numbers in structures.values.of_structures():
        try:
            reduction = structures.reduction(first, numbers)
        except FAILURES as error:
            if single:
                raise
            yield from ((int(number), error) for number in numbers)
            continue
        for number in numbers:
            try:
                yield int(number), solve(structures.values.point(int(number)), reduction)
            except FAILURES as error:
                if single:
                    raise
                yield int(number), error


def sliding(point: ModelPoint, reduction: Reduction) -> WorkingPoint:
    """Steady sliding; ConvergenceError where there is none."""
    return state_working_point(reduction.prepared, point.state())


def linearised(point: ModelPoint, reduction: Reduction) -> tuple[WorkingPoint, LinearisedModel]:
    """The system about steady sliding."""
    return linearised_point(reduction.prepared, point.state())
