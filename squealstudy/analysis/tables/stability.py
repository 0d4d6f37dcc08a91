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
