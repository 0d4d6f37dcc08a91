"""Growth rate of the exponential phase of a run, its window found in the signal itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from squealstudy.analysis.runs.growth_window import (
    LEAST_ROWS,
    Rising,
    final_level,
    growth_window,
    least_rows,
)
from squealstudy.analysis.runs.straight_line import slope_interval

ONSET = 0.1  # of the final amplitude


@dataclass(frozen=True)
class GrowthFit:
    """Rate of one exponential phase.

    Attributes
    ----------
    growth_rate, low, high : float
        1/s with its 95 % confidence bounds; negative for decay, NaN where nothing was fitted.
    start, stop : float
        The window of the fit, s.
    onset_time : float
        When the fitted exponential reaches a tenth of the final amplitude (median over the last
        fifth of the whole record), s, or the first row where it begins above that; NaN unless the
        rate is above zero with 95 % confidence.
    n_rows : int
        Rows in the window.
    frequency_hz : float
        From the slope of the phase, positive either way; NaN for a real amplitude.
    status : str
        ``ok``, ``no_signal`` (zero or not finite), ``too_short`` (fewer than 24 rows or 5 periods
        between start-up and bend, a stationary signal included) or ``not_exponential`` (no such
        stretch of the logarithm is straight).
    """

    growth_rate: float = np.nan
    low: float = np.nan
    high: float = np.nan
    start: float = np.nan
    stop: float = np.nan
    onset_time: float = np.nan
    n_rows: int = 0
    frequency_hz: float = np.nan
    status: str = "no_signal"


def fit_growth(
    time: np.ndarray,
    amplitude: np.ndarray,
    ceiling: float | None = None,
    until: float = np.inf,
) -> GrowthFit:
    """Fit |amplitude| = c exp(rate t) where the signal itself is exponential.

    The window ends before the logarithm first comes within `SHARE` of its final level: a
    Stuart-Landau amplitude, d ln|xi|/dt = a (1 - r^2) with r the share of the final amplitude, is
    then read with a relative bias below r^2 = 0.25 % (`SHARE_SHORT`: 0.6 %). Decay is the mirror
    image, with the floor as the final level. Within that, a complex amplitude is fitted from its
    start (a projection on a left vector has no start-up; rows that are mostly noise are skipped)
    until its logarithm bends or scatters; a real one over the straight stretch whose slope has the
    least relative error. The bounds use block means, merged while they are correlated, with a
    heteroscedasticity-consistent variance (HC3) and Student's t.

    Parameters
    ----------
    time : ndarray (rows,)
        Equally spaced, s; at least three rows a period of a complex amplitude.
    amplitude : ndarray (rows,)
        Complex (`reference_modes.projection`), or real: an envelope such as sqrt(energy), which may
        ripple.
    ceiling : float or None
        Amplitude at saturation; None takes it from the data.
    until : float
        Rows after this time are not looked at: where another, faster motion saturates, s.
    """
    size = np.abs(amplitude)
    if not np.isfinite(size).all() or not size.any():
        return GrowthFit()
    log = np.log(np.maximum(size, 1e-12 * np.median(size[size > 0])))
    end_level = final_level(log)
    rows = int(np.searchsorted(time, until, side="right"))
    if rows < LEAST_ROWS:
        return GrowthFit(status="too_short")
    time, amplitude, log = time[:rows], amplitude[:rows], log[:rows]
    real = not np.iscomplexobj(amplitude)
    found = growth_window(Rising.of(log, real), ceiling, least_rows(amplitude))
    if isinstance(found, str):
        return GrowthFit(status=found)
    first, last = found
    fit = _fit(time[first:last], log[first:last], amplitude[first:last], end_level)
    return replace(fit, onset_time=float(np.maximum(fit.onset_time, time[0])))


def _fit(time: np.ndarray, log: np.ndarray, amplitude: np.ndarray, final: float) -> GrowthFit:
    """Rate, bounds, frequency and onset over the rows of the window."""
    real = not np.iscomplexobj(amplitude)
    step = (time[-1] - time[0]) / (len(time) - 1)
    rate, half, middle, level = slope_interval(log, step, real)
    begin, end = float(time[0]), float(time[-1])
    reach = (float(np.log(ONSET)) + final - level) / rate if rate > half else np.nan
    frequency = np.nan if real else abs(_phase_slope(time, amplitude)) / (2 * np.pi)
    return GrowthFit(
        rate,
        rate - half,
        rate + half,
        begin,
        end,
        begin + middle + reach,
        len(time),
        frequency,
        "ok",
    )


def _phase_slope(time: np.ndarray, amplitude: np.ndarray) -> float:
    """Mean angular velocity, rad/s."""
    phase, t = np.unwrap(np.angle(amplitude)), time - time.mean()
    return float(t @ (phase - phase.mean()) / (t @ t))
