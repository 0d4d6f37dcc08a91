"""One level from several runs of the same point: their mean, with bounds of all they say."""

from __future__ import annotations

import numpy as np
from scipy import special

SAME = 1e-9


def pooled_interval(
    values: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[float, float, float]:
    """Mean of levels of independent runs with 95 % bounds.

    The half-width is the larger of two, so that it holds where the windows of a run are shorter
    than its slowest bursts, and where starts end in cycles of their own: what the intervals of the
    runs make of their mean, root of the sum of squares over k, and Student's t over the k values.
    The bounds go no further than the outermost of the runs, which t does for two or three. Runs
    that agree to round-off are one run seen k times, with its own bounds.

    Parameters
    ----------
    values, low, high : ndarray (k,)
        Of each run, with its own 95 % bounds.

    Returns
    -------
    mean, low, high : float
        Those of the run itself for k = 1.
    """
    k = len(values)
    if k == 1:
        return float(values[0]), float(low[0]), float(high[0])
    mean = float(values.mean())
    if np.ptp(values) <= SAME * abs(mean):
        return mean, float(low.min()), float(high.max())
    inside = np.linalg.norm(0.5 * (high - low)) / k
    between = special.stdtrit(k - 1, 0.975) * values.std(ddof=1) / np.sqrt(k)
    half = float(max(inside, between))
    return mean, max(mean - half, float(low.min())), min(mean + half, float(high.max()))
