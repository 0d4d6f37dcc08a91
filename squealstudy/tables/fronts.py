"""Fronts of work-precision tables: which measurement no other beats in both cost and error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

FRONT_COLUMNS = {
    "quantity": "str",
    "tolerance": "f8",
    "cheapest": "str",
    "cost": "f8",
    "error": "f8",
    "default": "str",
    "default_cost": "f8",
    "default_error": "f8",
    "ratio": "f8",
}


def on_front(cost: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Which of some measurements (n,) are not beaten in both; NaN never is on a front."""
    known = np.isfinite(cost) & np.isfinite(error)
    front = np.zeros(len(cost), dtype=bool)
    best = np.inf
    for i in np.lexsort((error, cost)):
        if known[i] and error[i] < best:
            front[i] = True
            best = error[i]
    return front


def usable(measurements: pd.DataFrame) -> np.ndarray:
    """Measurements that count (n,) bool: every point solved, nothing missed, nothing spurious."""
    counts = measurements[["n_failed", "missed", "spurious"]].sum(axis=1)
    return ((measurements["status"] == "ok") & (counts == 0)).to_numpy(bool)


def cost_of(measurements: pd.DataFrame, quantity: str) -> np.ndarray:
    """Seconds (n,) that a quantity costs: of a design point, or its own, as an onset has."""
    own = f"cost_{quantity}"
    column = own if own in measurements else "cost"
    return measurements[column].to_numpy(float)


def at_tolerances(
    measurements: pd.DataFrame, quantities: Sequence[str], tolerances: Sequence[float]
) -> pd.DataFrame:
    """The cheapest measurement within each tolerance, and the cheapest of the default methods.

    Parameters
    ----------
    measurements : DataFrame
        Columns ``label``, ``default``, ``reference``, ``cost``, ``status``, ``n_failed``,
        ``missed``, ``spurious``, ``error_<quantity>`` and, where it has a cost of its own,
        ``cost_<quantity>``.
    quantities : sequence of str
        All of them together too, under the name ``all``, but those that nothing has; at the cost of
        the dearest.
    tolerances : sequence of float

    Returns
    -------
    DataFrame
        FRONT_COLUMNS; `ratio` is the default's cost over the cheapest's, NaN where there is none.
    """
    good = measurements[usable(measurements) & ~measurements["reference"].to_numpy(bool)]
    rows = []
    known = [q for q in quantities if good[f"error_{q}"].notna().any()]
    for name in [*quantities, *(["all"] if len(quantities) > 1 else [])]:
        judged = known if name == "all" else [name]
        error = good[[f"error_{q}" for q in judged]].max(axis=1, skipna=False).to_numpy(float)
        cost = np.max([cost_of(good, q) for q in judged or quantities], axis=0)
        rows += [
            {"quantity": name, "tolerance": tolerance} | _at(good, error <= tolerance, error, cost)
            for tolerance in tolerances
        ]
    return pd.DataFrame(rows, columns=list(FRONT_COLUMNS)).astype(FRONT_COLUMNS)


def _at(
    good: pd.DataFrame, within: np.ndarray, error: np.ndarray, cost: np.ndarray
) -> dict[str, object]:
    """The cheapest of the measurements `within` a tolerance, and of the default ones."""
    default = within & good["default"].to_numpy(bool)
    label, least, its = _cheapest(good, within, error, cost)
    own_label, own_cost, own = _cheapest(good, default, error, cost)
    return {
        "cheapest": label,
        "cost": least,
        "error": its,
        "default": own_label,
        "default_cost": own_cost,
        "default_error": own,
        "ratio": own_cost / least,
    }


def _cheapest(
    good: pd.DataFrame, among: np.ndarray, error: np.ndarray, cost: np.ndarray
) -> tuple[str, float, float]:
    rows = np.flatnonzero(among)
    if not len(rows):
        return "", np.nan, np.nan
    best = rows[np.argmin(cost[rows])]
    return str(good["label"].iloc[best]), float(cost[best]), float(error[best])
