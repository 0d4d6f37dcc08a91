"""Folds of a branch: which turns of its parameter are folds, and the error of the value there.

The error is that of motions whose series are cut off.

At a fixed size the balance is regular at a fold, and as a function of size the parameter has an
extremum there. This holds for any number of harmonics, also where forces have corners and the slope
of the parameter jumps.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from squealstudy.cycles.continuation import newton
from squealstudy.cycles.curve import CurveMotion
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.harmonics import with_harmonics
from squealstudy.cycles.moving import Moving
from squealstudy.cycles.projection import SIZE_HELD
from squealstudy.errors import ConvergenceError

FOLD = "F"  # name of the event
FOLD_SERIES_SAFETY_FACTOR = (
    3.0  # over the change by more harmonics; contact that opens asks for 2.4
)
# A fold is compared with other series of these numbers of harmonics, over its own number. Two must
# be solved, as one may agree by chance; where one fails, the next is tried.
HARMONIC_FACTORS, N_SERIES = (2.25, 4.0, 3.0, 5.0), 2
MAX_HARMONICS = 59
SIZE_REL_TOLERANCE = 1e-4  # error of log size over the distance of the motions beside a fold
MAX_SIZES = 40  # most sizes at which the balance is solved


def fold_error(
    moving: Moving, before: PeriodicMotion, fold: PeriodicMotion, after: PeriodicMotion
) -> float:
    """Error of the parameter's value at a fold between two motions of its branch.

    NaN on a projected model, and where more harmonics do not lead to the fold.
    """
    if not moving.complete:
        return np.nan
    changes: dict[int, float] = {}
    for factor in HARMONIC_FACTORS:
        harmonics = min(math.ceil(factor * fold.harmonics), MAX_HARMONICS)
        if len(changes) < N_SERIES and harmonics > fold.harmonics:
            with suppress(ConvergenceError):
                finer_value = _extremum(moving, harmonics, before, fold, after)
                changes[harmonics] = abs(finer_value - fold.parameter)
    judged = len(changes) == N_SERIES or MAX_HARMONICS in changes
    return FOLD_SERIES_SAFETY_FACTOR * max(changes.values()) if judged else np.nan


def _extremum(
    moving: Moving,
    harmonics: int,
    before: PeriodicMotion,
    fold: PeriodicMotion,
    after: PeriodicMotion,
) -> float:
    """Value of the parameter at the fold with more harmonics and twice the samples.

    Raises ConvergenceError where there is no extremum between the two motions.
    """
    equations = moving.finer_equations(fold, harmonics)
    balanced = [
        equations.pack(replace(m, Q=with_harmonics(m.Q, harmonics))) for m in (before, fold, after)
    ]
    equations.accepted(balanced[1])
    normal = np.zeros(len(balanced[1]))
    normal[SIZE_HELD] = 1.0
    low, high = sorted((float(balanced[0][SIZE_HELD]), float(balanced[2][SIZE_HELD])))
    turned = 1.0 if 0.5 * (before.parameter + after.parameter) > fold.parameter else -1.0
    tried: list[tuple[float, float]] = []  # log size, value

    def to_be_least(size: float) -> float:
        nearest = min(balanced, key=lambda u: abs(float(u[SIZE_HELD]) - size))
        u, *_ = newton(equations, nearest.copy(), normal, size)
        balanced.append(u)
        tried.append((size, equations.motion(u).parameter))
        return turned * tried[-1][1]

    with suppress(ConvergenceError):  # one size may fail at a corner of forces; others are enough
        minimize_scalar(
            to_be_least,
            bounds=(low, high),
            method="bounded",
            options={"xatol": SIZE_REL_TOLERANCE * (high - low), "maxiter": MAX_SIZES},
        )
    tried.sort()
    best = min(range(len(tried)), key=lambda k: turned * tried[k][1], default=0)
    if not 0 < best < len(tried) - 1:
        raise ConvergenceError("not_converged", "no fold between the motions beside it")
    return tried[best][1]


def _at_the_turn(curve: list[CurveMotion], one_value: float) -> list[CurveMotion]:
    """The curve with each fold at the point where the parameter turns back, of three beside it.

    The balance jumps where a kink of a force passes a node of time: the slope may change its sign
    in a jump, a little before or after the largest or least value.
    """
    values = np.array([point.motion.parameter for point in curve])
    relabelled = list(curve)
    for k in range(2, len(curve) - 2):
        before, after = values[k - 2] - values[k], values[k + 2] - values[k]
        if curve[k].event != FOLD or before * after <= 0.0:
            continue
        turn = k - 1 + int((-np.sign(before) * values[k - 1 : k + 2]).argmax())
        if abs(values[turn] - values[k]) > one_value and not curve[turn].event:
            relabelled[k], relabelled[turn] = (
                replace(curve[k], event=""),
                replace(curve[turn], event=FOLD),
            )
    return relabelled


def folds_alone(curve: list[CurveMotion], one_value: float) -> list[CurveMotion]:
    """The curve without folds of round-off where its cycles lie at one value of the parameter.

    Where many neighbours lie at one value the first turn among them stays a fold if the parameter
    arrives and leaves on the same side; the others are round-off.
    """
    curve = _at_the_turn(curve, one_value)
    values = np.array([point.motion.parameter for point in curve])
    folds, counted = list(curve), -1  # index of the last neighbour of a fold that stays
    for k, point in enumerate(curve):
        if point.event != FOLD:
            continue
        is_apart = np.abs(values - values[k]) > one_value
        before, after = np.flatnonzero(is_apart[:k]), k + 1 + np.flatnonzero(is_apart[k + 1 :])
        sides = [values[j[0]] - values[k] for j in (before[::-1], after) if len(j)]
        if k <= counted or len(sides) < 2 or sides[0] * sides[1] < 0.0:
            folds[k] = replace(point, event="")
        else:
            counted = int(after[0]) - 1
    return folds
