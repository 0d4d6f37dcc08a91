"""Periods of a motion: its frequency, and whether it repeats after each.

The period is the shortest time after which all of the motion repeats. The strongest line of a
signal may be any harmonic of that frequency; that of a torque often is the second, since both
directions of sliding load it.

While all of the contact sticks the motion forgets its past. So if one period is like the one
before, all later ones will be, and linear growth at steady sliding does not apply to such a motion.
Motion that sticks for a part of the period at most repeats where it is a limit cycle, or where
small motion neither grows nor decays in the time that is judged.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.fft import next_fast_len

from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.levels import JUDGED_SHARE, window_of_line
from squealstudy.motion.outcome.torque import judged_line

# The residual of a time T compares the motion with itself a time T later: the RMS of the
# difference, over the RMS of the motion.
MAX_PERIODIC_RESIDUAL = 0.05  # largest residual of a period
EXACT_PERIOD_RESIDUAL = 0.01  # multiples of a time with a smaller residual are not tried as period
# a multiple of a time is the period if its residual is below this share of the residual of the time
MULTIPLE_RESIDUAL_RATIO = 0.25
TRIED_MULTIPLES = (2, 3, 4)
# largest distance of the end of a period from the nearest row, over the distance of two rows
MAX_ROW_OFFSET_RATIO = 0.55
# a time is no period if twice the time has a larger residual by this ratio: two motions only nearly
# meet there
MAX_SECOND_RESIDUAL_RATIO = 1.5
INTERPOLATION_RESIDUAL = 1e-3  # residual that interpolation by cubics between rows causes
# a periodic motion must have a larger residual at some time between two returns
MIN_HALF_WAY_RESIDUAL = 0.7
MIN_PERIODS = 3  # least number of periods in a record
MAX_TRIED_PERIODS = 400  # most times at which a period is sought
LEFT_OUT_VARIANCE_SHARE = 1e-5  # largest share of the variance in coordinates that are left out
# least ratio of the squared change between rows to that along the slopes: with less, the motion
# turns back between rows
MIN_CHORD_OVER_SLOPE_SQUARED = 0.5
# largest relative difference of a row from the cubic through its neighbours: with more, a motion
# may seem to repeat better after several periods, by where rows lie (a sine of 5.3 rows a period)
MAX_MISSED_BY_CUBICS = 0.08
VARIANCE_ROUND_OFF = 1e-20  # a variance below this share of the mean square is round-off
NO_IMAGE = 1e-6  # imaginary part of a root that is round-off

# coefficients of 1, s, s^2, s^3 in the difference of a cubic to the rows as they were: those rows
# with a negative sign, then the cubic Hermite polynomials of values and slopes at both ends
CUBIC = np.array(
    [[-1, 0, 0, 0], [1, 0, -3, 2], [0, 0, 3, -2], [0, 1, -2, 1], [0, 0, -1, 1]], dtype=float
)
POWER = np.add.outer(np.arange(4), np.arange(4))  # power of s in products of two cubics

# stick-slip
MIN_STICK_SHARE = 0.5  # least mean share of the area that sticks
ALL_STUCK_AREA_SHARE = 0.99  # least share of the area that sticks once in each period
N_EQUAL_PERIODS = 5  # fewest periods that must be alike
# least number of rows in a period; from fewer its level is not known to `MAX_REL_PERIOD_SPREAD`
MIN_ROWS_PER_PERIOD = 40
# largest relative range of the levels of successive periods; rows at their ends contribute to it
MAX_REL_PERIOD_SPREAD = 0.01
DURATION_FACTOR = 1.25  # factor on the duration that is proposed
# limits for motion that sticks for less
MIN_JUDGED_PERIODS = 8.0  # fewest periods in the window that is judged
# largest relative difference of the RMS velocity between the two halves of that window
MAX_HALVES_DIFFERENCE = 5e-3
# least mean stuck share of the area at which friction differs from that of small motions
MIN_MEAN_STICK_SHARE = 0.05
WOULD_CHANGE = 0.25  # least change of the logarithm that small motions would make


class Fundamental(NamedTuple):
    """A motion's own frequency.

    Attributes
    ----------
    hz : float
        Frequency, Hz; NaN where the motion has none.
    left : float
        Residual of the period: the RMS difference after a period over the RMS of the motion.
    error : float
        Relative error of `hz`: the residual after several periods may be a shift in time.
    """

    hz: float = np.nan
    left: float = np.nan
    error: float = np.nan


def fundamental(step: float, q: np.ndarray, v: np.ndarray, omega: np.ndarray) -> Fundamental:
    """Frequency of a motion that repeats within 5 %; NaN where it does not, or rows are too few.

    The period is the first time after which displacements are as they were, in the mean over the
    record; between rows displacements are interpolated by cubics with the velocities. It is a
    multiple of that time if that leaves less than a quarter of the residual. A later time with a
    small residual is no period if the residual after twice that time is larger: two motions of
    different frequencies nearly meet there. A time after such a one is the period if it leaves less
    than a quarter of it. The record must have three periods at least.

    Parameters
    ----------
    step : float
        Time between rows, s.
    q, v : ndarray (rows, m)
        Displacements and velocities of modal coordinates.
    omega : ndarray (m,)
        Their frequencies, rad/s. Coordinates are weighted by them, so that squares are elastic
        energies; rigid ones have the weight of the slowest.
    """
    if len(q) <= 2 * MIN_PERIODS:
        return Fundamental()
    return _Record.of(step, q, v, omega).frequency()


class _Record:
    """A record of weighted displacements x (rows, m), with slopes (rows, m) times the step."""

    def __init__(self, step: float, x: np.ndarray, slope: np.ndarray) -> None:
        self.step, self.x, self.slope = step, x, slope
        self.variance = float((x**2).sum())

    @classmethod
    def of(cls, step: float, q: np.ndarray, v: np.ndarray, omega: np.ndarray) -> _Record:
        """The record of those modes that make up nearly all of the motion."""
        weight = np.where(omega > 0.0, omega, omega[omega > 0.0].min(initial=1.0))
        x, slope = weight * (q - q.mean(axis=0)), step * weight * v
        share = (x**2).sum(axis=0)
        if not share.sum() > VARIANCE_ROUND_OFF * ((weight * q) ** 2).sum():
            return cls(step, x[:, :0], slope[:, :0])
        order = np.argsort(-share)
        count = 1 + int(
            np.argmax(np.cumsum(share[order]) >= (1.0 - LEFT_OUT_VARIANCE_SHARE) * share.sum())
        )
        return cls(step, *(np.ascontiguousarray(a[:, order[:count]]) for a in (x, slope)))

    def frequency(self) -> Fundamental:
        """The fundamental frequency of a periodic motion; empty where it has none."""
        if not self.variance > 0.0 or self._coarse():
            return Fundamental()
        nearest = np.inf  # least residual of the times before at which two motions nearly meet
        for minimum, first in self._places():
            period, residual = self._best(minimum)
            if residual > min(MAX_PERIODIC_RESIDUAL, MULTIPLE_RESIDUAL_RATIO * nearest):
                continue
            if not first and self._drifts(period, residual):
                nearest = min(nearest, residual)
                continue
            shortest = period
            if residual > EXACT_PERIOD_RESIDUAL:
                period, residual = self._multiple(period, residual)
            if not (first and period == shortest) and self._roughly_known():
                return Fundamental()
            refined, count, refined_residual = self._refined(period, residual)
            error = (refined_residual + INTERPOLATION_RESIDUAL) / (2 * np.pi * count)
            return Fundamental(1.0 / (self.step * refined), residual, error)
        return Fundamental()

    def _drifts(self, period: float, residual: float) -> bool:
        return (
            self._best(round(2.0 * period))[1]
            > MAX_SECOND_RESIDUAL_RATIO * residual + INTERPOLATION_RESIDUAL
        )

    def _coarse(self) -> bool:
        """Whether the motion turns back between rows."""
        return bool(
            (np.diff(self.x, axis=0) ** 2).sum()
            < MIN_CHORD_OVER_SLOPE_SQUARED * (self.slope[1:] ** 2).sum()
        )

    def _roughly_known(self) -> bool:
        """Whether rows are too far apart to know the motion between them."""
        x, slope = self.x, self.slope
        missed = 0.5 * (x[:-2] + x[2:]) + 0.25 * (slope[:-2] - slope[2:]) - x[1:-1]
        return bool((missed**2).sum() > MAX_MISSED_BY_CUBICS**2 * self.variance)

    @property
    def _longest(self) -> int:
        return len(self.x) // MIN_PERIODS

    def _places(self) -> Iterator[tuple[int, bool]]:
        """Delays in rows near which a period may end, and whether each is the first one.

        Residuals at these delays are less than one row sooner or later.
        """
        rows, longest = len(self.x), self._longest
        size = np.concatenate([[0.0], np.cumsum((self.x**2).sum(axis=1))])
        length = next_fast_len(rows + longest + 2, real=True)  # longer delays are not needed
        spectrum = np.fft.rfft(self.x, length, axis=0)
        product = np.fft.irfft((np.abs(spectrum) ** 2).sum(axis=1), length)[: longest + 2]
        later = np.arange(longest + 2)
        parted = size[rows - later] + size[rows] - size[later] - 2.0 * product
        residual = np.sqrt(np.maximum(parted, 0.0) / (rows - later) / (self.variance / rows))
        if not (residual > MIN_HALF_WAY_RESIDUAL).any():
            return
        first = int(np.argmax(residual > MIN_HALF_WAY_RESIDUAL))
        inner = residual[first + 1 : -1]
        minima = np.flatnonzero((inner <= residual[first:-2]) & (inner <= residual[first + 2 :]))
        row = MAX_ROW_OFFSET_RATIO * np.sqrt((self.slope**2).sum() / self.variance)
        for minimum in minima[inner[minima] < MAX_PERIODIC_RESIDUAL + row][
            :MAX_TRIED_PERIODS
        ].tolist():
            yield first + 1 + minimum, minimum == minima[0]

    def _best(self, minimum: int) -> tuple[float, float]:
        """The delay [rows] of least residual within one row of a minimum, and that residual."""
        candidates = [self._between(k) for k in (minimum - 1, minimum) if k > 0]
        return min(candidates, key=lambda pair: pair[1])

    def _between(self, k: int) -> tuple[float, float]:
        """Best period from k to k + 1 rows, by the cubic between them, and its residual."""
        count = len(self.x) - k - 1
        now, ends = self.x[:count], slice(k, k + count)
        after = slice(k + 1, k + 1 + count)
        parts = (now, self.x[ends], self.x[after], self.slope[ends], self.slope[after])
        gram = np.zeros((len(parts), len(parts)))
        for i, a in enumerate(parts):
            for j in range(i + 1):
                gram[i, j] = gram[j, i] = np.vdot(a, parts[j])
        expected = self.variance * count / len(self.x)

        terms = CUBIC.T @ gram @ CUBIC  # products of powers of s, the share of the way to k + 1
        square = np.bincount(POWER.ravel(), weights=terms.ravel())
        turning = np.roots((square[1:] * np.arange(1, len(square)))[::-1])
        inside = turning.real[np.abs(turning.imag) < NO_IMAGE]
        ways = np.concatenate([[0.0, 1.0], inside[(inside > 0.0) & (inside < 1.0)]])
        squared_residual = np.polynomial.polynomial.polyval(ways, square)
        best = int(np.argmin(squared_residual))
        return k + float(ways[best]), float(np.sqrt(max(squared_residual[best], 0.0) / expected))

    def _multiple(self, period: float, residual: float) -> tuple[float, float]:
        """The period, or a multiple of it whose residual is far less, as of a doubled period."""
        for n in TRIED_MULTIPLES:
            if n * period < self._longest:
                longer, longer_residual = self._best(round(n * period))
                if longer_residual < MULTIPLE_RESIDUAL_RATIO * residual:
                    return longer, longer_residual
        return period, residual

    def _refined(self, period: float, residual: float) -> tuple[float, int, float]:
        """The period from as many periods as still repeat, by doubling; number and residual."""
        count = 1
        while 2 * count * period < self._longest:
            longer, longer_residual = self._best(round(2 * count * period))
            if longer_residual > MAX_PERIODIC_RESIDUAL:
                break
            count, residual = 2 * count, longer_residual
            period = longer / count
        return period, count, residual


def judged_window(run: Motion) -> slice:
    """Rows of a run that are judged: `levels.last_window` of its torque, computed once.

    Where that window is longer than the last 40 %, and the motion repeats only in these, it is the
    last 40 %.
    """
    if "judged" not in run.windows:
        window = window_of_line(run.times, run.history["torque"], judged_line(run))
        longer = window.start < _last(run).start
        if longer and np.isnan(own_frequency(run, window).hz) and np.isfinite(_hz(run)):
            window = slice(_last(run).start, window.stop)  # the rest is of the start
        run.windows["judged"] = window
    judged: slice = run.windows["judged"]
    return judged


def judged_rows(run: Motion) -> slice:
    """The rows of `judged_window` without that of the start, whose sums have no steps."""
    window, last = judged_window(run), len(run.times) - 1
    return slice(max(window.start, min(1, last)), window.stop)


def own_frequency(run: Motion, window: slice) -> Fundamental:
    """Frequency of the sensed modes over a window of a run, computed once for equal rows."""
    rows = window.indices(len(run.times))
    if rows not in run.windows:
        time = run.times[window]
        step = float(time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else 0.0
        run.windows[rows] = fundamental(step, run.sensed_q[window], run.sensed_v[window], run.omega)
    frequency: Fundamental = run.windows[rows]
    return frequency


def sticks_mostly(run: Motion) -> bool:
    """Whether half of the contact sticks in the mean of the last 40 %, and all of it at a time."""
    stick = run.history["stick"][_last(run)]
    return bool(
        len(stick) and stick.mean() >= MIN_STICK_SHARE and stick.max() >= ALL_STUCK_AREA_SHARE
    )


def repeats_stick_slip(run: Motion) -> bool:
    """Whether the last 40 % of a run are stick-slip that repeats, five times or more."""
    last = _last(run)
    period = 1.0 / (_hz(run) * _step(run)) if sticks_mostly(run) else np.nan
    count = int(len(run.times[last]) / period) if period >= MIN_ROWS_PER_PERIOD else 0
    if count < N_EQUAL_PERIODS:
        return False
    ends = len(run.times) - np.round(period * np.arange(count, -1, -1)).astype(int)
    parts = [slice(a, b) for a, b in pairwise(ends.tolist())]
    if min(float(run.history["stick"][part].max()) for part in parts) < ALL_STUCK_AREA_SHARE:
        return False
    force = run.history["torque"]
    level = np.array([force[part].std() for part in parts])
    mean = np.array([force[part].mean() for part in parts])  # a peak would be that of one row
    return all(bool(np.ptp(x) <= MAX_REL_PERIOD_SPREAD * level.mean()) for x in (level, mean))


def decided_by(run: Motion) -> float:
    """The duration [s] after which stick-slip of a run would be known to repeat.

    Infinite where the run has enough periods, which then are not alike, or no frequency.
    """
    hz, end = _hz(run), float(run.times[-1])
    until = DURATION_FACTOR * (N_EQUAL_PERIODS + 1) / (JUDGED_SHARE * hz) if hz > 0 else np.inf
    return until if until > end else np.inf


def _last(run: Motion) -> slice:
    return slice(round((1 - JUDGED_SHARE) * len(run.times)), None)


def _step(run: Motion) -> float:
    return float(run.times[-1] - run.times[0]) / max(len(run.times) - 1, 1)


def _hz(run: Motion) -> float:
    return own_frequency(run, _last(run)).hz


def comes_back(run: Motion) -> bool:
    """Whether a run has come to a periodic motion that small motions would not explain.

    All modes that grow are followed; the sensed modes repeat after a period within 1 %, at least
    eight times, and with the same RMS velocity in both halves of these; and a part of the contact
    sticks for a while, or every followed complex mode would have changed the motion by a quarter.
    This has to hold in the window that is judged, or in its second half, as motion may still have
    grown in the first.
    """
    modes = run.point.growing
    finite = run.outcome == "ok" and np.isfinite(run.modal_energy).all()
    if not finite or modes.n_outside or modes.n_unstable > modes.n_followed:
        return False
    rows = len(run.times)
    judged = judged_window(run)
    late = slice(rows - (rows - judged.start) // 2, rows)
    return any(_is_periodic(run, window) for window in (judged, late))


def _is_periodic(run: Motion, window: slice) -> bool:
    """Whether a window of the run is periodic."""
    time, v = run.times[window], run.sensed_v[window]
    if len(time) < MIN_ROWS_PER_PERIOD:
        return False
    length, lam = float(time[-1] - time[0]), run.point.growing.lam
    pace = float(np.abs(np.real(lam)).min()) if len(lam) else 0.0
    stick = run.history["stick"][window]
    sticks = np.ptp(stick) > 0.0 and stick.mean() >= MIN_MEAN_STICK_SHARE
    if not (sticks or pace * length >= WOULD_CHANGE):
        return False
    step = length / (len(time) - 1)
    hz, residual, _ = own_frequency(run, window)
    if not (length * hz >= MIN_JUDGED_PERIODS and residual <= EXACT_PERIOD_RESIDUAL):
        return False
    half = round(np.floor(0.5 * length * hz) / (hz * step))  # rows of whole periods
    first, second = (float((x**2).sum()) for x in (v[-2 * half : -half], v[-half:]))
    return abs(np.sqrt(second / first) - 1.0) <= MAX_HALVES_DIFFERENCE
