"""Sobol indices of the growth rate: their sample, and the indices from the tables of a study on it.

Saltelli et al., Computer Physics Communications 181 (2010) 259-270: two independent samples A and
B of n points in d parameters, and d matrices AB_i that are A with column i taken from B. The d + 2
points of one base point are a group of neighbouring rows: a failed point spoils only its group, and
more base points only add rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError
from squealstudy.tables.robustness import LARGEST_GROWTH_GROUP, growth_columns

# rows of a group: the points of A and B, and the first mixed one; these are in parameter order
ROW_A, ROW_B, MIXED = 0, 1, 2


class Groups(NamedTuple):
    """Values of the sample by role.

    Attributes
    ----------
    a, b : ndarray (n,)
    ab : ndarray (d, n)
    """

    a: np.ndarray
    b: np.ndarray
    ab: np.ndarray


def saltelli_rows(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """All points (n (d + 2), d) of the samples A and B (n, d), group after group."""
    n, d = A.shape
    rows = np.empty((n, d + MIXED, d))
    rows[:, ROW_A], rows[:, ROW_B], rows[:, MIXED:] = A, B, A[:, None, :]
    i = np.arange(d)
    rows[:, MIXED + i, i] = B
    return rows.reshape(-1, d)


def is_saltelli(x: np.ndarray) -> bool:
    """Whether points (m, d) are a sample of `saltelli_rows`, in its order."""
    m, d = x.shape
    if not m or m % (d + MIXED):
        return False
    rows = x.reshape(-1, d + MIXED, d)
    return bool(np.array_equal(saltelli_rows(rows[:, ROW_A], rows[:, ROW_B]), x))


def base_rows(n_points: int, d: int) -> np.ndarray:
    """Mask (n_points,) of the points of A and B; only these are independent of each other."""
    return np.arange(n_points) % (d + MIXED) < MIXED


def grouped(values: np.ndarray, d: int) -> tuple[Groups, int]:
    """Values (n (d + 2),) by role without groups that have one not finite; number of these."""
    rows = values.reshape(-1, d + MIXED)
    is_solved = np.isfinite(rows).all(axis=1)
    whole_groups = rows[is_solved]
    return Groups(whole_groups[:, ROW_A], whole_groups[:, ROW_B], whole_groups[:, MIXED:].T), int(
        (~is_solved).sum()
    )


MIN_GROUP_SHARE = 0.5  # least share of groups without a failed point
MIN_GROUPS = 8  # least number of groups without a failed point
N_RESAMPLES = 999
ROWS_PER_DRAW = 2**20  # rows of groups that are drawn at once
COLUMNS = (
    {"quantity": "str", "track": "int64", "frequency_hz": "f8", "parameter": "str"}
    | {"first": "f8", "first_low": "f8", "first_high": "f8"}
    | {"total": "f8", "total_low": "f8", "total_high": "f8"}
    | {"groups": "int64", "dropped_groups": "int64", "variance": "f8"}
    | {"tracks": "str", "ambiguous": "bool"}
)


def sobol_table(
    points: pd.DataFrame,
    modes: pd.DataFrame,
    parameters: Sequence[str],
    top: int | None = 8,
    confidence: float = 0.95,
    onsets: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """First and total Sobol indices of growth rates: one row for each quantity and parameter.

    Parameters
    ----------
    points, modes : DataFrame
        Tables of a study whose design is the sample of `saltelli_rows`, in its order.
    parameters : sequence of str
        Columns of the swept parameters, in the order of the study.
    top : int or None
        Unstable tracks beside the largest growth of all modes, unstable at most points first.
    confidence : float
        Confidence of the intervals, which are percentiles of N_RESAMPLES bootstrap resamples of the
        base points, always the same. They assume independent base points, and are too wide for a
        Sobol sequence.
    onsets : DataFrame or None
        Onsets of the study, by which tracks of one mode are recognised.

    Returns
    -------
    DataFrame
        COLUMNS. `quantity` is "largest" (track 0; the largest growth rate of a point, over its
        oscillating modes and growing real roots) or "track". Groups with a point that failed, or at
        which the track has no mode, are dropped: `dropped_groups`; `groups` remain. These are no
        longer a sample of the distributions, and indices and intervals are theirs.
        `tracks` and `ambiguous` as in `robust_table`. The indices of a track are NaN if fewer than
        MIN_GROUPS groups remain, or a smaller share than MIN_GROUP_SHARE. `variance` is that of the
        growth, 1/s^2.
        Estimators: Saltelli et al. 2010, table 2 b and f, as scipy.stats.sobol_indices.

    Raises
    ------
    ResultsError
        Points that are not such a sample, or of which too many failed.
    """
    d = len(parameters)
    if d < 2 or not is_saltelli(points[list(parameters)].to_numpy(dtype=float)):
        raise ResultsError("Sobol indices need all points of a design of type 'sobol_indices'")
    tables = []
    for quantity in growth_columns(points, modes, top, onsets):
        if quantity.track < LARGEST_GROWTH_GROUP:  # divergence is part of the largest growth
            continue
        groups, dropped = grouped(quantity.growth, d)
        n_whole = len(groups.a)
        enough = n_whole >= MIN_GROUPS and n_whole >= MIN_GROUP_SHARE * (n_whole + dropped)
        if quantity.track == LARGEST_GROWTH_GROUP and not enough:
            raise ResultsError(
                f"Sobol indices need whole groups of design points: {dropped} of "
                f"{dropped + n_whole} groups have one that failed or has no mode in the band "
                f"({int((points['status'] != 'ok').sum())} points failed)"
            )
        table = _indices(groups, confidence) if enough else _none(d)
        table.insert(0, "parameter", list(parameters))
        table["quantity"] = "largest" if quantity.track == LARGEST_GROWTH_GROUP else "track"
        table["track"], table["frequency_hz"] = quantity.track, quantity.frequency_hz
        table["tracks"] = ", ".join(map(str, quantity.tracks))
        table["ambiguous"] = quantity.ambiguous
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


def _moments(groups: Groups) -> np.ndarray:
    """Quantities (n, 2 + 3 d) whose means over the n groups of points give the estimators.

    A resample is then a weighted sum of rows: its values need not be gathered.
    """
    middle = np.concatenate([groups.a, groups.b]).mean()
    a, b, ab = (values - middle for values in groups)
    both = np.stack([a + b, a**2 + b**2]) / 2
    moments: np.ndarray = np.vstack([both, ab - a, b * (ab - a), (a - ab) ** 2]).T
    return np.ascontiguousarray(moments)


def _from_moments(m: np.ndarray) -> np.ndarray:
    """`saltelli_estimate` (2, d) from the means (2 + 3 d,) of `_moments`."""
    mean, square = m[:2]
    step, product, distance = m[2:].reshape(3, -1)
    variance = square - mean**2
    if variance <= 1e-12 * square:  # rounding: all values of this resample are equal
        return np.zeros((2, len(step)))
    indices: np.ndarray = np.stack([product - mean * step, distance / 2]) / variance
    return indices


def _indices(groups: Groups, confidence: float) -> pd.DataFrame:
    """Indices and their intervals: one row for each parameter."""
    from scipy.stats import bootstrap

    n = len(groups.a)
    moments = _moments(groups)

    def resampled(rows: np.ndarray) -> np.ndarray:
        return _from_moments(np.bincount(rows, minlength=n) @ moments / n)

    estimates = saltelli_estimate(*groups)
    interval = bootstrap(
        [np.arange(n)],
        resampled,
        n_resamples=N_RESAMPLES,
        batch=max(1, ROWS_PER_DRAW // n),
        confidence_level=confidence,
        method="percentile",
        vectorized=False,
        rng=np.random.default_rng(0),
    ).confidence_interval
    table = pd.DataFrame()
    for k, name in enumerate(("first", "total")):
        table[name] = estimates[k]
        table[f"{name}_low"], table[f"{name}_high"] = interval.low[k], interval.high[k]
    return table


def _none(d: int) -> pd.DataFrame:
    names = [n for n in COLUMNS if n.startswith(("first", "total"))]
    return pd.DataFrame(np.nan, index=range(d), columns=names)
