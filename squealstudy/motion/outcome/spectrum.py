"""One-sided spectra of signals, by Hann windows; of several signals side by side."""

from __future__ import annotations

import math
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
        """Frequency of the highest line (...) [Hz], between two bins of the Hann window."""
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
        is_line &= ratio < 1.0  # else the flank of slower drift
        lines: np.ndarray = np.where(is_line, (k + side * shift) * self.resolution, np.nan)[()]
        return lines

    def level(self, frequency: np.ndarray | float) -> np.ndarray:
        """RMS (...) of what lies around a frequency; 0 at NaN, NaN beyond the Nyquist frequency."""
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
    # sums of each signal by itself: a product of matrices rounds by how many there are
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
    """Whether lines of rows are above their Nyquist frequency, folded onto lower ones.

    Means over the time between rows hold sinc(f step) of a line at f, which is less for every
    frequency that folds onto it.

    Parameters
    ----------
    lines : Spectrum
        Of rows (..., n) that are `step` seconds apart.
    frequency : ndarray (...)
        Of the line of each, Hz.
    step : float
    means : ndarray (..., n)
        Of the signals over the time since the row before.

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

    Also where means (..., m), to the signals' end, show that it is a folded one.
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
    """Weights (rows,) that cut off no part of a period; read-only."""
    weight: np.ndarray = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(rows) + 0.5) / rows)
    weight.flags.writeable = False
    return weight
