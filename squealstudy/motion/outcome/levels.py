"""Levels and lines of a torque history, with bounds from sub-windows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import special

from squealstudy.motion.outcome.spectrum import (
    FLUCTUATION_ROUND_OFF,
    LINE_PERIODS,
    folds,
    spectrum,
    unfolded_line,
)

JUDGED_SHARE = 0.4  # of a record: the part that is judged
LEAST_PERIODS = 20.0  # of the dominant line in it, where the record has them
SUBWINDOW_COUNTS = (20, 10, 5)  # sub-windows of an interval; fewer while neighbours are correlated
MAX_CORRELATION = 0.1
N_HALF_BLOCKS = 5  # of each half of the judged part, by whose mean squares a transient is seen
MIN_REL_TRANSIENT = 0.05  # of the mean square of the second half: less is no transient
MAX_REST_OVER_TRANSIENT = 0.2  # by which the second half differs within itself, over the transient
N_QUARTERS = 4  # of a window, by whose peaks it is seen whether these still change
LEAST_ROWS = 8  # of a period whose peaks are told
# of the variance of sub-windows, that a straight line holds: a drift, no chance
MIN_TREND_VARIANCE_SHARE = 0.7
# ratio of the drift of successive thirds, up to which what is left is extrapolated
MAX_DRIFT_RATIO = 0.9
# times what is extrapolated: three means of a beat that fades tell it roughly
EXTRAPOLATION_SAFETY = 1.5
MAX_REL_DRIFT = 0.05  # of the mean: a drift beyond it is of motion that passes
PERIODS_OF_HARMONICS = 6  # periods of the second or third harmonic that are whole ones of the first
IDENTICAL_RUNS_REL_SPREAD = 1e-9  # relative: runs that agree so well are one run


@dataclass(frozen=True)
class TorqueLevels:
    """Levels over a window, in the unit of the signal.

    Attributes
    ----------
    mean, rms, peak_to_peak : float
        rms is that of the fluctuation about the mean.
    mean_low, mean_high, rms_low, rms_high : float
        95 % bounds of mean and rms, of what the window leaves open.
    peak_scatter : float
        By which the peak to peak of the quietest quarter of the window is smaller.
    frequency_hz : float
        Of the dominant line; NaN where the signal is flat, the window has fewer than three periods
        of any line, or rows are too far apart to tell it.
    line, harmonic_2, harmonic_3 : float
        RMS of the dominant line and at twice and three times its frequency, each within 1.5 %
        (three bins at least) of its frequency; 0 where there is none, NaN where rows do not tell.
    """

    mean: float
    mean_low: float
    mean_high: float
    rms: float = 0.0
    rms_low: float = 0.0
    rms_high: float = 0.0
    peak_to_peak: float = 0.0
    peak_scatter: float = 0.0
    frequency_hz: float = np.nan
    line: float = 0.0
    harmonic_2: float = 0.0
    harmonic_3: float = 0.0


def last_window(time: np.ndarray, signal: np.ndarray, means: np.ndarray | None = None) -> slice:
    """Rows that are judged: the last 40 %, or 20 periods of its dominant line where that is longer.

    The whole record where it is shorter than that; the last fifth where the last 40 % begin with
    the end of a transient, and that fifth has 20 periods.

    Parameters
    ----------
    time, signal : ndarray (rows,)
        Equally spaced, s.
    means : ndarray (rows,) or None
        Over the time since the row before: a line that folds then counts as none.
    """
    rows = len(time)
    count = max(1, round(JUDGED_SHARE * rows))
    if rows > 1:
        step = (time[-1] - time[0]) / (rows - 1)
        frequency = unfolded_line(step, signal[rows - count :], means)
        if np.isfinite(frequency):
            least = int(np.ceil(LEAST_PERIODS / (frequency * step)))
            if least <= count // 2 and _begins_with_transient(signal[rows - count :]):
                count //= 2
            count = max(count, least)
    return slice(max(0, rows - count), rows)


def _begins_with_transient(signal: np.ndarray) -> bool:
    """Whether the mean squares of the first half go over to those of the second, which stay."""
    first, second = np.array_split(block_mean_squares(signal, 2 * N_HALF_BLOCKS), 2)
    transient = float(np.abs(first - second.mean()).max())
    return (
        transient > MIN_REL_TRANSIENT * float(second.mean())
        and float(np.ptp(second)) <= MAX_REST_OVER_TRANSIENT * transient
    )


def block_mean_squares(signal: np.ndarray, count: int) -> np.ndarray:
    """Mean squares (count,) of equal blocks of a signal, each about its own mean."""
    return np.array([float(block.var()) for block in np.array_split(signal, count)])


@dataclass(frozen=True)
class TorqueSums:
    """What the torque did over every step between rows, each (rows,).

    Attributes
    ----------
    mean, variance : ndarray
        Over the time since the row before, the variance about that mean.
    least, most : ndarray
        Extremes there.
    """

    mean: np.ndarray
    variance: np.ndarray
    least: np.ndarray
    most: np.ndarray

    @classmethod
    def of(cls, history: Mapping[str, np.ndarray], window: slice) -> TorqueSums | None:
        """Of the rows of a window; None where the integrator did not sum, as of old results."""
        if "torque_mean" not in history:
            return None
        names = ("torque_mean", "torque_variance", "torque_min", "torque_max")
        sums = cls(*(history[name][window] for name in names))
        return sums if np.isfinite(sums.mean).all() else None

    @classmethod
    def of_rows(cls, torque: np.ndarray) -> TorqueSums:
        """Of rows alone, each taken for all of the time since the one before."""
        return cls(torque, np.zeros_like(torque), torque, torque)

    def squares(self, mean: float) -> np.ndarray:
        """Mean squares about a mean of all, in each row."""
        squares: np.ndarray = self.variance + (self.mean - mean) ** 2
        return squares


def torque_levels(
    time: np.ndarray, torque: np.ndarray, sums: TorqueSums | None = None
) -> TorqueLevels:
    """Levels of a window of a history: from sums over every step, else from the rows.

    Parameters
    ----------
    time, torque : ndarray (rows,)
        The window only, equally spaced, s and N m; all finite, one row or more.
    sums : TorqueSums or None
        Of the same rows. Mean and RMS are then those of whole periods of the dominant line.
    """
    exact = sums is not None
    sums = sums or TorqueSums.of_rows(torque)
    mean, swing = float(sums.mean.mean()), float(sums.most.max() - sums.least.min())
    rest = np.abs([sums.most.max() - mean, sums.least.min() - mean]).max()
    if rest <= FLUCTUATION_ROUND_OFF * np.abs(torque).max() or len(torque) < 2:
        return TorqueLevels(mean=mean, mean_low=mean, mean_high=mean)
    step = (time[-1] - time[0]) / (len(time) - 1)
    lines = spectrum(step, torque)
    frequency = lines.peak()
    is_folded = exact and folds(lines, frequency, step, sums.mean)
    frequency = np.nan if is_folded else frequency
    unseen = np.nan if is_folded else 0.0
    line, harmonic_2, harmonic_3 = (lines.level(k * frequency) + unseen for k in (1, 2, 3))
    width = 1.0 / (frequency * step) if exact and np.isfinite(frequency) else np.nan
    mean, mean_low, mean_high = (float(x) for x in periods_interval(sums.mean, width))
    squares = periods_interval(sums.squares(mean), width)
    square, low, high = (np.sqrt(np.maximum(x, 0.0)) for x in squares)
    return TorqueLevels(
        mean=mean,
        mean_low=float(mean_low),
        mean_high=float(mean_high),
        rms=float(square),
        rms_low=float(low),
        rms_high=float(high),
        peak_to_peak=swing,
        peak_scatter=swing - min(float(np.ptp(part)) for part in _quarters(sums)),
        frequency_hz=frequency,
        line=line,
        harmonic_2=harmonic_2,
        harmonic_3=harmonic_3,
    )


def plain_levels(time: np.ndarray, torque: np.ndarray, sums: TorqueSums | None) -> np.ndarray:
    """RMS, mean and peak to peak (3,) as `torque_levels` tells them, without bounds and lines."""
    over_steps = sums is not None
    sums = sums or TorqueSums.of_rows(torque)
    mean, swing = float(sums.mean.mean()), float(sums.most.max() - sums.least.min())
    rest = np.abs([sums.most.max() - mean, sums.least.min() - mean]).max()
    if rest <= FLUCTUATION_ROUND_OFF * np.abs(torque).max() or len(torque) < 2:
        return np.array([0.0, mean, 0.0])
    step = (time[-1] - time[0]) / (len(time) - 1)
    frequency = unfolded_line(step, torque, sums.mean) if over_steps else np.nan
    width = 1.0 / (frequency * step) if np.isfinite(frequency) else np.nan
    mean = periods_mean(sums.mean, width)
    square = periods_mean(sums.squares(mean), width)
    return np.array([np.sqrt(max(square, 0.0)), mean, swing])


def _quarters(sums: TorqueSums) -> Iterator[np.ndarray]:
    """Least and largest torque of each quarter of a window, of halves where rows are few."""
    count = N_QUARTERS if len(sums.least) >= LEAST_ROWS * N_QUARTERS else 2
    for least, most in zip(
        *(np.array_split(x, count) for x in (sums.least, sums.most)), strict=True
    ):
        yield np.array([least.min(), most.max()])


def errors_by_rows(torque: np.ndarray) -> np.ndarray:
    """Errors (3,) of RMS, mean and peak to peak of a window that are made from its rows alone.

    The largest change where every other row is left out; zeros for fewer than four rows.
    """
    if len(torque) < 4:
        return np.zeros(3)
    halves = (torque, torque[::2], torque[1::2])
    whole, *others = (np.array([x.std(), x.mean(), np.ptp(x)]) for x in halves)
    changes: np.ndarray = np.abs(np.array(others) - whole).max(axis=0)
    return changes


def period_swings(sums: TorqueSums, width: float) -> np.ndarray:
    """Peaks to peak (periods,) of single periods of `width` rows, from the end back.

    Empty of fewer than three periods and of periods of fewer than eight rows.
    """
    count = int(len(sums.least) / width) if width >= LEAST_ROWS else 0
    if count < LINE_PERIODS:
        return np.zeros(0)
    ends = len(sums.least) - np.round(width * np.arange(count, -1, -1)).astype(int)
    return np.array([sums.most[a:b].max() - sums.least[a:b].min() for a, b in pairwise(ends)])


def swing_spread(sums: TorqueSums, width: float) -> float:
    """Range of the `period_swings` over their mean; NaN of none, and without a swing."""
    swings = period_swings(sums, width)
    if not len(swings) or not swings.mean() > FLUCTUATION_ROUND_OFF * np.abs(sums.mean).max():
        return np.nan
    return float(np.ptp(swings) / swings.mean())


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


def periods_interval(values: np.ndarray, width: float) -> tuple[float, float, float]:
    """As `mean_interval` of values (rows,) that are means between rows, over whole periods.

    The periods have `width` rows, no whole number; they are counted from the last row backwards. A
    periodic motion has no scatter then, where blocks that cut its periods have. As the loudest line
    may be the second or third harmonic, the mean is over a multiple of six periods where there are
    twelve. NaN, or fewer than five periods: `mean_interval` itself.
    """
    count, means = _periods(values, width)
    if not count:
        mean, low, high = mean_interval(values)
        return float(mean), float(low), float(high)
    overall_mean = float(means(np.array([count, 0.0]))[0])
    blocks = [
        means(_whole_periods(count, number)) for number in SUBWINDOW_COUNTS if count >= number
    ]
    half = float(_half_width(np.array(overall_mean), blocks))
    half = max(half, _still_to_come(overall_mean, blocks[-2:][0], means(_whole_periods(count, 3))))
    return overall_mean, overall_mean - half, overall_mean + half


def periods_mean(values: np.ndarray, width: float) -> float:
    """The mean of `periods_interval`."""
    count, means = _periods(values, width)
    return float(means(np.array([count, 0.0]))[0] if count else values.mean())


def _periods(values: np.ndarray, width: float) -> tuple[int, Callable[[np.ndarray], np.ndarray]]:
    """How many whole periods a mean is over, 0 for none, and means between edges.

    Edges are in periods from the last row backwards, the earliest first.
    """
    summed = np.concatenate([[0.0], np.cumsum(values)])

    def means(edges: np.ndarray) -> np.ndarray:
        at = np.interp(len(values) - width * edges, np.arange(len(summed)), summed)
        blocks: np.ndarray = np.diff(at) / (width * -np.diff(edges))
        return blocks

    count = int(len(values) / width * (1 + 1e-12)) if width > 0 else 0
    if count < SUBWINDOW_COUNTS[-1] or width < 1:
        return 0, means
    return count - (count % PERIODS_OF_HARMONICS if count >= 2 * PERIODS_OF_HARMONICS else 0), means


def _whole_periods(count: int, number: int) -> np.ndarray:
    """Edges of blocks (number + 1,) of whole periods that hold all of them, the earliest first."""
    return np.round(np.linspace(count, 0, number + 1))


def _still_to_come(mean: float, blocks: np.ndarray, thirds: np.ndarray) -> float:
    """How far the limit of a level that is approached is from its mean; 0 where none is seen.

    It is where means of sub-windows lie along a line: the drift from third to third goes on by its
    ratio (Aitken). A drift by much of the mean is that of a motion that passes, without a limit.
    """
    x = np.arange(len(blocks)) - 0.5 * (len(blocks) - 1)
    rest = blocks - blocks.mean()
    total = float(rest @ rest)
    if not total > 0 or float(x @ rest) ** 2 < MIN_TREND_VARIANCE_SHARE * total * float(x @ x):
        return 0.0
    first, second = np.diff(thirds).tolist()
    if first * second <= 0 or abs(thirds[2] - thirds[0]) > MAX_REL_DRIFT * abs(mean):
        return 0.0
    ratio = min(second / first, MAX_DRIFT_RATIO)
    return abs(float(thirds[2]) + EXTRAPOLATION_SAFETY * second * ratio / (1 - ratio) - mean)


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
        count = len(blocks)
        rest = blocks - blocks.mean(axis=0)
        size = (rest**2).sum(axis=0)
        product = (rest[1:] * rest[:-1]).sum(axis=0)
        rho = np.where(size > 0, product / np.where(size > 0, size, 1.0) + 1.0 / count, 0.0)
        rho_counted = np.minimum(np.maximum(rho, 0.0), 0.9)
        error = np.sqrt(size / (count * (count - 1)) * (1 + rho_counted) / (1 - rho_counted))
        half = np.where(is_correlated, special.stdtrit(count - 1, 0.975) * error, half)
        is_correlated = is_correlated & (rho > MAX_CORRELATION)
    return half


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
