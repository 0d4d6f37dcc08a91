"""Where tracks turn unstable, or stable again, between the points of lines of a study."""

from __future__ import annotations

import numpy as np
import pandas as pd

ROUNDING = 1e-9
INTO, OUT_OF = "in", "out"  # of instability
BELOW_RANGE, FIRST_SEEN, CROSSING = "below range", "first seen", "crossing"


def line_crossings(
    group: np.ndarray,
    line: np.ndarray,
    x: np.ndarray,
    start: np.ndarray,
    zeta: np.ndarray,
    unstable: np.ndarray,
) -> pd.DataFrame:
    """Every change between stable and unstable of each track on each line.

    Parameters
    ----------
    group : ndarray (n,) of int
        Track of each mode; negative numbers gather modes that are no track, whose order along a
        line means nothing.
    line : ndarray (n,) of int
        Line of its point.
    x, start : ndarray (n,)
        Value of the parameter along the line at its point, and at the beginning of the line; NaN
        for lines of one point.
    zeta : ndarray (n,)
        Damping ratio.
    unstable : ndarray (n,) of bool

    Returns
    -------
    DataFrame
        ``track``, ``line``, ``value`` (zeta interpolated to zero between both ends; for a track
        that begins unstable its first value), ``kind`` ("crossing", "below range" where it is
        unstable at the beginning of a line, "first seen" where it begins unstable elsewhere),
        ``direction`` ("in" or "out" of instability as x ascends), and ``before``, ``after``: the
        rows in the arrays of both ends, -1 where there is none before.
    """
    order = np.lexsort((x, line, group))
    group, line, x, start, zeta, unstable = (
        a[order] for a in (group, line, x, start, zeta, unstable)
    )
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(group) != 0) | (np.diff(line) != 0) | (group[1:] < 0)
    previous = np.roll(unstable, 1)
    into = unstable & (first | ~previous)
    out = ~unstable & ~first & previous
    at = np.flatnonzero(into | out)
    x0, z0, x1, z1 = np.roll(x, 1)[at], np.roll(zeta, 1)[at], x[at], zeta[at]
    stable = np.maximum(np.where(out[at], z1, z0), 0.0)
    growing = np.where(out[at], z0, z1)
    part = np.clip(stable / np.maximum(stable - growing, np.finfo(float).tiny), 0.0, 1.0)
    part[part < ROUNDING] = 0.0  # the damping before was zero but for round-off
    value = np.where(out[at], x1 + part * (x0 - x1), x0 + part * (x1 - x0))
    below = first[at] & (x1 == start[at]) & (group[at] > 0)
    return pd.DataFrame(
        {
            "track": group[at],
            "line": line[at],
            "value": np.where(first[at], x1, value),
            "kind": np.select([below, first[at]], [BELOW_RANGE, FIRST_SEEN], CROSSING),
            "direction": np.where(out[at], OUT_OF, INTO),
            "before": np.where(first[at], -1, np.roll(order, 1)[at]),
            "after": order[at],
        }
    )
