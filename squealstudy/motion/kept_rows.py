"""Thinning of the rows of a run: one of so many is kept, with what happened since the last."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

# columns over all steps since the row before, and how rows of them become one
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
    """Columns of every so many rows, 0 of none; what is summed or extreme is since the one before.

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
    """Variance of the torque since the last kept row: mean of the variances, and of the means."""
    spread = joined(history["torque_mean"], every, np.var)
    within = joined(history["torque_variance"], every, np.mean)
    return within + spread


def joined(values: np.ndarray, every: int, reduce: Callable[..., np.ndarray]) -> np.ndarray:
    """A column in which each row is what so many rows come to, behind the first row."""
    count = (len(values) - 1) // every
    parts = values[1 : 1 + count * every].reshape(count, every)
    return np.concatenate([reduce(values[:1, None], axis=1), reduce(parts, axis=1)])
