"""From targets to what can be built: changes whose effect on modes is nearest to that of targets.

Frequencies and dampings of component modes are targets: they say what a part should do, not how it
is built. Where a study has both sorts of variables, targets are searched alone first. The search
over what can be built then begins at the changes within bounds whose first-order effect on the
roots of today's design near its margin, at all active points, is nearest to that of the best
targets (THEORY.md eq. (115a)).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.kinds.design.search import Box


@dataclass(frozen=True, eq=False)
class Realisation:
    """Result of the search over targets alone, and where the search over changes begins.

    Attributes
    ----------
    target : ndarray (d,)
        Values of all variables with the best targets; other variables are as today.
    enough : bool
        Whether they meet the margin at the active points.
    begun : ndarray (d,)
        Values of all variables with the nearest changes; targets are as today.
    matched : float
        Part of the targets' first-order effect on the roots that the changes have: 1 is all of it;
        NaN where the targets have no effect.
    """

    target: np.ndarray
    enough: bool
    begun: np.ndarray
    matched: float


def part_of(box: Box, is_varied: np.ndarray) -> Box:
    """The box in which only the variables in a mask (d,) move."""
    return Box(np.where(is_varied, box.low, 0.0), np.where(is_varied, box.high, 0.0), box.cost)


def nearest(
    rows: Iterable[Mapping[str, Any]],
    names: list[str],
    ranges: np.ndarray,
    target: np.ndarray,
    box: Box,
) -> tuple[np.ndarray, float]:
    """Changes (d,) in units of the ranges nearest to a target (d,), and the part that they match.

    Parameters
    ----------
    rows : iterable of mapping
        Rows of today's design at the active points.
    names : list of str
        Names of the variables.
    ranges, target : ndarray (d,)
        Ranges of the variables, and the target in units of them.
    box : Box
        The box in which only what can be built moves.
    """
    from scipy.optimize import lsq_linear

    S = slopes_of_roots(rows, names) * ranges
    free = np.flatnonzero(box.high > box.low)
    effect = S @ target
    size = float(np.linalg.norm(effect))
    z = np.zeros(len(ranges))
    if not size:
        return z, np.nan
    solution = lsq_linear(S[:, free], effect, (box.low[free], box.high[free]))
    z[free] = solution.x
    return z, 1.0 - float(np.linalg.norm(S @ z - effect)) / size


def slopes_of_roots(rows: Iterable[Mapping[str, Any]], names: list[str]) -> np.ndarray:
    """Derivatives (2 m, d) of growth rates and frequencies by parameters, relative to |lambda|."""
    rel_slopes = []
    for row in rows:
        for mode in row["modes"]:
            by = {s["parameter"]: s for s in mode["slopes"]}
            size = 2.0 * np.pi * mode["frequency_hz"]
            none = {"d_growth_rate": 0.0, "d_frequency_hz": 0.0}
            slopes = [by.get(name, none) for name in names]
            rel_slopes.append([s["d_growth_rate"] / size for s in slopes])
            rel_slopes.append([s["d_frequency_hz"] / mode["frequency_hz"] for s in slopes])
    return np.nan_to_num(np.array(rel_slopes).reshape(-1, len(names)), posinf=0.0, neginf=0.0)
