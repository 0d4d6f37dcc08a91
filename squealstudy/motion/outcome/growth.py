"""Growth rate of the exponential phase of a run, whose window is found from the signal itself.

The rate is the slope of a straight line through the logarithm of an amplitude. This file finds the
stretch in which a line fits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.motion.outcome.slope_bounds import block_means, slope_interval
from squealstudy.motion.outcome.straight_stretch import best_stretch, straightness

# how a rate was computed: along the fastest complex mode; from the energy if no mode is followed
LEFT_VECTOR, ENERGY = "left_vector", "energy"
ONSET_LEVEL_RATIO = 0.1  # amplitude at the onset time over the final amplitude
LEAST_ROWS = 24  # fewest rows of a fit
LEAST_PERIODS = 5.0  # fewest periods of the slowest motion in a fit: a part of a ripple misleads
FINAL_LEVEL_SHARE = 0.2  # last share of the record, whose median is the final level
WINDOW_END_LEVEL_RATIO = 0.05  # amplitude at the end of the phase over the final one
SHORT_WINDOW_END_LEVEL_RATIO = 0.075  # the same where that would leave less than one e-folding
SEARCH_BLOCKS = 64  # resolution of the window's ends
# a complex amplitude is mostly noise if ln|xi| changes by more, in the mean between rows of a block
NOISE_LN_CHANGE = 0.5
LEAST_RISE = 0.05  # if ln|xi| rises by less over a record without a bend, the signal is stationary
MIN_LATE_PACE_RATIO = (
    0.5  # a fall has reached a floor if it ends at a smaller share of its mean pace
)


@dataclass(frozen=True)
class GrowthFit:
    """Rate of one exponential phase.

    Attributes
    ----------
    growth_rate, low, high : float
        Growth rate and its 95 % confidence bounds, 1/s; negative for decay, NaN where nothing was
        fitted.
    start, stop : float
        Ends of the window of the fit, s.
    onset_time : float
        When the fitted exponential reaches a tenth of the final amplitude (median over the last
        fifth of the whole record), s, or the first row where it begins above that; NaN unless the
        rate is above zero with 95 % confidence.
    frequency : float
        Mean frequency of a complex amplitude over the window, rad/s; NaN for a real one.
    status : str
        ``ok``; ``no_signal`` (zero or not finite); ``too_short`` (fewer than 24 rows or 5 periods
        between start-up and bend, which includes a stationary signal); ``not_exponential`` (no such
        stretch of the logarithm is straight). `growth_rows` adds ``not_linear``.
    """

    growth_rate: float = np.nan
    low: float = np.nan
    high: float = np.nan
    start: float = np.nan
    stop: float = np.nan
    onset_time: float = np.nan
    frequency: float = np.nan
    status: str = "no_signal"


def fit_growth(
    time: np.ndarray,
    amplitude: np.ndarray,
    until: float = np.inf,
    *,
    period: float = 0.0,
    others: Sequence[np.ndarray] = (),
) -> GrowthFit:
    """Fit |amplitude| = c exp(rate t) where the signal itself is exponential.

    The window ends before the amplitude first reaches `WINDOW_END_LEVEL_RATIO` of the final one.
    Then the rate of a Stuart-Landau amplitude, d ln|xi|/dt = a (1 - r^2) with r the share of the
    final amplitude, has a relative bias below r^2 = 0.25 % (`SHORT_WINDOW_END_LEVEL_RATIO`: 0.6 %).
    Decay is treated as the mirror image.

    A complex amplitude is fitted from its start until its logarithm bends or scatters: a projection
    on a left vector has no start-up, and rows that are mostly noise are skipped. One that falls to
    the end of the record is fitted from there backwards, since large motion falls at another pace.
    A real amplitude is fitted over the straight stretch whose slope has the least relative error.
    The bounds use block means, merged while they are correlated, with a
    heteroscedasticity-consistent variance (HC3) and Student's t.

    Parameters
    ----------
    time : ndarray (rows,)
        Equally spaced times, s; at least three rows in a period of a complex amplitude.
    amplitude : ndarray (rows,)
        Complex (`growing_modes.projection`), or real: an envelope such as sqrt(energy), which may
        ripple.
    until : float
        Time [s] after which rows are not used, as another, faster motion saturates there.
    period : float
        Period of the slowest motion in a real envelope, s: a fit lasts a whole number of these,
        five at least. Zero for an envelope that does not ripple.
    others : sequence of ndarray (rows,) complex
        Amplitudes of other modes, whose share in this one is part of the bounds.
    """
    size = np.abs(amplitude)
    if not np.isfinite(size).all() or not size.any():
        return GrowthFit()
    log = np.log(np.maximum(size, 1e-12 * median_of(size[size > 0])))
    end_level = final_level(log)
    rows = int(np.searchsorted(time, until, side="right"))
    if rows < LEAST_ROWS:
        return GrowthFit(status="too_short")
    time, amplitude, log, first_time = time[:rows], amplitude[:rows], log[:rows], time[0]
    real = not np.iscomplexobj(amplitude)
    step = (time[-1] - time[0]) / (len(time) - 1)
    rows_per_period = period / step if real else 0.0  # rows in a period
    min_rows = max(least_rows(amplitude), int(np.ceil(LEAST_PERIODS * rows_per_period)))
    window = growth_window(RisingLogarithm.of(log, real), min_rows)
    if isinstance(window, str):
        return GrowthFit(status=window)
    window = window[0], whole_periods(*window, rows_per_period)
    time, log, part = (x[slice(*window)] for x in (time, log, amplitude))
    begin, end = float(time[0]), float(time[-1])
    mixed = [mode[:rows][slice(*window)] / part for mode in others if part.all()]
    pace = (end - begin) / (len(time) - 1)
    rate, half_width, middle, level = slope_interval(log, pace, real, mixed)
    onset_level = float(np.log(ONSET_LEVEL_RATIO)) + end_level
    time_to_onset = (onset_level - level) / rate if rate > half_width else np.nan
    return GrowthFit(
        growth_rate=rate,
        low=rate - half_width,
        high=rate + half_width,
        start=begin,
        stop=end,
        onset_time=float(np.maximum(begin + middle + time_to_onset, first_time)),
        frequency=np.nan if real else turn(part) / step,
        status="ok",
    )


def whole_periods(first: int, end: int, period: float) -> int:
    """End of a stretch that is cut to whole periods [rows]; `end` itself where `period` is 0."""
    return first + round(int((end - first) / period) * period) if period else end


def final_level(log: np.ndarray) -> float:
    """Median over the last fifth of a record."""
    return median_of(log[-max(1, int(FINAL_LEVEL_SHARE * len(log))) :])


def median_of(values: np.ndarray) -> float:
    """Median of values (m,), faster than numpy's; NaN where there are none or one is NaN."""
    if not len(values):
        return np.nan
    middle = len(values) // 2
    ranked = np.sort(values)  # NaN at the end
    lower = ranked[middle - 1] if len(values) % 2 == 0 else ranked[middle]
    return float(0.5 * (lower + ranked[middle])) if ranked[-1] == ranked[-1] else np.nan


@dataclass(frozen=True)
class RisingLogarithm:
    """A logarithm (rows,), the sign that makes it rise, and whether the amplitude is real."""

    log: np.ndarray
    sign: float
    real: bool

    @staticmethod
    def of(log: np.ndarray, real: bool) -> RisingLogarithm:
        """The logarithm with the sign of its change from the first fiftieth to the final level."""
        early = block_means(log, max(1, len(log) // 50), real)[0]
        return RisingLogarithm(log, 1.0 if final_level(log) >= early else -1.0, real)

    def blocks(self, width: int, end: int | None = None) -> np.ndarray:
        """Means over blocks of `width` rows before row `end`, with the sign."""
        means: np.ndarray = self.sign * block_means(self.log[:end], max(1, width), self.real)
        return means

    def first_above(self, level: float) -> int:
        """Index of the first row above a level; the number of rows if there is none."""
        width = max(1, len(self.log) // 500)
        above = self.blocks(width) > level
        return int(np.argmax(above)) * width if above.any() else len(self.log)


def growth_window(rising: RisingLogarithm, min_rows: int) -> tuple[int, int] | str:
    """First row and end of the straight stretch to fit, or the status if there is none."""
    end = len(rising.log)
    if rising.sign < 0 and not rising.real and (late := _late_fall(rising, min_rows)):
        return late
    if not _rises_throughout(rising, min_rows):
        level = _ceiling(rising)
        end = rising.first_above(level + float(np.log(WINDOW_END_LEVEL_RATIO)))
        if end < min_rows or abs(rising.log[end - 1] - rising.log[0]) < 1.0:
            end = rising.first_above(level + float(np.log(SHORT_WINDOW_END_LEVEL_RATIO)))
    width = max(3, -(-end // SEARCH_BLOCKS))
    blocks = rising.blocks(width, end)
    skipped = 0 if rising.real else _noisy_blocks(rising.log[:end], width)
    count = max(8, -(-min_rows // width))
    if len(blocks) - skipped < count:
        return "too_short"
    stretch = best_stretch(blocks, count, None if rising.real else skipped)
    if stretch is None:
        return "not_exponential"
    return stretch[0] * width, stretch[1] * width


def bend_time(time: np.ndarray, amplitude: np.ndarray) -> float:
    """Time at which a rising complex amplitude (rows,) nears its final level.

    Infinite where it does not rise, or does not bend. The time of the first row where it has that
    level all along: then no other motion beside it is small.
    """
    size = np.abs(amplitude)
    if len(size) < LEAST_ROWS or not np.isfinite(size).all() or not size.any():
        return np.inf
    rising = RisingLogarithm.of(np.log(np.maximum(size, 1e-12 * median_of(size[size > 0]))), False)
    if rising.sign < 0 or _rises_throughout(rising, least_rows(amplitude)):
        return np.inf
    level = _ceiling(rising) + float(np.log(SHORT_WINDOW_END_LEVEL_RATIO))
    return float(time[min(rising.first_above(level), len(time) - 1)])


def _late_fall(rising: RisingLogarithm, min_rows: int) -> tuple[int, int] | None:
    """The straight stretch at the end of a fall, where motion is smallest; None if that is flat."""
    rows = len(rising.log)
    width = max(3, -(-rows // SEARCH_BLOCKS))
    blocks = rising.blocks(width)
    count = max(8, -(-min_rows // width))
    if len(blocks) < count:
        return None
    stretch = best_stretch(-blocks[::-1], count, 0)
    if stretch is None:
        return None
    first = len(blocks) - stretch[1]
    pace = (blocks[-1] - blocks[first]) / (len(blocks) - 1 - first)
    mean_slope = (blocks[-1] - blocks[0]) / (len(blocks) - 1)
    return (
        (first * width, len(blocks) * width) if pace >= MIN_LATE_PACE_RATIO * mean_slope else None
    )


def _rises_throughout(rising: RisingLogarithm, min_rows: int) -> bool:
    """Whether the logarithm of the whole record is one rising line."""
    rows = len(rising.log)
    blocks = rising.blocks(max(3, rows // SEARCH_BLOCKS))
    if rows < min_rows or len(blocks) < 8:
        return False
    straightness_of_all = straightness(blocks, np.array([0]), np.array([len(blocks)]))
    rise = float(straightness_of_all.slope[0]) * len(blocks)
    return bool(straightness_of_all.accepted()[0]) and rise > max(
        LEAST_RISE, 5 * float(straightness_of_all.error[0])
    )


def _ceiling(rising: RisingLogarithm) -> float:
    """Logarithm of the saturated amplitude, which is above the last one where growth still bends.

    It follows from slope / largest slope = 1 - r^2 at the end of the record (Stuart-Landau).
    """
    final = rising.sign * final_level(rising.log)
    blocks = rising.blocks(len(rising.log) // 100)
    slopes = np.diff(blocks[:: max(1, len(blocks) // 10)])
    last = 0.5 * float(slopes[-2:].sum())
    saturated = 1.0 - last / float(slopes.max()) if slopes.max() > 0 else 1.0
    return final if saturated > 0.75 else final - 0.5 * float(np.log(max(saturated, 1e-12)))


def least_rows(amplitude: np.ndarray) -> int:
    """Fewest rows of a fit; periods follow from the mean turn of the phase between rows."""
    if not np.iscomplexobj(amplitude):
        return LEAST_ROWS
    periods = LEAST_PERIODS * 2 * np.pi / max(abs(turn(amplitude)), 1e-12)
    return max(LEAST_ROWS, int(np.ceil(periods)))


def turn(amplitude: np.ndarray) -> float:
    """Mean turn of the phase of a complex amplitude (rows,) between rows, rad."""
    return float(np.angle(np.vdot(amplitude[:-1], amplitude[1:])))


def _noisy_blocks(log: np.ndarray, width: int) -> int:
    """Number of leading blocks up to the last one that is mostly noise."""
    cut = log[: len(log) // width * width].reshape(-1, width)
    noisy = np.flatnonzero(np.abs(np.diff(cut, axis=1)).mean(axis=1) > NOISE_LN_CHANGE)
    return int(noisy[-1]) + 1 if len(noisy) else 0
