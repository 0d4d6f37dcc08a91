"""Finds designs at which motion louder than their level may last."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from squealstudy.wording import IF_KICKED, in_digits, plural

DISTINCT_RATIO = 1.02  # a cycle is louder than a design's level if it is above it by this ratio
# level of a neighbour over a design's, from which on it is another motion, not the same one further
NEIGHBOUR_RATIO = 1.5


def louder_cycles(points: pd.DataFrame, cycles: pd.DataFrame) -> np.ndarray:
    """Level (n,) of the loudest cycle not known as stable that is above a design's; NaN if none."""
    levels = points["torque_rms"].to_numpy(float)
    not_stable = cycles[~(cycles["stable"].astype("boolean").fillna(False)).to_numpy(bool)]
    loudest = not_stable.groupby("point_id")["torque_rms"].max()
    above = points["point_id"].map(loudest).to_numpy(float)
    return np.where(above > DISTINCT_RATIO * levels, above, np.nan)


def on_branches(
    points: pd.DataFrame, branches: pd.DataFrame, parameters: Sequence[str]
) -> list[set[int]]:
    """Rows of designs whose level is that of a branch's stable cycles, a set for each branch."""
    rows_of: list[set[int]] = []
    levels, of_id = points["torque_rms"].to_numpy(float), points.set_index("point_id")
    for _, branch in branches.groupby("cycle_id", sort=False):
        along, start = str(branch["along"].iloc[0]), of_id.loc[branch["point_id"].iloc[0]]
        is_stable = branch["stable"].astype("boolean").fillna(False) & (branch["event"] == "")
        stable = branch[is_stable.to_numpy(bool)].sort_values("value", kind="stable")
        at, others = points[along].to_numpy(float), [p for p in parameters if p != along]
        near = np.logical_and.reduce(
            [np.ones(len(points), bool), *(points[p].to_numpy() == start[p] for p in others)]
        )
        if len(stable):
            settings, rms = (stable[n].to_numpy(float) for n in ("value", "torque_rms"))
            near &= (settings[0] <= at) & (at <= settings[-1])
            near &= abs(np.interp(at, settings, rms) / levels - 1.0) < DISTINCT_RATIO - 1.0
            rows_of.append({int(row) for row in np.flatnonzero(near)})
    return rows_of


def louder_neighbours(
    points: pd.DataFrame, parameters: Sequence[str], branches: Sequence[set[int]] = ()
) -> np.ndarray:
    """Level (n,) of a neighbour on a line of designs that squeals if kicked; NaN if none is louder.

    Such a motion does not begin where steady sliding becomes unstable: it may exist beside the
    motion that gave the level. Designs on one of `branches` (`on_branches`) have the same motion.
    """
    levels = points["torque_rms"].to_numpy(float)
    kicked = np.where((points["verdict"] == IF_KICKED).to_numpy(bool), levels, np.nan)
    above = np.full(len(points), np.nan)
    for name in parameters:
        fixed = [p for p in parameters if p != name]
        lines = points.groupby(fixed, sort=False) if fixed else [("", points)]
        for _, line in lines:
            rows = points.index.get_indexer(line.sort_values(name, kind="stable").index)
            for designs, neighbours in ((rows[:-1], rows[1:]), (rows[1:], rows[:-1])):
                for design, neighbour in zip(designs, neighbours, strict=True):
                    if not any({design, neighbour} <= rows for rows in branches):
                        above[design] = np.fmax(above[design], kicked[neighbour])
    return np.where(above > NEIGHBOUR_RATIO * levels, above, np.nan)


def larger_in_words(
    points: pd.DataFrame,
    cycles: pd.DataFrame,
    branches: pd.DataFrame,
    parameters: Sequence[str],
    unit: str,
) -> str:
    """Sentence on the designs at which larger motion may last too; empty where none is known."""
    cycle_levels = louder_cycles(points, cycles)
    neighbour_levels = louder_neighbours(
        points, parameters, on_branches(points, branches, parameters)
    )
    n_designs = int((np.isfinite(cycle_levels) | np.isfinite(neighbour_levels)).sum())
    whys = [
        f"{text} ({_ends(levels[np.isfinite(levels)])} {unit})"
        for text, levels in (
            ("a cycle above that level is unstable or not known as stable", cycle_levels),
            ("louder motion lasts at a design beside it", neighbour_levels),
        )
        if np.isfinite(levels).any()
    ]
    if not whys:
        return ""
    count = f"{n_designs} of {plural(len(points), 'design')}"
    return f" At {count} larger motion may last too: {'; '.join(whys)}."


def _ends(levels: np.ndarray) -> str:
    return " to ".join(dict.fromkeys(in_digits(float(v), 1) for v in (levels.min(), levels.max())))
