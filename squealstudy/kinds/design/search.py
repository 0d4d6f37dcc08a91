"""Finds the design of least cost that keeps a margin at all points: linear programs in turn.

The cost sum c_j |x_j| is split at today's design, x = p - n with p, n >= 0, and each step solves

    min  c (p + n) + nu t   with  v_i + s_i (x - x_k) + t >= 0  for every mode i of every point,
    |x - x_k| <= radius, bounds, t >= 0,

where v_i is damping ratio i less the margin, and s_i are its closed-form slopes. All modes near the
margin are constraints, not only the worst: where two cross the step takes both into account
(minimax in epigraph form). The radius shrinks where first order does not hold, as near a
coalescence (THEORY.md eq. (115)).
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

# radii of trust regions, over the range of each variable
FIRST_RADIUS, LARGEST_RADIUS, LEAST_RADIUS = 0.2, 0.5, 1e-3
MOST_STEPS = 60
# ratios of the real decrease of cost to the predicted decrease
RATIO_ACCEPT, RATIO_EXPAND, RATIO_SHRINK = 0.1, 0.75, 0.25
MIN_REL_PREDICTED_DECREASE = 1e-4  # the search ends at a smaller predicted decrease, over the cost
# nu over the total cost, per unit of damping ratio; the next is tried where the margin is missed
PENALTY_WEIGHTS = (2e2, 2e3, 2e4)
# steps aim beyond the margin by the sum of a damping ratio and a share of the margin
MARGIN_OVERSHOOT = 1e-6
REL_MARGIN_OVERSHOOT = 1e-3


@dataclass(frozen=True, eq=False)
class Box:
    """The variables: changes (d,) from today's design in units of their ranges.

    Attributes
    ----------
    low, high : ndarray (d,)
        Bounds, low <= 0 <= high; high - low = 1, or 0 for a variable that does not move.
    cost : ndarray (d,)
        Cost of a change of 1.
    """

    low: np.ndarray
    high: np.ndarray
    cost: np.ndarray

    def price(self, z: np.ndarray) -> float:
        """Cost of a change z (d,)."""
        return float(self.cost @ np.abs(z))


@dataclass(frozen=True, eq=False)
class Constraints:
    """Damping ratios of a design less those demanded, and their slopes.

    Attributes
    ----------
    excess : ndarray (m,)
        Damping ratios of the modes at all operating points less the margin or a larger demand.
    slopes : ndarray (m, d)
        Derivatives of the damping ratios by changes in units of the ranges; 0 where not known.
    """

    excess: np.ndarray
    slopes: np.ndarray

    @property
    def worst(self) -> float:
        """Least excess; the design meets the margin where it is not negative."""
        return float(self.excess.min(initial=np.inf))


Steps = dict[tuple[bytes, ...], tuple[np.ndarray, float]]


def descend(
    box: Box, start: np.ndarray, margin: float, steps: Steps
) -> Generator[np.ndarray, Constraints | None, np.ndarray]:
    """Descend from one design to a local least cost. Returns the last change (d,).

    Yields changes (d,) and expects to be sent the constraints there, or None where a design cannot
    be solved: that step is refused. `steps` stores solved linear programs for repeated searches.
    """
    z = start
    current = yield z
    if current is None:
        return z
    aim = MARGIN_OVERSHOOT + REL_MARGIN_OVERSHOOT * abs(margin)
    radius, n_steps = FIRST_RADIUS, 0
    for nu in PENALTY_WEIGHTS:
        weight = nu * float(box.cost.sum())
        radius = max(radius, 10 * LEAST_RADIUS)
        while n_steps < MOST_STEPS and radius >= LEAST_RADIUS:
            inputs = (z, current.excess, current.slopes, np.array([radius, weight, aim]))
            key = tuple(a.tobytes() for a in inputs)
            if key not in steps:
                steps[key] = _step(box, z, current, radius, weight, aim)
            trial, predicted = steps[key]
            before = _merit(box, z, current, weight, aim)
            if before - predicted <= MIN_REL_PREDICTED_DECREASE * float(box.cost.sum()):
                break
            n_steps += 1
            tried = yield trial
            gain = -np.inf if tried is None else before - _merit(box, trial, tried, weight, aim)
            ratio = gain / (before - predicted)
            if tried is not None and ratio >= RATIO_ACCEPT:
                z, current = trial, tried
            if ratio > RATIO_EXPAND:
                radius = min(2.0 * radius, LARGEST_RADIUS)
            elif ratio < RATIO_SHRINK:
                radius *= 0.4
        if current.worst >= 0.0:
            break
    return z


def _merit(box: Box, z: np.ndarray, constraints: Constraints, weight: float, aim: float) -> float:
    return box.price(z) + weight * max(0.0, aim - constraints.worst)


def _step(
    box: Box, z: np.ndarray, constraints: Constraints, radius: float, weight: float, aim: float
) -> tuple[np.ndarray, float]:
    """The next change (d,) and its merit to first order."""
    from scipy.optimize import linprog

    d = len(z)
    low, high = np.maximum(box.low, z - radius), np.minimum(box.high, z + radius)
    rows = np.hstack(
        [-constraints.slopes, constraints.slopes, -np.ones((len(constraints.slopes), 1))]
    )
    bound = constraints.excess - aim - constraints.slopes @ z
    change = np.hstack([np.eye(d), -np.eye(d), np.zeros((d, 1))])  # x = p - n
    solution = linprog(
        np.concatenate([box.cost, box.cost, [weight]]),
        A_ub=np.vstack([rows, change, -change]),
        b_ub=np.concatenate([bound, high, -low]),
        bounds=[(0.0, None)] * (2 * d + 1),
        method="highs",
    )
    if solution.x is None:  # the linear program has no solution: stay
        return z, np.inf
    step = np.clip(solution.x[:d] - solution.x[d : 2 * d], low, high)
    return step, float(solution.fun)
