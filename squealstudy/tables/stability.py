"""Stability of modes within their errors, and crossings of tracks between points of lines."""

from __future__ import annotations

import numpy as np
import pandas as pd

from squealstudy.modes.judged_roots import UNCERTAIN


def is_uncertain(modes: pd.DataFrame) -> np.ndarray:
    """Mask of the rows of a modes table that may be stable or unstable.

    Tables that were written before errors of the reduction were known have no column for it: all
    false.
    """
    if "stability" not in modes:
        return np.zeros(len(modes), dtype=bool)
    uncertain: np.ndarray = (modes["stability"] == UNCERTAIN).to_numpy(bool)
    return uncertain


def unstable_bounds(
    modes: pd.DataFrame, group: np.ndarray, code: np.ndarray, counted: np.ndarray
) -> pd.DataFrame:
    """Numbers of points at which each group of modes is certainly unstable, and may be.

    Parameters
    ----------
    modes : DataFrame
    group : ndarray (m,) of int
        Group of each unstable row (`mode_ranking.unstable_groups`), 0 of all others.
    code : ndarray (m,) of int
        Design point of each row.
    counted : ndarray (m,) of bool
        Rows that count.

    Returns
    -------
    DataFrame
        ``unstable_points_low`` and ``unstable_points_high``, indexed by group. A row that is not
        unstable belongs to the group of its track, or to that whose frequency range contains it.
    """
    uncertain = is_uncertain(modes)
    maybe = np.where(uncertain & counted & (group == 0), _own_group(modes, group), 0)
    groups = np.unique(group[group != 0])
    sides = {"low": np.where(uncertain, 0, group), "high": np.where(maybe != 0, maybe, group)}
    table = pd.DataFrame(index=pd.Index(groups, name="track"))
    for side, numbers in sides.items():
        ranked_rows = np.flatnonzero(np.isin(numbers, groups))
        group_index, point = np.searchsorted(groups, numbers[ranked_rows]), code[ranked_rows]
        span = int(point.max(initial=0)) + 1
        pairs = np.unique(group_index * span + point)  # one number for each pair of group and point
        table[f"unstable_points_{side}"] = np.bincount(pairs // span, minlength=len(groups))
    return table


def _own_group(modes: pd.DataFrame, group: np.ndarray) -> np.ndarray:
    """Group (m,) to which each row would belong if it were unstable; 0 for none."""
    group_of_row = np.where(
        modes["overdamped"].to_numpy(bool), -1, np.maximum(modes["track"].to_numpy(), 0)
    )
    hz, loose = modes["frequency_hz"].to_numpy(float), group_of_row == 0
    for number in np.unique(group[group < -1]):
        ends = hz[group == number]
        group_of_row = np.where(
            loose & (hz >= ends.min()) & (hz <= ends.max()), number, group_of_row
        )
    return group_of_row


def uncertain_points(modes: pd.DataFrame, code: np.ndarray, counted: np.ndarray) -> int:
    """Number of counted design points at which the stability of a mode is uncertain."""
    return len(np.unique(code[is_uncertain(modes) & counted]))


DAMPING_ROUND_OFF_RATIO = 1e-9
INTO, OUT_OF = "in", "out"  # of instability
LEAVES = "leaves"  # the band, still unstable
REFINED, CUBIC = "refined", "cubic"  # onsets to 1e-4: by root finding, by their neighbours
REFINED_ONSETS = (REFINED, CUBIC)
INTERPOLATED = "interpolated"  # status of an onset between two solved points
BELOW_RANGE, FIRST_SEEN, CROSSING = "below range", "first seen", "crossing"
BRACKETED = "bracketed"
LEFT_BAND = "left_band"  # status of a row of a track that leaves the band
BROKEN = "broken"  # a track begins unstable beside one that ends: the same mode, perhaps
INEXACT = {CROSSING: "~", FIRST_SEEN: "<= ", BRACKETED: "<= ", BROKEN: "<= "}  # before a value


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
        Value of the parameter along the line at its point, and where the swept range begins on
        the line, whether that point was solved or not; NaN for lines of one point, and for random
        designs, whose lines begin nowhere.
    zeta : ndarray (n,)
        Damping ratio.
    unstable : ndarray (n,) of bool

    Returns
    -------
    DataFrame
        ``track``, ``line``, ``value`` (zeta interpolated to zero between both ends; where its
        first value is unstable, that one), ``kind`` ("crossing"; "bracketed" where no point of the
        stable stretch has damping: there may be none up to a coalescence anywhere between both
        ends, ``value`` is the unstable one; "below range" where the track is unstable at the
        beginning of a line, "first seen" where it begins unstable elsewhere),
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
    x0, z0, x1, z1 = (
        np.roll(x, 1)[at],
        np.roll(zeta, 1)[at],
        x[at],
        zeta[at],
    )
    stable = np.maximum(np.where(out[at], z1, z0), 0.0)
    growing = np.where(out[at], z0, z1)
    part = np.clip(stable / np.maximum(stable - growing, np.finfo(float).tiny), 0.0, 1.0)
    part[part < DAMPING_ROUND_OFF_RATIO] = 0.0  # the damping is zero but for round-off
    run = np.cumsum(first | into | out)  # of points alike, from one change to the next
    highest = np.full(run[-1] + 1 if len(run) else 1, -np.inf)
    np.maximum.at(highest, run, zeta)
    undamped_before = highest[
        run[np.where(out[at], at, at - 1)]
    ] <= DAMPING_ROUND_OFF_RATIO * np.abs(growing)
    undamped = (part == 0) & undamped_before
    part[undamped] = 1.0
    crossing = np.where(out[at], x1 + part * (x0 - x1), x0 + part * (x1 - x0))
    below = first[at] & (x1 == start[at]) & (group[at] > 0)
    return pd.DataFrame(
        {
            "track": group[at],
            "line": line[at],
            "value": np.where(first[at], x1, crossing),
            "kind": np.select(
                [below, first[at], undamped],
                [BELOW_RANGE, FIRST_SEEN, BRACKETED],
                CROSSING,
            ),
            "direction": np.where(out[at], OUT_OF, INTO),
            "before": np.where(first[at], -1, np.roll(order, 1)[at]),
            "after": order[at],
        }
    )
