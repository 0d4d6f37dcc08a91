"""Friction of contact points that have numbers of their own, in place of the study's.

An array `own_friction` (.., nc, k) has a row for each point: its state (`STATE`), its friction
coefficient, then the parameters of the friction curve in their order. NaN stands for the study's
value, as a missing column does. There are no columns where no point has friction of its own.

A point on which no sliding is imposed (a speed factor of 0: a pad on its bracket, a guide pin) has
one coefficient at all speeds. If it is stuck, it has no friction in steady sliding; else that of
slip along T (THEORY.md eq. (17a)). In time it sticks and slips by itself, and starts without
friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from squealstudy.laws.friction_law import FrictionCurveDefinition, curve_slopes
from squealstudy.laws.registry import at_points

NO_OWN_FRICTION = np.zeros((0, 0))
STATE, COEFFICIENT = 0, 1  # columns; those of the curve's parameters follow
# a contact's state in files, and as a parameter: sliding along its direction, or stuck
STATES = {"sliding": 0.0, "stuck": 1.0}
# states of points: sliding; stuck without a stiffness; stuck with a stiffness among the springs
SLIDING, STUCK, STUCK_BY_SPRING = 0.0, 1.0, 2.0

NOT_LINEAR = (
    "a contact that is stuck has no tangential stiffness in complex modes: expected 'tangential' "
    "above 0"
)
NOT_IN_TIME = (
    "in time a contact with a state sticks and slips by itself, rigidly, from no friction: "
    "expected state 'stuck' (1) and no 'tangential' (0)"
)


def has_own(own_friction: np.ndarray) -> bool:
    """Whether any points have friction of their own."""
    return own_friction.shape[-1] > 0


def coefficients_alone(own_friction: np.ndarray) -> np.ndarray:
    """The columns of states and coefficients, without numbers of a friction curve."""
    return own_friction[..., : COEFFICIENT + 1]


def is_unmoved(own_friction: np.ndarray, speed_factor: np.ndarray) -> np.ndarray:
    """Whether points (.., nc) have friction of their own and no sliding is imposed on them."""
    unmoved: np.ndarray = (speed_factor == 0.0) & has_own(own_friction)
    return unmoved


def sticks_in_time(own_friction: np.ndarray) -> np.ndarray:
    """Whether points (.., nc) stick and slip by themselves in time: stuck without a stiffness."""
    if not has_own(own_friction):
        return np.zeros(own_friction.shape[:-1], dtype=bool)
    stuck: np.ndarray = own_friction[..., STATE] == STUCK
    return stuck


def is_linear(own_friction: np.ndarray) -> np.ndarray:
    """Whether (..,) all points (.., nc) have a tangent: none is stuck without a stiffness."""
    linear: np.ndarray = (own_friction[..., :1] != STUCK).all(axis=(-1, -2))
    return linear


def starts_in_time(own_friction: np.ndarray, speed_factor: np.ndarray) -> bool:
    """Whether runs in time can represent all points (nc,) on which no sliding is imposed."""
    if not has_own(own_friction):
        return True
    return bool((own_friction[is_unmoved(own_friction, speed_factor), STATE] == STUCK).all())


def own_values(
    own_friction: np.ndarray, friction: Any, parameters: Sequence[Any]
) -> list[np.ndarray]:
    """Coefficients and values (.., nc) of each of the curve's parameters at the points.

    `friction` and `parameters` are the study's: numbers, or (m, 1).
    """
    columns = np.moveaxis(own_friction, -1, 0)[COEFFICIENT:]
    missing = [np.full(own_friction.shape[:-1], np.nan)] * (1 + len(parameters) - len(columns))
    return [
        np.where(np.isnan(column), of_study, column)
        for column, of_study in zip((*columns, *missing), (friction, *parameters), strict=True)
    ]


def own_mu(
    curve: FrictionCurveDefinition,
    values: tuple[Any, Sequence[Any]],
    own_friction: np.ndarray,
    speeds: np.ndarray,
    p: np.ndarray,
) -> np.ndarray:
    """mu, dmu/ds and dmu/dp (3, .., nc) at sliding speeds >= 0 and pressures (.., nc).

    `values` are the study's friction and parameters of the curve.
    """
    friction, *parameters = own_values(own_friction, *values)
    of_curve = at_points(curve.mu, 3, speeds, p, friction, *parameters)
    slipping = np.where(own_friction[..., STATE] > 0.0, 0.0, friction)
    unmoved = np.stack([slipping, 0.0 * slipping, 0.0 * slipping])
    return np.where(speeds == 0.0, unmoved, of_curve)


def own_slopes(
    curve: FrictionCurveDefinition,
    values: tuple[Any, Sequence[Any]],
    own_friction: np.ndarray,
    speeds: np.ndarray,
    p: np.ndarray,
) -> np.ndarray:
    """Derivatives of `own_mu` (count, 3, .., nc) by speed, pressure and the study's values.

    The study's values are friction and each parameter of the curve; derivatives by them are 0 where
    a point has its own value.
    """
    rows = curve_slopes(curve, speeds, p, own_values(own_friction, *values))
    rows = np.where(speeds == 0.0, 0.0, rows)
    slips = (speeds == 0.0) & (own_friction[..., STATE] == 0.0)
    rows[2, 0] = np.where(slips, 1.0, rows[2, 0])
    for column in range(COEFFICIENT, own_friction.shape[-1]):
        rows[1 + column] = np.where(np.isnan(own_friction[..., column]), rows[1 + column], 0.0)
    return rows
