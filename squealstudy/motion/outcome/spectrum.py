"""One-sided spectra of signals with Hann windows; arrays hold several signals side by side."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

FLUCTUATION_ROUND_OFF = 1e-10  # fluctuation below this share of the largest value is round-off
LINE_PERIODS = 3.0  # fewest periods of a line in the window; slower ones are drift
LINE_WIDTH = 0.015  # half-width of a spectral line over its frequency
# share that a line's level in means between rows may lack of the expected one; a folded line lacks
# more
MAX_MISSING_SHARE = 0.1


@dataclass(frozen=True)
class Spectrum:
    """Hann-windowed transforms of signals without their linear trends.

    Attributes
    ----------
    power : ndarray (..., bins)
        Mean square of a signal in each bin.
    resolution : float
        Distance of bins, Hz.
    """

    power: np.ndarray
    resolution: float

    def peak(self) -> np.ndarray:
        """Frequency of the highest line (...) [Hz], interpolated between bins; NaN without one."""
        first, bins = int(LINE_PERIODS), self.power.shape[-1]
        if bins < first + 2:
            return np.full(self.power.shape[:-1], np.nan)[()]
        inner = self.power[..., first:-1]
        k = first + np.argmax(inner, axis=-1)
        neighbours = k[..., None] + np.array([-1, 0, 1])
        size = np.sqrt(np.take_along_axis(self.power, neighbours, axis=-1))
        before, at_line, after = size[..., 0], size[..., 1], size[..., 2]
        side = np.where(after >= before, 1, -1)
        is_line = at_line > 0.0
        ratio = np.maximum(before, after) / np.where(is_line, at_line, 1.0)
        shift = np.maximum(0.0, (2 * ratio - 1) / (ratio + 1))
        is_line &= ratio < 1.0  # if not it is the flank of slower drift
        lines: np.ndarray = np.where(is_line, (k + side * shift) * self.resolution, np.nan)[()]
        return lines

    def level(self, frequency: np.ndarray | float) -> np.ndarray:
        """RMS (...) of the line at a frequency; 0 at NaN, NaN beyond the Nyquist frequency."""
        bins, every = self.power.shape[-1], np.zeros(np.shape(frequency))
        spectra = self.power.reshape(-1, bins)
        for k, hz in enumerate(np.ravel(frequency).tolist()):
            if not math.isfinite(hz):
                continue
            line = hz / self.resolution
            half = max(3.0, LINE_WIDTH * line)
            first, last = max(1, round(line - half)), round(line + half) + 1
            size = math.sqrt(spectra[k, first:last].sum()) if line < bins - 1 else math.nan
            every.flat[k] = size
        return every[()]


def spectrum(step: float, signal: np.ndarray) -> Spectrum:
    """Power of the bins of signals (..., rows) sampled every `step` seconds."""
    rows = signal.shape[-1]
    x = np.arange(rows) - 0.5 * (rows - 1)
    fluctuation = signal - signal.mean(axis=-1, keepdims=True)
    # one sum for each signal: the round-off of a matrix product depends on the number of signals
    fluctuation = (
        fluctuation - x * ((fluctuation * x).sum(axis=-1) / max(float(x @ x), 1.0))[..., None]
    )
    window = hann(rows)
    scale = rows * float(window @ window)
    power = 2 * np.abs(np.fft.rfft(window * fluctuation, axis=-1)) ** 2 / scale
    is_flat = np.abs(fluctuation).max(axis=-1) <= FLUCTUATION_ROUND_OFF * np.abs(signal).max(
        axis=-1
    )
    if np.any(is_flat):
        power = np.where(is_flat[..., None], 0.0, power)
    return Spectrum(power, 1.0 / (rows * step))


def folds(
    lines: Spectrum, frequency: np.ndarray | float, step: float, means: np.ndarray
) -> np.ndarray:
    """Whether lines of signals are really above the Nyquist frequency, and folded onto lower ones.

    Means over the time between rows have sinc(f step) of the level of a line at f, and less of one
    that is folded onto f.

    Parameters
    ----------
    lines : Spectrum
        Spectrum of signals (..., n) with rows `step` seconds apart.
    frequency : ndarray (...)
        Frequency of the line of each signal, Hz.
    step : float
    means : ndarray (..., n)
        Means of the signals over the time since the row before.

    Returns
    -------
    ndarray (...) of bool
    """
    is_line = np.isfinite(frequency)
    if not np.any(is_line):
        return is_line
    min_share = (1.0 - MAX_MISSING_SHARE) * np.sinc(np.where(is_line, frequency, 0.0) * step)
    is_folded: np.ndarray = is_line & (
        spectrum(step, means).level(frequency) < min_share * lines.level(frequency)
    )
    return is_folded


def unfolded_line(step: float, signal: np.ndarray, means: np.ndarray | None) -> np.ndarray:
    """Frequency of the highest line (...) [Hz] of signals (..., rows); NaN where there is none.

    NaN also where it is a folded line, which the means (..., m) between rows show (`folds`). The
    means end with the signals.
    """
    lines = spectrum(step, signal)
    frequency = lines.peak()
    if means is None:
        return frequency
    is_folded = folds(lines, frequency, step, means[..., -signal.shape[-1] :])
    unfolded: np.ndarray = np.where(is_folded, np.nan, frequency)[()]
    return unfolded


@lru_cache(maxsize=16)
def hann(rows: int) -> np.ndarray:
    """Weights (rows,) of a Hann window; read-only."""
    weight: np.ndarray = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(rows) + 0.5) / rows)
    weight.flags.writeable = False
    return weight
