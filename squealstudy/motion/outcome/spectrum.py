"""One-sided spectra of signals, by Hann windows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

FLUCTUATION_ROUND_OFF = 1e-10  # fluctuation below this share of the largest value is round-off
LINE_PERIODS = 3.0  # of a line in the window; slower ones are drift
LINE_WIDTH = 0.015  # of its frequency, either side; what counts as one line
# of the level of a line in means between rows, what it may lack of that of its frequency: a line
# that folds has less, and by a tenth where it is told a tenth too low
MAX_MISSING_SHARE = 0.1


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
        """RMS of what lies around a frequency; 0 at NaN, NaN beyond the Nyquist frequency."""
        if not np.isfinite(frequency):
            return 0.0
        if frequency >= (len(self.power) - 1) * self.resolution:
            return np.nan
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
    if np.abs(rest).max() <= FLUCTUATION_ROUND_OFF * np.abs(signal).max():
        return Spectrum(np.zeros(rows // 2 + 1), 1.0 / (rows * step))
    window = hann(rows)
    power = 2 * np.abs(np.fft.rfft(window * rest)) ** 2 / (rows * float(window @ window))
    return Spectrum(power, 1.0 / (rows * step))


def folds(lines: Spectrum, frequency: float, step: float, means: np.ndarray) -> bool:
    """Whether a line of rows is one above their Nyquist frequency, folded onto a lower one.

    Means over the time between rows hold sinc(f step) of a line at f, which is less for every
    frequency that folds onto it.

    Parameters
    ----------
    lines : Spectrum
        Of rows (n,) that are `step` seconds apart.
    frequency : float
        Of the line, Hz.
    step : float
    means : ndarray (n,)
        Of the signal over the time since the row before.
    """
    if not np.isfinite(frequency):
        return False
    least = (1.0 - MAX_MISSING_SHARE) * float(np.sinc(frequency * step))
    return bool(spectrum(step, means).level(frequency) < least * lines.level(frequency))


def unfolded_line(step: float, signal: np.ndarray, means: np.ndarray | None) -> float:
    """Frequency of the highest line [Hz]; NaN where means, to the signal's end, show a fold."""
    lines = spectrum(step, signal)
    frequency = lines.peak()
    if means is not None and folds(lines, frequency, step, means[-len(signal) :]):
        return np.nan
    return frequency


@lru_cache(maxsize=16)
def hann(rows: int) -> np.ndarray:
    """Weights (rows,) that cut off no part of a period; read-only."""
    weight: np.ndarray = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(rows) + 0.5) / rows)
    weight.flags.writeable = False
    return weight
