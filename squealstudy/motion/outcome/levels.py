"""Levels and lines of a torque history, with bounds from sub-windows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

LAST = 0.4  # of a record: the part that is judged
LEAST_PERIODS = 20.0  # of the dominant line in it, where the record has them
FLAT = 1e-10  # fluctuation below this share of the largest value is round-off
BLOCKS = (20, 10, 5)  # sub-windows of an interval; fewer while neighbours are correlated
CORRELATED = 0.1
LINE_PERIODS = 3.0  # of a line in the window; slower ones are drift
LINE_WIDTH = 0.015  # of its frequency, either side; what counts as one line
SAME = 1e-9  # relative: runs that agree so well are one run


@dataclass(frozen=True)
class TorqueLevels:
    """Levels over a window, in the unit of the signal.

    Attributes
    ----------
    mean, rms, peak_to_peak : float
        rms is that of the fluctuation about the mean.
    mean_low, mean_high, rms_low, rms_high : float
        95 % bounds of mean and rms.
    frequency_hz : float
        Of the dominant line; NaN where the signal is flat or the window has fewer than three
        periods of any line.
    line, harmonic_2, harmonic_3 : float
        RMS of the dominant line and at twice and three times its frequency, each within 1.5 %
        (three bins at least) of its frequency; 0 where there is none.
    """

    mean: float
    mean_low: float
    mean_high: float
    rms: float = 0.0
    rms_low: float = 0.0
    rms_high: float = 0.0
    peak_to_peak: float = 0.0
    frequency_hz: float = np.nan
    line: float = 0.0
    harmonic_2: float = 0.0
    harmonic_3: float = 0.0


def last_window(time: np.ndarray, signal: np.ndarray) -> slice:
    """Rows that are judged: the last 40 %, or 20 periods of its dominant line where that is longer.

    The whole record where it is shorter than that.

    Parameters
    ----------
    time, signal : ndarray (rows,)
        Equally spaced, s.
    """
    rows = len(time)
    count = max(1, round(LAST * rows))
    if rows > 1:
        step = (time[-1] - time[0]) / (rows - 1)
        frequency = spectrum(step, signal[rows - count :]).peak()
        if np.isfinite(frequency):
            count = max(count, int(np.ceil(LEAST_PERIODS / (frequency * step))))
    return slice(max(0, rows - count), rows)


def torque_levels(time: np.ndarray, torque: np.ndarray) -> TorqueLevels:
    """Levels of a window of a history.

    Parameters
    ----------
    time, torque : ndarray (rows,)
        The window only, equally spaced, s and N m; all finite, one row or more.
    """
    mean = float(torque.mean())
    fluctuation = torque - mean
    if np.abs(fluctuation).max() <= FLAT * np.abs(torque).max() or len(torque) < 2:
        return TorqueLevels(mean=mean, mean_low=mean, mean_high=mean)
    square, low, high = (np.sqrt(np.maximum(x, 0.0)) for x in mean_interval(fluctuation**2))
    found = spectrum((time[-1] - time[0]) / (len(time) - 1), torque)
    frequency = found.peak()
    _, mean_low, mean_high = mean_interval(torque)
    return TorqueLevels(
        mean=mean,
        mean_low=float(mean_low),
        mean_high=float(mean_high),
        rms=float(square),
        rms_low=float(low),
        rms_high=float(high),
        peak_to_peak=float(np.ptp(torque)),
        frequency_hz=frequency,
        line=found.level(frequency),
        harmonic_2=found.level(2 * frequency),
        harmonic_3=found.level(3 * frequency),
    )


@dataclass(frozen=True)
class Spectrum:
    """Hann-windowed transform of a signal without its linear trend.

    Attributes
    ----------
    power : ndarray (bins,)
        Mean square of the signal in each bin.
    resolution : float
        Distance of bins, Hz.
    """

    power: np.ndarray
    resolution: float

    def peak(self) -> float:
        """Frequency of the highest line [Hz], interpolated between two bins of the Hann window."""
        first = int(LINE_PERIODS)
        if len(self.power) < first + 2 or not self.power[first:-1].any():
            return np.nan
        k = first + int(np.argmax(self.power[first:-1]))
        size = np.sqrt(self.power[k - 1 : k + 2])
        side = 1 if size[2] >= size[0] else -1
        ratio = size[1 + side] / size[1]
        if ratio >= 1.0:  # the flank of slower drift, not a line
            return np.nan
        shift = max(0.0, (2 * ratio - 1) / (ratio + 1))
        return float((k + side * shift) * self.resolution)

    def level(self, frequency: float) -> float:
        """RMS of what lies around a frequency; 0 at NaN and beyond the Nyquist frequency."""
        if not np.isfinite(frequency):
            return 0.0
        at = frequency / self.resolution
        half = max(3.0, LINE_WIDTH * at)
        first, last = max(1, round(at - half)), round(at + half) + 1
        return float(np.sqrt(self.power[first:last].sum()))


def spectrum(step: float, signal: np.ndarray) -> Spectrum:
    """Power of the bins of a signal (rows,) sampled every `step` seconds."""
    rows = len(signal)
    x = np.arange(rows) - 0.5 * (rows - 1)
    rest = signal - signal.mean()
    rest = rest - x * (x @ rest) / max(float(x @ x), 1.0)
    if np.abs(rest).max() <= FLAT * np.abs(signal).max():
        return Spectrum(np.zeros(rows // 2 + 1), 1.0 / (rows * step))
    window = hann(rows)
    power = 2 * np.abs(np.fft.rfft(window * rest)) ** 2 / (rows * float(window @ window))
    return Spectrum(power, 1.0 / (rows * step))


def hann(rows: int) -> np.ndarray:
    """Weights (rows,) that cut off no part of a period."""
    weight: np.ndarray = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(rows) + 0.5) / rows)
    return weight


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
    half = np.zeros_like(mean)
    open_ = np.ones(np.shape(mean), dtype=bool)
    for count in BLOCKS:
        width = len(values) // count
        if width == 0:
            continue
        cut = values[len(values) - count * width :]
        blocks = np.add.reduceat(cut, np.arange(0, len(cut), width), axis=0) / width
        rest = blocks - blocks.mean(axis=0)
        size = (rest**2).sum(axis=0)
        product = (rest[1:] * rest[:-1]).sum(axis=0)
        rho = np.where(size > 0, product / np.where(size > 0, size, 1.0) + 1.0 / count, 0.0)
        rho_kept = np.clip(rho, 0.0, 0.9)
        error = np.sqrt(size / (count * (count - 1)) * (1 + rho_kept) / (1 - rho_kept))
        half = np.where(open_, special.stdtrit(count - 1, 0.975) * error, half)
        open_ = open_ & (rho > CORRELATED)
    return mean, mean - half, mean + half


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
