"""Sobol indices of the growth rate, from the tables of a study on their sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError
from squealstudy.tables.robust.growth_table import LARGEST, growth_columns
from squealstudy.tables.robust.saltelli import Groups, grouped, is_saltelli

LEAST_SHARE = 0.5  # of the groups that must be whole
LEAST_GROUPS = 8
RESAMPLES = 999
COLUMNS = (
    {"quantity": "str", "track": "int64", "frequency_hz": "f8", "parameter": "str"}
    | {"first": "f8", "first_low": "f8", "first_high": "f8"}
    | {"total": "f8", "total_low": "f8", "total_high": "f8"}
    | {"groups": "int64", "dropped_groups": "int64", "variance": "f8"}
)


def sobol_table(
    points: pd.DataFrame,
    modes: pd.DataFrame,
    parameters: Sequence[str],
    top: int | None = 8,
    confidence: float = 0.95,
) -> pd.DataFrame:
    """First and total Sobol indices of growth rates, one row a quantity and parameter.

    Parameters
    ----------
    points, modes : DataFrame
        Tables of a study whose design is the sample of tables.robust.saltelli, in its order.
    parameters : sequence of str
        Columns of the swept parameters, in the order of the study.
    top : int or None
        Unstable tracks beside the largest growth of all modes, unstable at most points first.
    confidence : float
        Of the intervals: percentiles of RESAMPLES bootstrap resamples of the base points, always
        the same ones. They take these as independent draws: wide for a Sobol sequence.

    Returns
    -------
    DataFrame
        COLUMNS. `quantity` is "largest" (track 0; the largest growth rate of a point, over its
        oscillating modes and growing real roots) or "track". A point that failed, or at which the
        track has no mode, takes its whole group along; `groups` are left, `dropped_groups` are not.
        The indices of a track of fewer whole groups than LEAST_SHARE are NaN. `variance` is that of
        the growth, 1/s^2.
        Estimators: Saltelli et al. 2010, table 2 b and f, as scipy.stats.sobol_indices.

    Raises
    ------
    ResultsError
        Where the points are not such a sample, or too many of them failed.
    """
    d = len(parameters)
    if d < 2 or not is_saltelli(points[list(parameters)].to_numpy(dtype=float)):
        raise ResultsError("Sobol indices need all points of a design of type 'sobol_indices'")
    tables = []
    for quantity in growth_columns(points, modes, top):
        if quantity.track < LARGEST:  # divergence is part of the largest growth
            continue
        groups, dropped = grouped(quantity.growth, d)
        enough = _enough(len(groups.a), dropped)
        if quantity.track == LARGEST and not enough:
            raise ResultsError(
                f"Sobol indices need whole groups of design points: {dropped} of "
                f"{dropped + len(groups.a)} groups have one that failed "
                f"({int((points['status'] != 'ok').sum())} points); see status in points"
            )
        table = _indices(groups, confidence) if enough else _none(d)
        table.insert(0, "parameter", list(parameters))
        table["quantity"] = "largest" if quantity.track == LARGEST else "track"
        table["track"], table["frequency_hz"] = quantity.track, quantity.frequency_hz
        table["groups"], table["dropped_groups"] = len(groups.a), dropped
        table["variance"] = np.var([groups.a, groups.b]) if enough else np.nan
        tables.append(table)
    return pd.concat(tables, ignore_index=True)[list(COLUMNS)].astype(COLUMNS)


def saltelli_estimate(f_A: np.ndarray, f_B: np.ndarray, f_AB: np.ndarray) -> np.ndarray:
    """First and total indices (2, d) from values (n,), (n,), (d, n) of any number of groups.

    The estimators of scipy.stats.sobol_indices, which takes powers of two only; zero where the
    values do not vary.
    """
    both = np.concatenate([f_A, f_B])
    variance = np.var(both)
    if variance <= (1e-12 * np.abs(both).max()) ** 2:  # rounding
        return np.zeros((2, len(f_AB)))
    first = ((f_B - both.mean()) * (f_AB - f_A)).mean(axis=-1) / variance
    total = 0.5 * ((f_A - f_AB) ** 2).mean(axis=-1) / variance
    return np.stack([first, total])


def _enough(whole: int, dropped: int) -> bool:
    return whole >= LEAST_GROUPS and whole >= LEAST_SHARE * (whole + dropped)


def _indices(groups: Groups, confidence: float) -> pd.DataFrame:
    """Indices and intervals, one row a parameter."""
    from scipy.stats import bootstrap, sobol_indices

    a, b, ab = groups
    n = len(a)

    def resampled(rows: np.ndarray) -> np.ndarray:
        return saltelli_estimate(a[rows], b[rows], ab[:, rows])

    value = resampled(np.arange(n))
    if n & (n - 1) == 0 and value.any():  # nothing was dropped, or by chance a power of two is left
        found = sobol_indices(func={"f_A": a[None], "f_B": b[None], "f_AB": ab[:, None]}, n=n)
        value = np.stack([found.first_order, found.total_order])
    interval = bootstrap(
        [np.arange(n)],
        resampled,
        n_resamples=RESAMPLES,
        confidence_level=confidence,
        method="percentile",
        vectorized=False,
        rng=np.random.default_rng(0),
    ).confidence_interval
    table = pd.DataFrame()
    for k, name in enumerate(("first", "total")):
        table[name] = value[k]
        table[f"{name}_low"], table[f"{name}_high"] = interval.low[k], interval.high[k]
    return table


def _none(d: int) -> pd.DataFrame:
    names = [n for n in COLUMNS if n.startswith(("first", "total"))]
    return pd.DataFrame(np.nan, index=range(d), columns=names)
