"""Frequency of a motion itself: of the shortest time after which all of it comes back.

The strongest line of a signal may be any harmonic of it, and of a torque often is the second: both
directions of sliding load it. A motion repeats where its displacements do.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.fft import next_fast_len

MAX_PERIODIC_RESIDUAL = 0.05  # RMS of what is left after a period, over that of the motion
EXACT_PERIOD_RESIDUAL = 0.01  # the same: no longer period is looked for where as little is left
# times what is left after a period: where a multiple of it is the period
MULTIPLE_RESIDUAL_RATIO = 0.25
TRIED_MULTIPLES = (2, 3, 4)  # that are tried
# of the way between rows: how far the next one is from where a period ends, at most
MAX_ROW_OFFSET_RATIO = 0.55
# times what is left after one period, after two: no return, but two motions
MAX_SECOND_RESIDUAL_RATIO = 1.5
INTERPOLATION_RESIDUAL = 1e-3  # of what is left, that cubics between rows make
# left half-way: a motion that never was as far from itself has no period
MIN_HALF_WAY_RESIDUAL = 0.7
MIN_PERIODS = 3  # periods in a record
MAX_TRIED_PERIODS = 400  # places at which a period is looked for
NEARLY_ALL = 1e-5  # of the variance may be in coordinates that are left out
# square of the way between rows over that along slopes: less turns back between
MIN_CHORD_OVER_SLOPE_SQUARED = 0.5
VARIANCE_ROUND_OFF = 1e-20  # of the square of the values: a variance that is round-off
NO_IMAGE = 1e-6  # imaginary part of a place, of the way between rows, that round-off makes

# coefficients of 1, s, s^2, s^3: rows as they were, with opposite sign, and the cubic Hermite
# polynomials of the values and slopes at both ends
CUBIC = np.array(
    [[-1, 0, 0, 0], [1, 0, -3, 2], [0, 0, 3, -2], [0, 1, -2, 1], [0, 0, -1, 1]], dtype=float
)
POWER = np.add.outer(np.arange(4), np.arange(4))  # of s in products of two cubics


class Fundamental(NamedTuple):
    """A motion's own frequency.

    Attributes
    ----------
    hz : float
        NaN where none is told.
    left : float
        RMS of what is left after a period, over that of the motion.
    error : float
        Relative, of `hz`: what is left after several periods may be a shift in time.
    """

    hz: float = np.nan
    left: float = np.nan
    error: float = np.nan


def fundamental(step: float, q: np.ndarray, v: np.ndarray, omega: np.ndarray) -> Fundamental:
    """Frequency of a motion that repeats within 5 %; NaN where it does not, or is not told.

    The first time after which displacements are as they were (the mean over the record, between
    rows by cubics of displacement and velocity), or a multiple of it after which a quarter of what
    was left is. A later time after which the motion is far nearer than before, but after twice that
    less so, is where two motions of unlike frequencies nearly meet, no period. At least three
    periods must be in the record.

    Parameters
    ----------
    step : float
        Between rows, s.
    q, v : ndarray (rows, m)
        Displacements and velocities of modal coordinates.
    omega : ndarray (m,)
        rad/s: coordinates count by the root of their elastic energy, rigid ones as slow ones.
    """
    if len(q) <= 2 * MIN_PERIODS:
        return Fundamental()
    return _Record.of(step, q, v, omega).frequency()


class _Record:
    """A record x (rows, m) with its changes along the slopes over a step, and what comes back."""

    def __init__(self, step: float, x: np.ndarray, slope: np.ndarray) -> None:
        self.step, self.x, self.slope = step, x, slope
        self.variance = float((x**2).sum())

    @classmethod
    def of(cls, step: float, q: np.ndarray, v: np.ndarray, omega: np.ndarray) -> _Record:
        weight = np.where(omega > 0.0, omega, omega[omega > 0.0].min(initial=1.0))
        x, slope = weight * (q - q.mean(axis=0)), step * weight * v
        share = (x**2).sum(axis=0)
        if not share.sum() > VARIANCE_ROUND_OFF * ((weight * q) ** 2).sum():
            return cls(step, x[:, :0], slope[:, :0])
        order = np.argsort(-share)
        count = 1 + int(np.argmax(np.cumsum(share[order]) >= (1.0 - NEARLY_ALL) * share.sum()))
        return cls(step, *(np.ascontiguousarray(a[:, order[:count]]) for a in (x, slope)))

    def frequency(self) -> Fundamental:
        if not self.variance > 0.0 or self._coarse():
            return Fundamental()
        for place, first in self._places():
            period, residual = self._best(place)
            if residual > MAX_PERIODIC_RESIDUAL or (not first and self._drifts(period, residual)):
                continue
            if residual > EXACT_PERIOD_RESIDUAL:
                period, residual = self._multiple(period, residual)
            refined, count, rest = self._refined(period, residual)
            error = (rest + INTERPOLATION_RESIDUAL) / (2 * np.pi * count)
            return Fundamental(1.0 / (self.step * refined), residual, error)
        return Fundamental()

    def _drifts(self, period: float, left: float) -> bool:
        return (
            self._best(round(2.0 * period))[1]
            > MAX_SECOND_RESIDUAL_RATIO * left + INTERPOLATION_RESIDUAL
        )

    def _coarse(self) -> bool:
        """Whether the motion turns back between rows."""
        return bool(
            (np.diff(self.x, axis=0) ** 2).sum()
            < MIN_CHORD_OVER_SLOPE_SQUARED * (self.slope[1:] ** 2).sum()
        )

    @property
    def _longest(self) -> int:
        return len(self.x) // MIN_PERIODS

    def _places(self) -> Iterator[tuple[int, bool]]:
        """Rows later near which a period may end, and whether it is the first near return.

        There rows are nearer to what they were than one sooner or later.
        """
        rows, longest = len(self.x), self._longest
        size = np.concatenate([[0.0], np.cumsum((self.x**2).sum(axis=1))])
        length = next_fast_len(rows + longest + 2, real=True)  # no longer delay is looked at
        spectrum = np.fft.rfft(self.x, length, axis=0)
        product = np.fft.irfft((np.abs(spectrum) ** 2).sum(axis=1), length)[: longest + 2]
        later = np.arange(longest + 2)
        parted = size[rows - later] + size[rows] - size[later] - 2.0 * product
        residual = np.sqrt(np.maximum(parted, 0.0) / (rows - later) / (self.variance / rows))
        if not (residual > MIN_HALF_WAY_RESIDUAL).any():
            return
        first = int(np.argmax(residual > MIN_HALF_WAY_RESIDUAL))
        inner = residual[first + 1 : -1]
        places = np.flatnonzero((inner <= residual[first:-2]) & (inner <= residual[first + 2 :]))
        row = MAX_ROW_OFFSET_RATIO * np.sqrt((self.slope**2).sum() / self.variance)
        for place in places[inner[places] < MAX_PERIODIC_RESIDUAL + row][
            :MAX_TRIED_PERIODS
        ].tolist():
            yield first + 1 + place, place == places[0]

    def _best(self, place: int) -> tuple[float, float]:
        """Rows within one of a place after which least is left, and how much."""
        candidates = [self._between(k) for k in (place - 1, place) if k > 0]
        return min(candidates, key=lambda pair: pair[1])

    def _between(self, k: int) -> tuple[float, float]:
        """The same from k to k + 1 rows later, by the cubic between both."""
        count = len(self.x) - k - 1
        now, ends = self.x[:count], slice(k, k + count)
        after = slice(k + 1, k + 1 + count)
        parts = (now, self.x[ends], self.x[after], self.slope[ends], self.slope[after])
        gram = np.zeros((len(parts), len(parts)))
        for i, a in enumerate(parts):
            for j in range(i + 1):
                gram[i, j] = gram[j, i] = np.vdot(a, parts[j])
        whole = self.variance * count / len(self.x)

        terms = CUBIC.T @ gram @ CUBIC  # of the powers of the way from k to k + 1
        square = np.bincount(POWER.ravel(), weights=terms.ravel())
        turning = np.roots((square[1:] * np.arange(1, len(square)))[::-1])
        inside = turning.real[np.abs(turning.imag) < NO_IMAGE]
        ways = np.concatenate([[0.0, 1.0], inside[(inside > 0.0) & (inside < 1.0)]])
        squared_residual = np.polynomial.polynomial.polyval(ways, square)
        least = int(np.argmin(squared_residual))
        return k + float(ways[least]), float(np.sqrt(max(squared_residual[least], 0.0) / whole))

    def _multiple(self, period: float, left: float) -> tuple[float, float]:
        """The period, or the multiple of it at which far less is left: a doubled one."""
        for n in TRIED_MULTIPLES:
            if n * period < self._longest:
                longer, rest = self._best(round(n * period))
                if rest < MULTIPLE_RESIDUAL_RATIO * left:
                    return longer, rest
        return period, left

    def _refined(self, period: float, left: float) -> tuple[float, int, float]:
        """The period from as many as still come back, twice as many each time; what is left."""
        count = 1
        while 2 * count * period < self._longest:
            longer, rest = self._best(round(2 * count * period))
            if rest > MAX_PERIODIC_RESIDUAL:
                break
            count, left = 2 * count, rest
            period = longer / count
        return period, count, left
