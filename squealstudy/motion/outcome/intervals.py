"""Means with bounds: from sub-windows of a record, whole periods of a motion, and several runs.

Arrays hold several records side by side.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy import special

SUBWINDOW_COUNTS = (20, 10, 5)  # sub-windows of a mean; fewer are used if neighbours are correlated
MAX_CORRELATION = 0.1  # largest correlation of neighbours that counts as none
# a trend through sub-windows is a drift, not chance, if it makes up this share of their variance
MIN_TREND_VARIANCE_SHARE = 0.7
MAX_DRIFT_RATIO = 0.9  # largest ratio of the drifts of successive thirds in an extrapolation
EXTRAPOLATION_SAFETY = 1.5  # factor on it: three means of a beat that fades show it only roughly
MAX_REL_DRIFT = 0.05  # a motion with a larger drift over the mean is passing, without a limit
# number of overlapping smooth windows, in which the beats of an approach average out
N_SMOOTH_WINDOWS = 5
MIN_SMOOTH_PERIODS = 20  # least number of periods in a record with such windows
MIN_SMOOTH_VARIANCE_SHARE = 0.9  # share of a line in their variance; chance reaches it in 2 %
SMOOTH_RATIO_RANGE = (0.3, 0.85)  # range of the ratio of the slopes of the two halves
BEND_ERRORS = 1.9  # standard errors of their bend; Student's t of two degrees exceeds it in 10 %
SMOOTH_SAFETY = 1.6  # factor on the distance from the limit: chosen on Hoffmann's oscillator
MAX_REL_SMOOTH_DRIFT = 0.2  # a motion with a larger drift over the mean is passing
PERIODS_OF_HARMONICS = 6  # periods of a second or third harmonic that are whole ones of the first
IDENTICAL_RUNS_REL_SPREAD = 1e-9  # runs with a smaller relative spread are one and the same


def mean_interval(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean of each column with 95 % bounds from sub-windows.

    The bounds follow from Student's t over the means of 20, 10 or 5 equal blocks. It is the first
    number at which neighbouring blocks are not correlated (lag-one coefficient), so that blocks are
    longer than the correlation time. If five blocks still are, that widens the interval.

    Parameters
    ----------
    values : ndarray (rows,) or (rows, m)

    Returns
    -------
    mean, low, high : ndarray () or (m,)
        The mean and its bounds, which are equal to it for fewer than five rows.
    """
    mean = values.mean(axis=0)
    half = _half_width(mean, _row_blocks(values))
    return mean, mean - half, mean + half


def periods_interval(
    values: np.ndarray, width: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`mean_interval` over whole periods, of values (..., rows) that are means between rows.

    A period has `width` (...) rows, in general no whole number; periods are counted from the last
    row backwards. Then a periodic motion has no scatter, unlike in blocks that cut its periods. As
    the loudest line may be the second or third harmonic, the mean is over a multiple of six periods
    where there are twelve. Where `width` is NaN, or there are fewer than five periods, the result
    is that of `mean_interval`.

    Returns
    -------
    mean, low, high : ndarray (...)
        The mean and its 95 % bounds.
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
    """Number of whole periods of `width` rows (m,) for a mean; 0 where it is over rows."""
    with np.errstate(invalid="ignore"):
        has_rows = width >= 1.0
    count = (rows / np.where(has_rows, width, np.inf) * (1 + 1e-12)).astype(int)
    count = np.where(count < SUBWINDOW_COUNTS[-1], 0, count)
    left_over = np.where(count >= 2 * PERIODS_OF_HARMONICS, count % PERIODS_OF_HARMONICS, 0)
    whole_periods: np.ndarray = count - left_over
    return whole_periods


@dataclass(frozen=True, eq=False)
class _Periods:
    """Values (m, rows) that are means between rows, and their whole periods.

    Attributes
    ----------
    summed : ndarray (m, rows + 1)
        Cumulative sums of the values, with a zero first.
    width : ndarray (m,)
        Rows in a period.
    count : ndarray (m,) of int
        Number of periods for a mean, five or more.
    """

    summed: np.ndarray
    width: np.ndarray
    count: np.ndarray

    @staticmethod
    def of(values: np.ndarray, width: np.ndarray, count: np.ndarray) -> _Periods:
        """Periods of values (m, rows)."""
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
        """Means (m, number) of blocks of whole periods, which hold all periods, the earliest first.

        The rows of series with fewer periods than blocks are meaningless.
        """
        edges = np.round(np.linspace(np.maximum(self.count, number), 0, number + 1, axis=1))
        return self.means(edges)

    def interval(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (m,) and half-width of its interval (m,)."""
        mean = self.mean()
        by_number = {number: self.blocks(number) for number in SUBWINDOW_COUNTS}
        half, is_correlated = np.zeros_like(mean), np.ones(len(mean), dtype=bool)
        for number, blocks in by_number.items():
            served = is_correlated & (self.count >= number)
            of_blocks, rho = _student(blocks.T)
            half = np.where(served, of_blocks, half)
            is_correlated &= ~served | (rho > MAX_CORRELATION)
        return mean, np.maximum(half, self.to_come(mean))

    def to_come(self, mean: np.ndarray) -> np.ndarray:
        """Distances (m,) of the means from the limits that they approach; 0 where none shows."""
        fine, coarse = (self.blocks(number) for number in SUBWINDOW_COUNTS[1:])
        thirds = self.blocks(3)
        to_come = np.where(
            self.count >= SUBWINDOW_COUNTS[1],
            _still_to_come(mean, fine, thirds),
            _still_to_come(mean, coarse, thirds),
        )
        return np.maximum(to_come, self._left_of_an_approach(mean))

    def _left_of_an_approach(self, mean: np.ndarray) -> np.ndarray:
        """`_left_behind_beats` of the means of single periods (m,).

        A loop over series, so that the round-off of one does not depend on its batch.
        """
        left = np.zeros_like(mean)
        for k in np.flatnonzero(self.count >= MIN_SMOOTH_PERIODS):
            run = _Periods(*(x[k : k + 1] for x in (self.summed, self.width, self.count)))
            left[k] = _left_behind_beats(run.blocks(int(self.count[k]))[0], float(mean[k]))
        return left


def _still_to_come(mean: np.ndarray, blocks: np.ndarray, thirds: np.ndarray) -> np.ndarray:
    """Distance (m,) of the mean from the limit that a level approaches; 0 where it does not drift.

    It drifts where the means of sub-windows (m, k) lie along a line. The limit follows from the
    ratio of the drifts from third to third (Aitken). A drift by much of the mean is that of a
    passing motion, without a limit.
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
    """Distance of the mean from the limit of an approach with beats; 0 where it does not drift.

    Means of single periods (n,) may swing by more than they drift. The means of five overlapping
    windows, each a third of the record with Hann's weights, lie along a line where they drift. The
    rate of an exponential approach follows from the ratio of the slopes in the two halves, of a
    parabola that bends as little as its error allows; in the middle the distance from the limit is
    the slope over the rate.
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
    square = x**2 - (x @ x) / len(x)
    bend, rest = float(square @ deviation) / float(square @ square), len(x) - 3
    residual = deviation - slope * x - bend * square
    error = float(np.sqrt(residual @ residual / rest / (square @ square)))
    bend += BEND_ERRORS * error * float(np.sign(slope))
    first, second = slope - middle * bend, slope + middle * bend
    least, most = SMOOTH_RATIO_RANGE
    ratio = min(max(second / first, least), most) if first * second > 0 else most
    return float(SMOOTH_SAFETY * abs(slope) * middle / -np.log(ratio))


def _row_blocks(values: np.ndarray) -> Iterator[np.ndarray]:
    """Means of 20, 10 and 5 equal blocks of rows; a number is left out if there are fewer rows."""
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
    """Half-width of a mean's interval from means of blocks (count, ..), and their correlation."""
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

    The half-width is the larger of two: that of the mean by the runs' own intervals (the root of
    the sum of squares over k), and that by Student's t over the k values. So it holds where the
    windows of a run are shorter than its slowest bursts, and where starts end in different cycles.
    The bounds go no further than the outermost bounds of the runs, as t would for two or three
    runs. Runs that agree to round-off are one run k times, with its own bounds.

    Parameters
    ----------
    values, low, high : ndarray (k,)
        Level of each run, with its own 95 % bounds.

    Returns
    -------
    mean, low, high : float
        For k = 1 those of the run itself.
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
