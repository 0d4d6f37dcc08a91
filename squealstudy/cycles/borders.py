"""Folds and onsets of branches continued over a second parameter.

At one value of the second parameter a fold is found from a motion nearby: the balance at a held
size is regular there, and along it the first parameter has an extremum. The curve is followed in
the second parameter, through given values of it exactly, until it turns back in it or is lost.
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
FOLD_TOLERANCE = 1e-6  # tolerance of log size; the parameter is known to its square
FOLD_MAX_ITERATIONS = 12  # places looked at
FOLD_MAX_STEP = 0.2  # largest step of log size
FIRST_STEP, MIN_STEP, MAX_STEP = 0.05, 1e-4, 0.25  # steps, of the range of the second parameter
# of a step: how far from its end, as it was foreseen, the border may be
PREDICTION_ERROR_GROW, PREDICTION_ERROR_HALVE = 0.1, 0.4
MIN_PREDICTED_MOVE = 0.02  # and how far at least
MAX_EXTRAPOLATION_STEPS = 4.0  # last steps within which a border that cannot be followed turns back
VANISHING_REL_SIZE = 0.2  # size over the one at that place: smaller cycles shrink to nothing


@dataclass(frozen=True, eq=False)
class BorderPoint:
    """A point of a border.

    Attributes
    ----------
    over : float
        Value of the second parameter.
    motion : PeriodicMotion
        Its `parameter` is the value of the first; of a Hopf point without size.
    residual : float
        Of the balance.
    criticality : str
        Of a Hopf point, as of `onset.criticality`.
    """

    over: float
    motion: PeriodicMotion
    residual: float = 0.0
    criticality: str = ""


Locate = Callable[[float, PeriodicMotion], BorderPoint]  # at a value, from a motion nearby


def fold_near(
    oscillators: Oscillators, guess: PeriodicMotion, bounds: tuple[float, float]
) -> tuple[PeriodicMotion, float]:
    """The fold near a cycle, in all coordinates, and the residual of its balance.

    Where the parameter does not change with the size of the cycle: by secants in log size.

    Parameters
    ----------
    oscillators : callable
        Oscillator of a value of the parameter.
    guess : PeriodicMotion
        Its `parameter` is a value of the parameter.
    bounds : (low, high)
        Range of the parameter.

    Raises
    ------
    ConvergenceError
        Where there is none.
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
    """A border from one of its points on, over the second parameter.

    Parameters
    ----------
    locate : callable
        Its point at a value of the second parameter; ConvergenceError where there is none.
    start : BorderPoint
    values : sequence of float
        Ascending; all of them on the way, from the least to the largest, are points.
    direction : float
        1 towards larger ones, -1.
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
        away = (
            np.inf
            if reason
            else _largest_rel_difference(border_point.motion, foreseen, width) / predicted_distance
        )
        if away > PREDICTION_ERROR_HALVE:
            reason, h = reason or ANOTHER, 0.5 * step
            if h < MIN_STEP * span:
                return points, _why(points, width, reason)
            continue
        points.append(border_point)
        if over == goals[0]:
            del goals[0]
        h = min(h * (1.5 if away < PREDICTION_ERROR_GROW else 1.0), MAX_STEP * span)
    return points, RANGE


def _foreseen(points: list[BorderPoint], over: float) -> PeriodicMotion:
    """The motion at a value of the second parameter, straight on."""
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
    """Largest of the differences in parameter, size and frequency, relative."""
    scale = np.array([1.0, max(motion.size, 1e-300), motion.omega])
    return float(
        np.abs(
            (_border_coordinates(other, width) - _border_coordinates(motion, width)) / scale
        ).max()
    )


def _why(points: list[BorderPoint], width: float, reason: str) -> str:
    """Why a border cannot be followed: it turns back just ahead, as a square root, or was lost.

    Of the unknowns the one that changes most tells, by a parabola through the last three points.
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
