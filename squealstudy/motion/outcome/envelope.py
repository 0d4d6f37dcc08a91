"""Levels of a vibration over time, and how their logarithm goes on: its pace, with bounds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import special

from squealstudy.motion.outcome.levels import JUDGED_SHARE
from squealstudy.motion.outcome.spectrum import spectrum

WINDOW_COUNT_RANGE = (15, 25)  # of a record, fewest and most
WINDOW_PERIODS = 5.0  # of the slowest line of the energy in one, where the record has them
# windows of a record of so few periods that 15 would hold parts of them
MIN_WINDOWS_SHORT_RECORD = 7
FINE_PERIODS = 3.0  # in one of the shorter windows
BURST_PERIODS = 10.0  # of the vibration in windows whose scatter tells irregular motion
# of the power of what the energy does within windows: what is slower is no line
SLOW_POWER_SHARE = 1e-3
LINE_RECORD_SHARE = 0.2  # of a record: where its lines are looked at
LEAST_ROWS = 8  # of a window that is weighted
LEAST_WINDOWS = 5  # of a course
BOUND_CONFIDENCE = 0.995  # one-sided, of bounds
MAX_CORRELATION = 0.9  # most that neighbouring windows are taken for
MIN_REL_SCATTER = 1e-9  # of a level, between neighbouring windows
SILENT_LEVEL_RATIO = 1e-12  # of the largest level: what is smaller has no lines
SMALLEST_POSITIVE = 1e-300


@dataclass(frozen=True)
class LevelWindows:
    """RMS levels of equal windows of a record.

    Attributes
    ----------
    start : ndarray (m,)
        s.
    level : ndarray (m,)
        Square root of the weighted mean of the energy in each.
    judged : int
        The first of those that are judged: the last 40 % of the record.
    fine : ndarray (n,)
        Levels of shorter windows, three periods each where the record has them.
    burst : ndarray (k,)
        Levels of windows of ten periods of the vibration each, whatever the record's length.
    periods : float
        Of the vibration in the record; NaN where the energy has no line.
    """

    start: np.ndarray
    level: np.ndarray
    judged: int
    fine: np.ndarray
    burst: np.ndarray
    periods: float

    def trend(self) -> tuple[float, float, float]:
        """Relative rise over the judged windows, its standard error, scatter about it."""
        return level_trend(self.level[self.judged :])

    def course(self, share: float) -> LevelTrend:
        """How the levels went over the last `share` of the record."""
        return LevelTrend.of(logarithm(last_part(self.level, share)))


def last_part(values: np.ndarray, share: float) -> np.ndarray:
    """The last `share` of values (m,), five at least."""
    return values[-min(len(values), max(LEAST_WINDOWS, round(share * len(values)))) :]


def logarithm(level: np.ndarray) -> np.ndarray:
    """Natural logarithm of levels (m,); of zero that of the smallest number."""
    log_level: np.ndarray = np.log(np.maximum(level, SMALLEST_POSITIVE))
    return log_level


def level_trend(level: np.ndarray) -> tuple[float, float, float]:
    """Relative rise over levels (m,), its standard error, scatter about it."""
    y = level / (level.mean() or 1.0)
    x = np.arange(len(y)) - 0.5 * (len(y) - 1)
    slope = float(x @ y / (x @ x))
    residual = y - y.mean() - slope * x
    variance = float(residual @ residual) / (len(y) - 2)
    return slope * len(y), len(y) * float(np.sqrt(variance / (x @ x))), float(np.sqrt(variance))


def windows(time: np.ndarray, energy: np.ndarray) -> LevelWindows:
    """Levels of 25 windows, or of as few as 15 where those hold five periods each, 7 if three.

    The periods are those of the slowest line of the energy: the loudest line of a torque may be a
    harmonic. The weight within a window is sin^4, so that what it cuts off a period is not seen.

    Parameters
    ----------
    time : ndarray (rows,)
        Equally spaced, s; `WINDOW_COUNT_RANGE[0]` rows or more.
    energy : ndarray (rows,)
        Of the vibration (`energies.vibration_energy`), or a squared torque fluctuation.
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
    """Weights (rows,) of the sum 1 within a window; read-only."""
    weight = np.ones(rows)
    if rows >= LEAST_ROWS:
        weight = np.sin(np.pi * (np.arange(rows) + 0.5) / rows) ** 4
    weight = weight / weight.sum()
    weight.flags.writeable = False
    return weight


def _periods(ripple: np.ndarray) -> tuple[float, float]:
    """Periods in the whole record of the slowest line of its last fifth, and of the main one."""
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
        Of the logarithm over the stretch, negative for a fall, and half of its 99 % interval.
    begin, end, end_error : float
        Pace at its two ends, as the rise that it would give over the stretch; half of the interval
        of either.
    bend_error : float
        Half of the interval of `end` - `begin`.
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
        """Fit of five values or more."""
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
        bent = 4 * reach * scatter / float(np.sqrt(square @ square))  # of the pace, middle to end
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
