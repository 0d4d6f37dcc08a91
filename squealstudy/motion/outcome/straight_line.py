"""Straight lines through logarithms of amplitudes: where one fits, its slope and its bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

TOLERANCE = 0.01  # of the slope, by which the slopes of the halves may differ
CHANCE = 4.0  # standard errors that their difference may take
LEAST_SCATTER = 1e-3  # below this a longer stretch is the better one
FIT_BLOCKS = (48, 24, 12)  # block means of a line; fewer while neighbours are correlated
CORRELATED = 0.3
WORST = 0.2  # of the slope: what is bent more is no straight line at all


@dataclass(frozen=True)
class Straight:
    """Lines through stretches of a sequence.

    Attributes
    ----------
    slope : ndarray (m,)
        A step of the sequence.
    difference : ndarray (m,)
        Of the slopes of the two halves.
    deviation : ndarray (m,)
        Its standard error, from the scatter about the two lines.
    error : ndarray (m,)
        Standard error of the stretch's rise end to end, its scatter about one line taken as
        independent and not below `LEAST_SCATTER`.
    """

    slope: np.ndarray
    difference: np.ndarray
    deviation: np.ndarray
    error: np.ndarray

    def accepted(self) -> np.ndarray:
        """Whether the halves agree, within `TOLERANCE` or by chance."""
        bound = np.maximum(TOLERANCE * np.abs(self.slope), CHANCE * self.deviation)
        return np.asarray(np.abs(self.difference) <= bound)


def straightness(y: np.ndarray, first: np.ndarray, last: np.ndarray) -> Straight:
    """Compare the halves of the stretches [first, last) of y, each of six values or more."""
    sums = _Sums(y)
    middle = (first + last) // 2
    slope, rest, _ = sums.line(first, last)
    slope_a, rest_a, spread_a = sums.line(first, middle)
    slope_b, rest_b, spread_b = sums.line(middle, last)
    variance = np.maximum(rest_a + rest_b, 0.0) / (last - first - 4)
    deviation = np.sqrt(variance * (1 / spread_a + 1 / spread_b))
    scatter = np.maximum(rest, 0.0) / (last - first - 2) + LEAST_SCATTER**2
    error = np.sqrt(12 * scatter / (last - first))
    return Straight(slope, slope_b - slope_a, deviation, error)


class _Sums:
    """Running sums of a sequence, from which any stretch has its line at once."""

    def __init__(self, y: np.ndarray) -> None:
        x, y = np.arange(len(y)) - 0.5 * len(y), y - y.mean()
        parts = np.stack([np.ones_like(x), x, x * x, y, x * y, y * y])
        self.sums = np.concatenate([np.zeros((6, 1)), np.cumsum(parts, axis=1)], axis=1)

    def line(
        self, first: np.ndarray, last: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Slope, sum of squares about the line and spread of x of stretches [first, last)."""
        n, x, xx, y, xy, yy = self.sums[:, last] - self.sums[:, first]
        spread = xx - x * x / n
        slope = (xy - x * y / n) / spread
        return slope, yy - y * y / n - slope**2 * spread, spread


def best_from(y: np.ndarray, first: int, count: int) -> tuple[int, int] | None:
    """The stretch from `first`, of `count` values or more, that gives a rising slope best.

    None ends after the line first bends.
    """
    last = np.arange(first + count, len(y) + 1)
    starts = np.full_like(last, first)
    found = straightness(y, starts, last)
    good = found.accepted() & (found.slope > 0)
    return _best(found, np.logical_and.accumulate(good), starts, last)


def best_of_all(y: np.ndarray, count: int) -> tuple[int, int] | None:
    """The straight stretch of `count` values or more that gives a rising slope best."""
    first, last = np.triu_indices(len(y) + 1, count)
    found = straightness(y, first, last)
    return _best(found, found.accepted() & (found.slope > 0), first, last)


def _best(
    found: Straight, good: np.ndarray, first: np.ndarray, last: np.ndarray
) -> tuple[int, int] | None:
    """The good stretch of least relative error of slope; without one the least bent, or none."""
    if good.any():
        slope = np.where(good, found.slope, 1.0)
        error = np.where(good, found.error / (last - first) / slope, np.inf)
        best = int(np.argmin(error))
        return int(first[best]), int(last[best])
    bend = np.abs(found.difference) / np.maximum(found.slope, 1e-300)
    best = int(np.argmin(bend))
    return (int(first[best]), int(last[best])) if bend[best] <= WORST else None


def block_means(log: np.ndarray, width: int, real: bool) -> np.ndarray:
    """Means of the logarithm over blocks of rows; of a real envelope the logarithm of its RMS.

    A rippling envelope comes close to zero, where the mean of its logarithm would be ruled by
    the dips; noise on a complex amplitude leaves the mean of the logarithm unbiased instead.
    """
    cut = log[: len(log) // width * width].reshape(-1, width)
    if not real:
        return np.asarray(cut.mean(axis=1))
    peak = cut.max(axis=1)
    return np.asarray(peak + 0.5 * np.log(np.exp(2 * (cut - peak[:, None])).mean(axis=1)))


def slope_interval(log: np.ndarray, step: float, real: bool) -> tuple[float, float, float, float]:
    """Line through block means of a logarithm (rows,) whose rows are `step` seconds apart.

    Returns
    -------
    slope, half : float
        1/s, and half of its 95 % interval: HC3 variance, Student's t, widened by what correlation
        of neighbours twelve blocks still have.
    time, level : float
        Mean time from the first row [s] and mean of the blocks: a point of the line.
    """
    for count in FIT_BLOCKS:
        width = max(1, len(log) // count)
        y = block_means(log, width, real)
        x = step * width * (np.arange(len(y)) - 0.5 * (len(y) - 1))
        slope = float(x @ y / (x @ x))
        rest = y - y.mean() - slope * x
        size = float(rest @ rest)
        rho = float(rest[1:] @ rest[:-1]) / size + 2.0 / len(y) if size > 0 else 0.0
        if rho < CORRELATED:
            break
    leverage = 1.0 / len(y) + x**2 / (x @ x)
    error = float(np.sqrt(np.sum((x * rest / (1 - leverage)) ** 2))) / float(x @ x)
    rho = min(max(rho, 0.0), 0.9)
    half = float(special.stdtrit(len(y) - 2, 0.975)) * error * float(np.sqrt((1 + rho) / (1 - rho)))
    return slope, half, step * (0.5 * len(y) * width - 0.5), float(y.mean())
