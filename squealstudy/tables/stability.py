"""What a mode is within its error: unstable, stable, or uncertain."""

from __future__ import annotations

import numpy as np
import pandas as pd

UNSTABLE, STABLE, UNCERTAIN = "unstable", "stable", "uncertain"  # column `stability` of modes


def stability_names(unstable: np.ndarray, uncertain: np.ndarray) -> np.ndarray:
    """Name of each mode (m,) of str: uncertain whatever its sign, else by `unstable`."""
    names: np.ndarray = np.where(uncertain, UNCERTAIN, np.where(unstable, UNSTABLE, STABLE))
    return names.astype(object)


def is_uncertain(modes: pd.DataFrame) -> np.ndarray:
    """Which rows of a modes table may be stable or unstable; none where it does not tell.

    Tables written before errors of the reduction were known have no column for it.
    """
    if "stability" not in modes:
        return np.zeros(len(modes), dtype=bool)
    found: np.ndarray = (modes["stability"] == UNCERTAIN).to_numpy(bool)
    return found


def unstable_bounds(
    modes: pd.DataFrame, group: np.ndarray, code: np.ndarray, counted: np.ndarray
) -> pd.DataFrame:
    """Points at which each group of modes is unstable for sure, and at which it may be.

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
        unstable belongs to the group of its track, or in whose range of frequency it lies.
    """
    uncertain = is_uncertain(modes)
    maybe = np.where(uncertain & counted & (group == 0), _own_group(modes, group), 0)
    groups = np.unique(group[group != 0])
    sides = {"low": np.where(uncertain, 0, group), "high": np.where(maybe != 0, maybe, group)}
    table = pd.DataFrame(index=pd.Index(groups, name="track"))
    for side, numbers in sides.items():
        kept = np.isin(numbers, groups)
        pairs = np.unique(np.column_stack([numbers[kept], code[kept]]), axis=0)
        found = pd.Series(pairs[:, 0]).value_counts()
        table[f"unstable_points_{side}"] = found.reindex(groups, fill_value=0).to_numpy()
    return table


def _own_group(modes: pd.DataFrame, group: np.ndarray) -> np.ndarray:
    """Group (m,) to which each row would belong were it unstable; 0 for none."""
    own = np.where(modes["overdamped"].to_numpy(bool), -1, np.maximum(modes["track"].to_numpy(), 0))
    hz, loose = modes["frequency_hz"].to_numpy(float), own == 0
    for number in np.unique(group[group < -1]):
        ends = hz[group == number]
        own = np.where(loose & (hz >= ends.min()) & (hz <= ends.max()), number, own)
    return own


def uncertain_points(modes: pd.DataFrame, code: np.ndarray, counted: np.ndarray) -> int:
    """Number of design points that count at which some mode is uncertain."""
    return len(np.unique(code[is_uncertain(modes) & counted]))
