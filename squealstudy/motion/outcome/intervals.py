"""Means with bounds: from sub-windows of a record, whole periods of a motion, and several runs.

Of several records side by side.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy import special

SUBWINDOW_COUNTS = (20, 10, 5)  # sub-windows of an interval; fewer while neighbours are correlated
MAX_CORRELATION = 0.1
# of the variance of sub-windows, that a straight line holds: a drift, no chance
MIN_TREND_VARIANCE_SHARE = 0.7
# ratio of the drift of successive thirds, up to which what is left is extrapolated
MAX_DRIFT_RATIO = 0.9
# times what is extrapolated: three means of a beat that fades tell it roughly
EXTRAPOLATION_SAFETY = 1.5
MAX_REL_DRIFT = 0.05  # of the mean: a drift beyond it is of motion that passes
# of an approach that beats: overlapping smooth windows over the periods, in which beats average out
N_SMOOTH_WINDOWS = 5
MIN_SMOOTH_PERIODS = 20  # of a record whose windows smooth anything
MIN_SMOOTH_VARIANCE_SHARE = 0.9  # that a line holds of their means; chance reaches it in 2 %
SMOOTH_RATIO_RANGE = (0.3, 0.85)  # of the slopes of the two halves, that are believed
SMOOTH_SAFETY = 1.6  # times what is left of an approach with beats: chosen on Hoffmann's oscillator
MAX_REL_SMOOTH_DRIFT = 0.2  # of the mean: a larger one is of motion that passes
PERIODS_OF_HARMONICS = 6  # periods of the second or third harmonic that are whole ones of the first
IDENTICAL_RUNS_REL_SPREAD = 1e-9  # relative: runs that agree so well are one run


def mean_interval(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean of each column with 95 % bounds from sub-windows.

    Student's t over the means of 20, 10 or 5 equal blocks: the first number at which neighbouring
    blocks are not correlated (lag-one coefficient), so that blocks are longer than the correlation
    time; what correlation five blocks still have widens the interval.

    Parameters
    ----------
    values : ndarray (rows,) or (rows, m)

    Returns
    -------
    mean, low, high : ndarray () or (m,)
        Bounds are the mean itself for fewer than five rows.
    """
    mean = values.mean(axis=0)
    half = _half_width(mean, _row_blocks(values))
    return mean, mean - half, mean + half


def periods_interval(
    values: np.ndarray, width: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`mean_interval` of values (..., rows) that are means between rows, over whole periods.

    The periods have `width` (...) rows, no whole number; they are counted from the last row
    backwards. A periodic motion has no scatter then, where blocks that cut its periods have. As the
    loudest line may be the second or third harmonic, the mean is over a multiple of six periods
    where there are twelve. NaN, or fewer than five periods: `mean_interval` itself.

    Returns
    -------
    mean, low, high : ndarray (...)
    """
    flat = values.reshape(-1, values.shape[-1])
    widths = np.broadcast_to(width, values.shape[:-1]).reshape(-1)
    count, bounds = _period_count(flat.shape[1], widths), np.empty((3, len(flat)))
    rows = np.flatnonzero(count == 0)
    if len(rows):
        bounds[:, rows] = mean_interval(flat[rows].T)
    rows = np.flatnonzero(count)
    if len(rows):
        mean, half = _Periods.of(flat[rows], widths[rows], count[rows]).interval()
        bounds[:, rows] = mean, mean - half, mean + half
    mean, low, high = bounds.reshape(3, *values.shape[:-1])
    return mean[()], low[()], high[()]


def periods_mean(values: np.ndarray, width: np.ndarray | float) -> np.ndarray:
    """The mean of `periods_interval`."""
    flat = values.reshape(-1, values.shape[-1])
    widths = np.broadcast_to(width, values.shape[:-1]).reshape(-1)
    mean, count = flat.mean(axis=1), _period_count(flat.shape[1], widths)
    rows = np.flatnonzero(count)
    if len(rows):
        mean[rows] = _Periods.of(flat[rows], widths[rows], count[rows]).mean()
    means: np.ndarray = mean.reshape(values.shape[:-1])[()]
    return means


def _period_count(rows: int, width: np.ndarray) -> np.ndarray:
    """How many whole periods of `width` rows (m,) a mean is over, 0 where it is over rows."""
    with np.errstate(invalid="ignore"):
        has_rows = width >= 1.0
    count = (rows / np.where(has_rows, width, np.inf) * (1 + 1e-12)).astype(int)
    count = np.where(count < SUBWINDOW_COUNTS[-1], 0, count)
    left_over = np.where(count >= 2 * PERIODS_OF_HARMONICS, count % PERIODS_OF_HARMONICS, 0)
    whole_rows: np.ndarray = count - left_over
    return whole_rows


@dataclass(frozen=True, eq=False)
class _Periods:
    """Values (m, rows) that are means between rows, and their whole periods.

    Attributes
    ----------
    summed : ndarray (m, rows + 1)
        From the first row on.
    width : ndarray (m,)
        Rows in a period.
    count : ndarray (m,) of int
        Periods that a mean is over, five or more.
    """

    summed: np.ndarray
    width: np.ndarray
    count: np.ndarray

    @staticmethod
    def of(values: np.ndarray, width: np.ndarray, count: np.ndarray) -> _Periods:
        """Cumulative sums of one or more series of values."""
        summed = np.zeros((len(values), values.shape[1] + 1))
        np.cumsum(values, axis=1, out=summed[:, 1:])
        return _Periods(summed, width, count)

    def means(self, edges: np.ndarray) -> np.ndarray:
        """Means (m, k) between edges (m, k + 1), in periods from the last row backwards."""
        rows = self.summed.shape[1] - 1
        position = np.minimum(np.maximum(rows - self.width[:, None] * edges, 0.0), rows)
        before = np.minimum(position.astype(int), rows - 1)
        sum_before, sum_after = (
            np.take_along_axis(self.summed, k, 1) for k in (before, before + 1)
        )
        sum_before = sum_before + (position - before) * (sum_after - sum_before)
        blocks: np.ndarray = np.diff(sum_before) / (self.width[:, None] * -np.diff(edges))
        return blocks

    def mean(self) -> np.ndarray:
        """Mean over all periods (m,)."""
        return self.means(np.stack([self.count, np.zeros(len(self.count))], axis=1))[:, 0]

    def blocks(self, number: int) -> np.ndarray:
        """Means (m, number) of blocks of whole periods that hold all of them, the earliest first.

        One that is said of fewer periods than blocks is not meant.
        """
        edges = np.round(np.linspace(np.maximum(self.count, number), 0, number + 1, axis=1))
        return self.means(edges)

    def interval(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean, and half of its interval (m,)."""
        mean = self.mean()
        by_number = {number: self.blocks(number) for number in SUBWINDOW_COUNTS}
        half, is_correlated = np.zeros_like(mean), np.ones(len(mean), dtype=bool)
        for number, blocks in by_number.items():
            served = is_correlated & (self.count >= number)
            of_blocks, rho = _student(blocks.T)
            half = np.where(served, of_blocks, half)
            is_correlated &= ~served | (rho > MAX_CORRELATION)
        fine, coarse = (by_number[number] for number in SUBWINDOW_COUNTS[1:])
        thirds = self.blocks(3)
        to_come = np.where(
            self.count >= SUBWINDOW_COUNTS[1],
            _still_to_come(mean, fine, thirds),
            _still_to_come(mean, coarse, thirds),
        )
        return mean, np.maximum.reduce([half, to_come, self._left_of_an_approach(mean)])

    def _left_of_an_approach(self, mean: np.ndarray) -> np.ndarray:
        """`_left_behind_beats` of single periods (m,); a loop, that no run rounds by its batch."""
        left = np.zeros_like(mean)
        for k in np.flatnonzero(self.count >= MIN_SMOOTH_PERIODS):
            run = _Periods(*(x[k : k + 1] for x in (self.summed, self.width, self.count)))
            left[k] = _left_behind_beats(run.blocks(int(self.count[k]))[0], float(mean[k]))
        return left


def _still_to_come(mean: np.ndarray, blocks: np.ndarray, thirds: np.ndarray) -> np.ndarray:
    """How far the limit of a level that is approached is from its mean (m,); 0 where none is seen.

    It is where means of sub-windows (m, k) lie along a line: the drift from third to third goes on
    by its ratio (Aitken). A drift by much of the mean is that of a motion that passes, without a
    limit.
    """
    x = np.arange(blocks.shape[1]) - 0.5 * (blocks.shape[1] - 1)
    deviations = blocks - blocks.mean(axis=1, keepdims=True)
    total = (deviations**2).sum(axis=1)
    drifts = (total > 0) & (
        (deviations * x).sum(axis=1) ** 2 >= MIN_TREND_VARIANCE_SHARE * total * float(x @ x)
    )
    first, second = np.diff(thirds, axis=1).T
    passes = np.abs(thirds[:, 2] - thirds[:, 0]) > MAX_REL_DRIFT * np.abs(mean)
    goes_on = drifts & (first * second > 0) & ~passes
    ratio = np.minimum(second / np.where(goes_on, first, 1.0), MAX_DRIFT_RATIO)
    ahead = EXTRAPOLATION_SAFETY * second * ratio / (1 - ratio)
    limit: np.ndarray = np.where(goes_on, np.abs(thirds[:, 2] + ahead - mean), 0.0)
    return limit


def _left_behind_beats(periods: np.ndarray, mean: float) -> float:
    """How far the limit of an approach that beats is from the mean; 0 where none is seen.

    Means of single periods (n,) may swing by more than they drift. Those of five overlapping
    windows, each a third of the record with Hann's weights, lie along a line where they drift. An
    exponential of that slope in the middle, whose slopes in the halves have their ratio, has the
    rest of its way before it there: slope over rate.
    """
    width = len(periods) // 3
    weight = np.sin(np.pi * np.arange(1, width + 1) / (width + 1)) ** 2
    starts = np.round(np.linspace(0, len(periods) - width, N_SMOOTH_WINDOWS)).astype(int)
    smooth = np.array([float((weight * periods[k : k + width]).sum()) for k in starts])
    smooth /= weight.sum()
    x = np.arange(N_SMOOTH_WINDOWS) - 0.5 * (N_SMOOTH_WINDOWS - 1)
    deviation, spread = smooth - smooth.mean(), float(x @ x)
    slope, total = float(x @ deviation) / spread, float(deviation @ deviation)
    on_line = slope**2 * spread
    if not (total > 0 and on_line >= MIN_SMOOTH_VARIANCE_SHARE * total):
        return 0.0
    if abs(slope) * (N_SMOOTH_WINDOWS - 1) > MAX_REL_SMOOTH_DRIFT * abs(mean):
        return 0.0
    middle = N_SMOOTH_WINDOWS // 2
    first, second = smooth[middle] - smooth[0], smooth[-1] - smooth[middle]
    least, most = SMOOTH_RATIO_RANGE
    ratio = min(max(second / first, least), most) if first * second > 0 else most
    return float(SMOOTH_SAFETY * abs(slope) * middle / -np.log(ratio))


def _row_blocks(values: np.ndarray) -> Iterator[np.ndarray]:
    """Means of 20, 10 and 5 equal blocks of rows, where there are so many."""
    for count in SUBWINDOW_COUNTS:
        width = len(values) // count
        if width:
            cut = values[len(values) - count * width :]
            yield np.add.reduceat(cut, np.arange(0, len(cut), width), axis=0) / width


def _half_width(mean: np.ndarray, block_means: Iterable[np.ndarray]) -> np.ndarray:
    """Half-width of the interval of a mean () or (m,), from means of blocks (count, ..)."""
    half = np.zeros_like(mean)
    is_correlated = np.ones(np.shape(mean), dtype=bool)
    for blocks in block_means:
        of_blocks, rho = _student(blocks)
        half = np.where(is_correlated, of_blocks, half)
        is_correlated = is_correlated & (rho > MAX_CORRELATION)
    return half


def _student(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Half-width of a mean's interval by its blocks (count, ..), and their correlation."""
    count = len(blocks)
    deviations = blocks - blocks.mean(axis=0)
    size = (deviations**2).sum(axis=0)
    product = (deviations[1:] * deviations[:-1]).sum(axis=0)
    rho = np.where(size > 0, product / np.where(size > 0, size, 1.0) + 1.0 / count, 0.0)
    rho_counted = np.minimum(np.maximum(rho, 0.0), 0.9)
    error = np.sqrt(size / (count * (count - 1)) * (1 + rho_counted) / (1 - rho_counted))
    return special.stdtrit(count - 1, 0.975) * error, rho


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
    if np.ptp(values) <= IDENTICAL_RUNS_REL_SPREAD * abs(mean):
        return mean, float(low.min()), float(high.max())
    inside = np.linalg.norm(0.5 * (high - low)) / k
    between = special.stdtrit(k - 1, 0.975) * values.std(ddof=1) / np.sqrt(k)
    half = float(max(inside, between))
    return mean, max(mean - half, float(low.min())), min(mean + half, float(high.max()))
