"""Levels and lines of a torque history, with bounds from sub-windows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from squealstudy.motion.outcome.intervals import periods_interval, periods_mean
from squealstudy.motion.outcome.spectrum import (
    FLUCTUATION_ROUND_OFF,
    LINE_PERIODS,
    folds,
    spectrum,
    unfolded_line,
)

JUDGED_SHARE = 0.4  # last share of a record, which is judged
LEAST_PERIODS = 20.0  # periods of the dominant line in that part, where the record has them
N_HALF_BLOCKS = 5  # blocks of each half of that part, whose mean squares show a transient
MIN_REL_TRANSIENT = 0.05  # least change of the mean square, over the second half, of a transient
MAX_REST_OVER_TRANSIENT = 0.2  # range of mean squares in the second half over the transient
N_QUARTERS = 4  # parts of a window, whose peaks show whether they still change
LEAST_ROWS = 8  # fewest rows of a period whose peaks are compared


@dataclass(frozen=True)
class TorqueLevels:
    """Levels over a window, in the unit of the signal.

    Attributes
    ----------
    mean, rms, peak_to_peak : float
        Mean, RMS of the fluctuation about the mean, and peak to peak.
    mean_low, mean_high, rms_low, rms_high : float
        95 % bounds of mean and RMS by the finite length of the window.
    peak_scatter : float
        Peak to peak of the window less that of its quietest quarter.
    frequency_hz : float
        Frequency of the dominant line; NaN where the signal is flat, the window has fewer than
        three periods of any line, or rows are too far apart.
    line, harmonic_2, harmonic_3 : float
        RMS of the dominant line and at twice and three times its frequency, each within 1.5 %
        (three bins at least) of that frequency; 0 where there is none, NaN where rows are too far
        apart.
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
        Equally spaced times [s], and the signal there.
    means : ndarray (rows,) or None
        Means of the signal over the time since the row before. With them a line that is folded
        counts as none.
    """
    if len(time) < 2:
        return slice(0, len(time))
    line = unfolded_line(step_of(time), signal[judged_part(len(time))], means)
    return window_of_line(time, signal, float(line))


def judged_part(rows: int) -> slice:
    """The last 40 % of a record."""
    return slice(rows - max(1, round(JUDGED_SHARE * rows)), rows)


def step_of(time: np.ndarray) -> float:
    """Time [s] between rows at times (m,), two or more."""
    return float(time[-1] - time[0]) / (len(time) - 1)


def window_of_line(time: np.ndarray, signal: np.ndarray, frequency: float) -> slice:
    """The `last_window` of a record, by the dominant line [Hz] of its judged part; NaN for none."""
    rows, part = len(time), judged_part(len(time))
    count = rows - part.start
    if np.isfinite(frequency):
        min_rows = int(np.ceil(LEAST_PERIODS / (frequency * step_of(time))))
        if min_rows <= count // 2 and _begins_with_transient(signal[part]):
            count //= 2
        count = max(count, min_rows)
    return slice(max(0, rows - count), rows)


def _begins_with_transient(signal: np.ndarray) -> bool:
    """Whether mean squares of the first half differ much from those of the second, which stay."""
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
    """Sums of the torque over the steps between rows, each (rows,), or (m, rows) of several runs.

    Attributes
    ----------
    mean, variance : ndarray
        Mean over the time since the row before, and variance about that mean.
    least, most : ndarray
        Extremes over that time.
    """

    mean: np.ndarray
    variance: np.ndarray
    least: np.ndarray
    most: np.ndarray

    @classmethod
    def of(cls, history: Mapping[str, np.ndarray], window: slice) -> TorqueSums | None:
        """Sums of a window's rows; None where the integrator did not sum, as in old results."""
        if "torque_mean" not in history:
            return None
        names = ("torque_mean", "torque_variance", "torque_min", "torque_max")
        sums = cls(*(history[name][window] for name in names))
        return sums if np.isfinite(sums.mean).all() else None

    @classmethod
    def of_rows(cls, torque: np.ndarray) -> TorqueSums:
        """Sums of rows alone, each of which stands for the time since the row before."""
        return cls(torque, np.zeros_like(torque), torque, torque)

    @property
    def side_by_side(self) -> TorqueSums:
        """The sums of one run as those of several, (1, rows)."""
        return TorqueSums(self.mean[None], self.variance[None], self.least[None], self.most[None])

    @classmethod
    def together(cls, sums: Sequence[TorqueSums]) -> TorqueSums:
        """Sums of several runs (m, rows)."""
        names = ("mean", "variance", "least", "most")
        return cls(*(np.array([getattr(part_sums, name) for part_sums in sums]) for name in names))

    def at(self, runs: np.ndarray) -> TorqueSums:
        """The sums of the runs with these indices."""
        return TorqueSums(self.mean[runs], self.variance[runs], self.least[runs], self.most[runs])

    def squares(self, mean: np.ndarray | float) -> np.ndarray:
        """Mean squares (.., rows) between rows, about one mean (..) for all rows."""
        squares: np.ndarray = self.variance + (self.mean - np.asarray(mean)[..., None]) ** 2
        return squares

    def extent(self, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean and peak to peak (m,) of several runs, and a mask of those beyond round-off."""
        mean = self.mean.mean(axis=1)
        largest, smallest = self.most.max(axis=1), self.least.min(axis=1)
        half_swing = np.maximum(np.abs(largest - mean), np.abs(smallest - mean))
        moves = half_swing > FLUCTUATION_ROUND_OFF * np.abs(torque).max(axis=1)
        return mean, largest - smallest, moves & (torque.shape[1] > 1)

    def quietest_quarter(self) -> np.ndarray:
        """Least peak to peak (m,) of a quarter of each run; of a half where rows are few."""
        rows = self.least.shape[1]
        count = min(N_QUARTERS if rows >= LEAST_ROWS * N_QUARTERS else 2, rows)
        starts = [part[0] for part in np.array_split(np.arange(rows), count)]
        largest = np.maximum.reduceat(self.most, starts, axis=1)
        smallest = np.minimum.reduceat(self.least, starts, axis=1)
        quietest: np.ndarray = (largest - smallest).min(axis=1)
        return quietest


def torque_levels(
    time: np.ndarray, torque: np.ndarray, sums: TorqueSums | None = None
) -> TorqueLevels:
    """Levels of a window of a history: from sums over every step, else from the rows.

    Parameters
    ----------
    time, torque : ndarray (rows,)
        Equally spaced times [s] and torque [N m] of the window; all finite, one row or more.
    sums : TorqueSums or None
        Sums of the same rows. With them mean and RMS are over whole periods of the dominant line.
    """
    step = step_of(time) if len(time) > 1 else 0.0
    return levels_side_by_side(step, torque[None], sums and sums.side_by_side)[0]


def levels_side_by_side(
    step: float, torque: np.ndarray, sums: TorqueSums | None
) -> list[TorqueLevels]:
    """`torque_levels` of windows (m, rows) with rows `step` seconds apart."""
    exact = sums is not None
    sums = sums or TorqueSums.of_rows(torque)
    mean, swing, moves = sums.extent(torque)
    levels = [TorqueLevels(mean=x, mean_low=x, mean_high=x) for x in mean.tolist()]
    moving = np.flatnonzero(moves)
    if not len(moving):
        return levels
    sums, torque = sums.at(moving), torque[moving]
    lines = spectrum(step, torque)
    frequency, unseen = lines.peak(), np.zeros(len(moving))
    if exact:
        unseen[folds(lines, frequency, step, sums.mean)] = np.nan
    frequency = frequency + unseen
    line, harmonic_2, harmonic_3 = (lines.level(k * frequency) + unseen for k in (1, 2, 3))
    width = 1.0 / (frequency * step) if exact else np.full(len(moving), np.nan)
    mean, mean_low, mean_high = periods_interval(sums.mean, width)
    square, low, high = (
        np.sqrt(np.maximum(x, 0.0)) for x in periods_interval(sums.squares(mean), width)
    )
    columns = {
        "mean": mean,
        "mean_low": mean_low,
        "mean_high": mean_high,
        "rms": square,
        "rms_low": low,
        "rms_high": high,
        "peak_to_peak": swing[moving],
        "peak_scatter": swing[moving] - sums.quietest_quarter(),
        "frequency_hz": frequency,
        "line": line,
        "harmonic_2": harmonic_2,
        "harmonic_3": harmonic_3,
    }
    for index, run in enumerate(moving):
        levels[run] = TorqueLevels(**{name: float(x[index]) for name, x in columns.items()})
    return levels


def plain_levels(time: np.ndarray, torque: np.ndarray, sums: TorqueSums | None) -> np.ndarray:
    """RMS, mean and peak to peak (3,) of `torque_levels`, without bounds and lines."""
    step = step_of(time) if len(time) > 1 else 0.0
    return plain_levels_side_by_side(step, torque[None], sums and sums.side_by_side)[0]


def plain_levels_side_by_side(
    step: float, torque: np.ndarray, sums: TorqueSums | None
) -> np.ndarray:
    """`plain_levels` (m, 3) of windows (m, rows) with rows `step` seconds apart."""
    over_steps = sums is not None
    sums = sums or TorqueSums.of_rows(torque)
    mean, swing, moves = sums.extent(torque)
    levels = np.stack([np.zeros(len(mean)), mean, np.zeros(len(mean))], axis=1)
    moving = np.flatnonzero(moves)
    if not len(moving):
        return levels
    sums, torque = sums.at(moving), torque[moving]
    width = np.full(len(moving), np.nan)
    if over_steps:
        width = 1.0 / (unfolded_line(step, torque, sums.mean) * step)
    mean = periods_mean(sums.mean, width)
    square = periods_mean(sums.squares(mean), width)
    levels[moving] = np.stack([np.sqrt(np.maximum(square, 0.0)), mean, swing[moving]], axis=1)
    return levels


def errors_by_rows(torque: np.ndarray) -> np.ndarray:
    """Errors (3,) of RMS, mean and peak to peak that are computed from the rows of a window alone.

    Each is the larger change if every other row is left out; zeros for fewer than four rows.
    """
    if len(torque) < 4:
        return np.zeros(3)
    halves = (torque, torque[::2], torque[1::2])
    of_all_rows, *of_halves = (np.array([x.std(), x.mean(), np.ptp(x)]) for x in halves)
    changes: np.ndarray = np.abs(np.array(of_halves) - of_all_rows).max(axis=0)
    return changes


def period_swings(sums: TorqueSums, width: float) -> np.ndarray:
    """Peak to peak (periods,) of single periods of `width` rows, counted from the end backwards.

    Empty for fewer than three periods, and for periods of fewer than eight rows.
    """
    count = int(len(sums.least) / width) if width >= LEAST_ROWS else 0
    if count < LINE_PERIODS:
        return np.zeros(0)
    ends = len(sums.least) - np.round(width * np.arange(count, -1, -1)).astype(int)
    return np.array([sums.most[a:b].max() - sums.least[a:b].min() for a, b in pairwise(ends)])


def swing_spread(sums: TorqueSums, width: float) -> float:
    """Range of the `period_swings` over their mean; NaN without any, or where nothing swings."""
    swings = period_swings(sums, width)
    if not len(swings) or not swings.mean() > FLUCTUATION_ROUND_OFF * np.abs(sums.mean).max():
        return np.nan
    return float(np.ptp(swings) / swings.mean())
