"""Folds and onsets of branches continued over a second parameter.

At one value of the second parameter a fold is found from a motion nearby: the balance at a fixed
size is regular there, and as a function of size the first parameter has an extremum. The border is
then followed along the second parameter. It has a point at each value that is asked for, and ends
where it turns back or is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.cycles.branch import RANGE
from squealstudy.cycles.continuation import newton
from squealstudy.cycles.curve import between
from squealstudy.cycles.equations import BranchEquations, PeriodicMotion
from squealstudy.cycles.moving import Oscillators
from squealstudy.cycles.projection import SIZE_HELD
from squealstudy.errors import ConvergenceError

TURNED = "turned"  # why a border ends: it goes back in the second parameter
ANOTHER = "another"  # another border is all that was found
MET = "hopf"  # a fold whose cycle shrinks to nothing: it meets the border of Hopf points
FOLD_FIRST_STEP = 1e-3  # step of log size between the first two places where a fold is sought
FOLD_TOLERANCE = 1e-6  # tolerance of log size; the parameter is then known to its square
FOLD_MAX_ITERATIONS = 12  # most sizes at which the slope is computed
FOLD_MAX_STEP = 0.2  # largest step of log size
FIRST_STEP, MIN_STEP, MAX_STEP = 0.05, 1e-4, 0.25  # over the range of the second parameter
# The error of a prediction is the distance of a point from the predicted one, over the predicted
# move. Steps grow if it is below the first number; they are halved if it is above the second.
PREDICTION_ERROR_GROW, PREDICTION_ERROR_HALVE = 0.1, 0.4
MIN_PREDICTED_MOVE = 0.02  # a smaller relative distance to the predicted point is always accepted
# a border that cannot be followed turns back if a parabola through its last points turns within so
# many steps
MAX_EXTRAPOLATION_STEPS = 4.0
VANISHING_REL_SIZE = 0.2  # cycles vanish if their size at that turn, over the last size, is smaller


@dataclass(frozen=True, eq=False)
class BorderPoint:
    """A point of a border.

    Attributes
    ----------
    over : float
        Value of the second parameter.
    motion : PeriodicMotion
        Its `parameter` is the value of the first parameter. At a Hopf point it has no size.
    residual : float
        Residual of the balance.
    criticality : str
        What `onset.criticality` says of a Hopf point; empty at a fold.
    """

    over: float
    motion: PeriodicMotion
    residual: float = 0.0
    criticality: str = ""


# the point at a value of the second parameter, found from a motion nearby
Locate = Callable[[float, PeriodicMotion], BorderPoint]


def fold_near(
    oscillators: Oscillators, guess: PeriodicMotion, bounds: tuple[float, float]
) -> tuple[PeriodicMotion, float]:
    """The fold near a cycle, in all coordinates, and the residual of its balance.

    At a fold the parameter does not change with the size of the cycle. The zero of its slope over
    log size is found by secants.

    Parameters
    ----------
    oscillators : callable
        Returns the oscillator at a value of the parameter.
    guess : PeriodicMotion
        A cycle nearby; its `parameter` is the value of the parameter.
    bounds : (low, high)
        Range of the parameter.

    Raises
    ------
    ConvergenceError
        Where no fold is found.
    """
    equations = BranchEquations(oscillators, guess.harmonics, guess.omega, bounds)
    u = equations.pack(guess)
    equations.accepted(u)
    normal = np.zeros(len(u))
    normal[SIZE_HELD] = 1.0
    along, change = np.zeros(len(u)), 0.0
    before = np.nan, np.nan  # log size, slope of the parameter over it
    for _ in range(FOLD_MAX_ITERATIONS):
        u = u + change * along
        u, residual, _, bordered = newton(equations, u, normal, float(u[SIZE_HELD]))
        if abs(change) < FOLD_TOLERANCE and change:
            return equations.motion(u), residual
        along = bordered.tangent / bordered.tangent[SIZE_HELD]
        size, slope = float(u[SIZE_HELD]), float(along[-1])
        bend = (slope - before[1]) / (size - before[0])
        step = -slope / bend if np.isfinite(bend) and bend else FOLD_FIRST_STEP
        change, before = (
            float(np.clip(step, -FOLD_MAX_STEP, FOLD_MAX_STEP)) or 0.5 * FOLD_TOLERANCE,
            (size, slope),
        )
    raise ConvergenceError("not_converged", f"no fold within {FOLD_MAX_ITERATIONS} places")


def follow_border(
    locate: Locate, start: BorderPoint, values: Sequence[float], direction: float, width: float
) -> tuple[list[BorderPoint], str]:
    """Follow a border along the second parameter, from one of its points in one direction.

    Parameters
    ----------
    locate : callable
        Returns the border's point at a value of the second parameter, or raises ConvergenceError.
    start : BorderPoint
    values : sequence of float
        Values of the second parameter at which the border has a point, ascending.
    direction : float
        1 towards larger values, -1 towards smaller ones.
    width : float
        Range of the first parameter, in which steps are measured.

    Returns
    -------
    points : list of BorderPoint
        The start first.
    end : str
        ``range``, ``turned``, ``hopf``, or why it was lost: ``another``, ``not_converged`` ...
    """
    points, span = [start], values[-1] - values[0]
    goals = [v for v in values if (v - start.over) * direction > 0.0]
    goals.sort(key=lambda v: v * direction)
    h = FIRST_STEP * span
    while goals:
        last = points[-1]
        step = min(h, abs(goals[0] - last.over))
        over = goals[0] if step >= abs(goals[0] - last.over) else last.over + direction * step
        foreseen = _foreseen(points, over)
        try:
            border_point, reason = locate(over, foreseen), ""
        except ConvergenceError as error:
            reason = error.status
        predicted_distance = max(
            _largest_rel_difference(last.motion, foreseen, width),
            MIN_PREDICTED_MOVE / PREDICTION_ERROR_HALVE,
        )
        rel_prediction_error = (
            np.inf
            if reason
            else _largest_rel_difference(border_point.motion, foreseen, width) / predicted_distance
        )
        if rel_prediction_error > PREDICTION_ERROR_HALVE:
            reason, h = reason or ANOTHER, 0.5 * step
            if h < MIN_STEP * span:
                return points, _why(points, width, reason)
            continue
        points.append(border_point)
        if over == goals[0]:
            del goals[0]
        h = min(h * (1.5 if rel_prediction_error < PREDICTION_ERROR_GROW else 1.0), MAX_STEP * span)
    return points, RANGE


def _foreseen(points: list[BorderPoint], over: float) -> PeriodicMotion:
    """Predict the motion at a value of the second parameter, linearly from the last two points."""
    last_point = points[-1]
    if len(points) < 2:
        return last_point.motion
    before = points[-2]
    return between(
        before.motion, last_point.motion, (over - before.over) / (last_point.over - before.over)
    )


def _border_coordinates(motion: PeriodicMotion, width: float) -> np.ndarray:
    return np.array([motion.parameter / width, motion.size, motion.omega])


def _largest_rel_difference(motion: PeriodicMotion, other: PeriodicMotion, width: float) -> float:
    """Largest relative difference of two motions in parameter, size and frequency."""
    scale = np.array([1.0, max(motion.size, 1e-300), motion.omega])
    return float(
        np.abs(
            (_border_coordinates(other, width) - _border_coordinates(motion, width)) / scale
        ).max()
    )


def _why(points: list[BorderPoint], width: float, reason: str) -> str:
    """Why a border ends: `TURNED` or `MET` where it turns back just ahead, else `reason`.

    Near the turn the unknowns change as a square root of the second parameter. So the parameter is
    fitted, over the unknown that changes most, by a parabola through the last three points.
    """
    if len(points) < 3 or reason == RANGE:
        return reason
    last = points[-3:]
    scale = np.array([1.0, max(last[-1].motion.size, 1e-300), last[-1].motion.omega])
    x = np.array([_border_coordinates(p.motion, width) / scale for p in last])
    k = int(np.argmax(np.abs(x[-1] - x[-2])))
    if np.abs(np.diff(x[:, k])).min() < FOLD_TOLERANCE:
        return reason
    a, b, c = np.polyfit(x[:, k] - x[-1, k], [p.over - last[-1].over for p in last], 2)
    step = last[-1].over - last[-2].over
    if not a or not 0.0 <= (c - b**2 / (4.0 * a)) / step <= MAX_EXTRAPOLATION_STEPS:
        return reason
    return MET if k == 1 and 1.0 - b / (2.0 * a) < VANISHING_REL_SIZE else TURNED
