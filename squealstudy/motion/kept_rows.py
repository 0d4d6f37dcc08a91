"""Thinning of the rows of a run: every so many rows become one, with sums and extremes of all."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

# columns that hold all steps since the row before, and the function that joins rows of them
SUMMED: Mapping[str, Callable[..., np.ndarray]] = {
    "torque_mean": np.mean,
    "torque_min": np.min,
    "torque_max": np.max,
    "stick_mean": np.mean,
    "stick_max": np.max,
    "open_mean": np.mean,
    "open_max": np.max,
}
JOINED: Mapping[str, Callable[..., np.ndarray]] = {
    **SUMMED,
    "modal_energy_mean": np.mean,
    "creep_max": np.max,
}


def kept_rows(history: Mapping[str, np.ndarray], every: int) -> dict[str, np.ndarray]:
    """Every so many rows of a history's columns, from the first on; no rows if `every` is 0.

    Columns of means and extremes hold all steps since the previous row that is kept.

    Parameters
    ----------
    history : mapping of str -> ndarray (rows,)
    every : int
    """
    if every == 0:
        return {name: values[:0] for name, values in history.items()}
    columns = {
        name: joined(values, every, JOINED[name]) if name in JOINED else values[::every]
        for name, values in history.items()
    }
    if "torque_variance" in history:
        columns["torque_variance"] = row_variances(history, every)
    return columns


def row_variances(history: Mapping[str, np.ndarray], every: int) -> np.ndarray:
    """Variance of the torque since the last kept row: mean of variances plus variance of means."""
    spread = joined(history["torque_mean"], every, np.var)
    within = joined(history["torque_variance"], every, np.mean)
    return within + spread


def joined(values: np.ndarray, every: int, reduce: Callable[..., np.ndarray]) -> np.ndarray:
    """The first row of a column, then each `every` rows after it joined by `reduce`."""
    count = (len(values) - 1) // every
    parts = values[1 : 1 + count * every].reshape(count, every)
    return np.concatenate([reduce(values[:1, None], axis=1), reduce(parts, axis=1)])
