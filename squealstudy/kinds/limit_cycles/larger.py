"""Designs at which motion louder than their level may last."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from squealstudy.wording import IF_KICKED, in_digits, plural

DISTINCT_RATIO = 1.02  # level of a cycle over a design's, from which on the cycle is louder
# level of a neighbour over a design's, from which on it is another motion, not the same one further
NEIGHBOUR_RATIO = 1.5


def louder_cycles(points: pd.DataFrame, cycles: pd.DataFrame) -> np.ndarray:
    """Level (n,) of the loudest cycle not known as stable that is above a design's; NaN if none."""
    levels = points["torque_rms"].to_numpy(float)
    not_stable = cycles[~(cycles["stable"].astype("boolean").fillna(False)).to_numpy(bool)]
    loudest = not_stable.groupby("point_id")["torque_rms"].max()
    above = points["point_id"].map(loudest).to_numpy(float)
    return np.where(above > DISTINCT_RATIO * levels, above, np.nan)


def louder_neighbours(points: pd.DataFrame, parameters: Sequence[str]) -> np.ndarray:
    """Level (n,) of a neighbour on a line of designs that squeals if kicked; NaN if none is louder.

    Such a motion does not begin where steady sliding becomes unstable: it may exist beside the
    motion that gave the level.
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
                above[designs] = np.fmax(above[designs], kicked[neighbours])
    return np.where(above > NEIGHBOUR_RATIO * levels, above, np.nan)


def larger_in_words(
    points: pd.DataFrame, cycles: pd.DataFrame, parameters: Sequence[str], unit: str
) -> str:
    """Sentence on the designs at which larger motion may last too; empty where none is known."""
    cycle_levels = louder_cycles(points, cycles)
    neighbour_levels = louder_neighbours(points, parameters)
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
