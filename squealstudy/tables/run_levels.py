"""Levels that a study of limit cycles knows by runs in time: no row of a cycle has them."""

from __future__ import annotations

import numpy as np
import pandas as pd


def run_levels(verdicts: pd.DataFrame, cycles: pd.DataFrame) -> pd.DataFrame:
    """Verdicts whose level is that of a run in time, not that of a cycle of their design point.

    Parameters
    ----------
    verdicts, cycles : DataFrame
        Tables of results; those of an earlier version have no column ``run_status``.

    Returns
    -------
    DataFrame
        Some rows of `verdicts`.
    """
    if "run_status" not in verdicts:
        return verdicts.iloc[:0]
    by_run = (verdicts["run_status"].fillna("") != "").to_numpy(bool)
    level = verdicts["torque_rms"].to_numpy(dtype=float, na_value=np.nan)
    cycle_levels = cycles["torque_rms"].to_numpy(dtype=float, na_value=np.nan)
    of_cycles = set(zip(cycles["point_id"], cycle_levels, strict=True))
    ids_and_levels = zip(verdicts["point_id"], level, strict=True)
    new = np.array([id_and_level not in of_cycles for id_and_level in ids_and_levels], dtype=bool)
    return verdicts[by_run & np.isfinite(level) & new]
