"""Levels of a vibration over time, and the pace of their logarithm, with bounds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import special

from squealstudy.motion.outcome.levels import JUDGED_SHARE
from squealstudy.motion.outcome.spectrum import spectrum

WINDOW_COUNT_RANGE = (15, 25)  # fewest and most windows of a record
WINDOW_PERIODS = 5.0  # periods of the energy's slowest line in a window, where the record has them
# least number of windows of a record in which each of 15 windows would be shorter than a period
MIN_WINDOWS_SHORT_RECORD = 7
FINE_PERIODS = 3.0  # periods in one of the shorter windows
BURST_PERIODS = 10.0  # periods of the vibration in windows whose scatter shows irregular motion
# the slowest line is the frequency below which the energy's ripple has this share of its power
SLOW_POWER_SHARE = 1e-3
LINE_RECORD_SHARE = 0.2  # lines of a record are sought in this share at its end
LEAST_ROWS = 8  # fewest rows of a window that is weighted
LEAST_WINDOWS = 5  # fewest levels of a trend
BOUND_CONFIDENCE = 0.995  # one-sided confidence of bounds
MAX_CORRELATION = 0.9  # largest correlation of neighbouring windows that bounds take into account
MIN_REL_SCATTER = 1e-9  # least scatter of a level between neighbouring windows
SILENT_LEVEL_RATIO = 1e-12  # least level over the largest one, where lines are sought
SMALLEST_POSITIVE = 1e-300


@dataclass(frozen=True)
class LevelWindows:
    """RMS levels of equal windows of a record.

    Attributes
    ----------
    start : ndarray (m,)
        Start of each window, s.
    level : ndarray (m,)
        Square root of the weighted mean of the energy in each window.
    judged : int
        Index of the first window that is judged: the judged ones are the last 40 % of the record.
    fine : ndarray (n,)
        Levels of shorter windows, three periods each where the record has them.
    burst : ndarray (k,)
        Levels of windows of ten periods of the vibration each, whatever the record's length.
    periods : float
        Periods of the vibration in the record; NaN where the energy has no line.
    """

    start: np.ndarray
    level: np.ndarray
    judged: int
    fine: np.ndarray
    burst: np.ndarray
    periods: float

    def trend(self) -> tuple[float, float, float]:
        """Relative rise over the judged windows, its standard error, and the scatter about it."""
        return level_trend(self.level[self.judged :])

    def course(self, share: float) -> LevelTrend:
        """Trend of the logarithm of the levels over the last `share` of the record."""
        return LevelTrend.of(logarithm(last_part(self.level, share)))


def last_part(values: np.ndarray, share: float) -> np.ndarray:
    """The last `share` of values (m,), but five at least."""
    return values[-min(len(values), max(LEAST_WINDOWS, round(share * len(values)))) :]


def logarithm(level: np.ndarray) -> np.ndarray:
    """Natural logarithm of levels (m,), of which zero counts as a smallest number."""
    log_level: np.ndarray = np.log(np.maximum(level, SMALLEST_POSITIVE))
    return log_level


def level_trend(level: np.ndarray) -> tuple[float, float, float]:
    """Relative rise over levels (m,), its standard error, and the scatter about it."""
    y = level / (level.mean() or 1.0)
    x = np.arange(len(y)) - 0.5 * (len(y) - 1)
    slope = float(x @ y / (x @ x))
    residual = y - y.mean() - slope * x
    variance = float(residual @ residual) / (len(y) - 2)
    return slope * len(y), len(y) * float(np.sqrt(variance / (x @ x))), float(np.sqrt(variance))


def windows(time: np.ndarray, energy: np.ndarray) -> LevelWindows:
    """Levels of 15 to 25 windows of a record, which hold five periods each if it is long enough.

    The periods are those of the slowest line of the energy: the loudest line of a torque may be a
    harmonic. Where the record has few periods of its main line there are fewer windows, of three
    periods each, seven at least. The weight within a window is sin^4, so that parts of periods at
    its ends hardly count.

    Parameters
    ----------
    time : ndarray (rows,)
        Equally spaced times, s; `WINDOW_COUNT_RANGE[0]` rows or more.
    energy : ndarray (rows,)
        Energy of the vibration (`energies.vibration_energy`), or a squared torque fluctuation.
    """
    min_windows, max_windows = WINDOW_COUNT_RANGE
    rows = len(energy)
    width = rows // min_windows
    middle = rows % min_windows + width * (np.arange(min_windows) + 0.5)
    level = _levels(energy, min_windows)
    level = np.maximum(level, SILENT_LEVEL_RATIO * (level.max() or 1.0))
    trend = np.interp(np.arange(rows), middle, np.log(level / level.max()))
    slow, line = _periods(energy / level.max() ** 2 * np.exp(-2 * trend))
    count = int(min(max(slow / WINDOW_PERIODS, min_windows), min(max_windows, rows)))
    if line < FINE_PERIODS * count:  # a record of few periods
        count = max(MIN_WINDOWS_SHORT_RECORD, int(line / FINE_PERIODS))
    fine = max(LEAST_ROWS, int(FINE_PERIODS * rows / slow))
    burst = count if np.isnan(line) else max(count, int(0.5 * line / BURST_PERIODS))
    return LevelWindows(
        start=time[rows % count :: rows // count][:count],
        level=_levels(energy, count),
        judged=count - max(LEAST_WINDOWS, round(JUDGED_SHARE * count)),
        fine=_levels(energy, max(count, rows // fine)),
        burst=_levels(energy, max(count, min(burst, rows // LEAST_ROWS))),
        periods=0.5 * line,
    )


def _levels(energy: np.ndarray, count: int) -> np.ndarray:
    """Weighted RMS of `count` windows at the end of a record."""
    rms_levels: np.ndarray = np.sqrt(window_means(energy, count))
    return rms_levels


def window_means(values: np.ndarray, count: int) -> np.ndarray:
    """Weighted means of `count` equal windows at the end of a record."""
    rows = len(values) // count
    weight = _weight(rows)
    means: np.ndarray = values[len(values) - count * rows :].reshape(count, rows) @ weight
    return means


@lru_cache(maxsize=64)
def _weight(rows: int) -> np.ndarray:
    """Weights (rows,) within a window, whose sum is 1; read-only."""
    weight = np.ones(rows)
    if rows >= LEAST_ROWS:
        weight = np.sin(np.pi * (np.arange(rows) + 0.5) / rows) ** 4
    weight = weight / weight.sum()
    weight.flags.writeable = False
    return weight


def _periods(ripple: np.ndarray) -> tuple[float, float]:
    """Periods in the whole record of the slowest and of the main line of its last fifth."""
    rows = max(LEAST_ROWS, round(LINE_RECORD_SHARE * len(ripple)))
    power = spectrum(1.0, ripple[-rows:]).power[3:]
    if not power.any():
        return np.inf, np.nan
    total = np.cumsum(power)
    slow = np.searchsorted(total, SLOW_POWER_SHARE * total[-1]) + 3
    line = np.argmax(power * np.arange(3, len(power) + 3)) + 3  # bursts are loud below it
    return float(slow * len(ripple) / rows), float(line * len(ripple) / rows)


@dataclass(frozen=True)
class LevelTrend:
    """A parabola through the logarithms of successive levels, over the whole stretch.

    Attributes
    ----------
    rise, error : float
        Rise of the logarithm over the stretch, negative for a fall, and half-width of its 99 %
        interval.
    begin, end, end_error : float
        Pace at the two ends, as the rise that it would give over the whole stretch, and half-width
        of the interval of either.
    bend_error : float
        Half-width of the interval of `end` - `begin`.
    thirds : tuple of float
        Rise over each third.
    scatter : float
        Standard deviation about the parabola.
    """

    rise: float
    error: float
    begin: float
    end: float
    end_error: float
    bend_error: float
    thirds: tuple[float, float, float]
    scatter: float

    @staticmethod
    def of(y: np.ndarray) -> LevelTrend:
        """Fit a parabola to y (m,), five values or more."""
        m = len(y)
        x = (np.arange(m) - 0.5 * (m - 1)) * 2 / m
        square = x**2 - (x @ x) / m
        slope, bend = float(x @ y / (x @ x)), float(square @ y / (square @ square))
        residual = y - y.mean() - slope * x - bend * square
        size = float(residual @ residual)
        scatter = float(np.sqrt(size / (m - 3))) + MIN_REL_SCATTER
        rho = (
            float(residual[1:] @ residual[:-1]) / size + 2.0 / m
            if size > m * MIN_REL_SCATTER**2
            else 0.0
        )
        rho = min(max(rho, 0.0), MAX_CORRELATION)
        reach = float(special.stdtrit(m - 3, BOUND_CONFIDENCE)) * float(
            np.sqrt((1 + rho) / (1 - rho))
        )
        error = 2 * reach * scatter / float(np.sqrt(x @ x))
        # half-width of the change of pace from the middle to an end
        bent = 4 * reach * scatter / float(np.sqrt(square @ square))
        samples = np.interp(np.linspace(0, m - 1, 4), np.arange(m), y)
        first, second, third = (np.diff(samples) * m / (m - 1)).tolist()
        return LevelTrend(
            rise=2 * slope,
            error=error,
            begin=2 * slope - 4 * bend,
            end=2 * slope + 4 * bend,
            end_error=float(np.hypot(error, bent)),
            bend_error=2 * bent,
            thirds=(first, second, third),
            scatter=scatter,
        )
