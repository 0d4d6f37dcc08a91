"""Finds the straight stretch of a rising logarithm whose slope is known best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MAX_REL_SLOPE_DIFFERENCE = 0.01  # difference of the halves' slopes over the slope: accepted
SLOPE_SIGMAS = 4.0  # accepted difference of the slopes of both halves, in standard errors
LEAST_SCATTER = (
    1e-3  # scatter below which the longer stretch is better, not the one of less scatter
)
MAX_REL_CURVATURE = 0.2  # difference of the halves' slopes over the slope, if none is accepted


@dataclass(frozen=True)
class FittedLines:
    """Lines through stretches of a sequence.

    Attributes
    ----------
    slope : ndarray (m,)
        Slope of the line, per step of the sequence.
    difference : ndarray (m,)
        Slope of the second half less that of the first.
    deviation : ndarray (m,)
        Standard error of `difference`, from the scatter about the two lines.
    error : ndarray (m,)
        Standard error of the stretch's rise from end to end, if its scatter about one line, which
        is taken as `LEAST_SCATTER` at least, is independent.
    """

    slope: np.ndarray
    difference: np.ndarray
    deviation: np.ndarray
    error: np.ndarray

    def accepted(self) -> np.ndarray:
        """Whether the halves agree, within `MAX_REL_SLOPE_DIFFERENCE` or by chance."""
        bound = np.maximum(
            MAX_REL_SLOPE_DIFFERENCE * np.abs(self.slope), SLOPE_SIGMAS * self.deviation
        )
        return np.asarray(np.abs(self.difference) <= bound)


def straightness(y: np.ndarray, first: np.ndarray, last: np.ndarray) -> FittedLines:
    """Lines through the stretches [first, last) of y, of six values or more, and their halves."""
    sums = _Sums(y)
    middle = (first + last) // 2
    slope, residual, _ = sums.line(first, last)
    slope_a, rest_a, spread_a = sums.line(first, middle)
    slope_b, rest_b, spread_b = sums.line(middle, last)
    variance = np.maximum(rest_a + rest_b, 0.0) / (last - first - 4)
    deviation = np.sqrt(variance * (1 / spread_a + 1 / spread_b))
    scatter = np.maximum(residual, 0.0) / (last - first - 2) + LEAST_SCATTER**2
    error = np.sqrt(12 * scatter / (last - first))
    return FittedLines(slope=slope, difference=slope_b - slope_a, deviation=deviation, error=error)


class _Sums:
    """Running sums of a sequence, from which the line through any stretch follows at once."""

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


def best_stretch(y: np.ndarray, count: int, begin: int | None) -> tuple[int, int] | None:
    """The straight stretch [first, last) of `count` values or more that gives a rising slope best.

    It is the one of least relative error of the slope. If none is straight it is the least bent
    one, or None where that bends by more than `MAX_REL_CURVATURE`. With `begin` all stretches start
    there, and none ends after the line has first bent.
    """
    if begin is None:
        first, last = np.triu_indices(len(y) + 1, count)
    else:
        last = np.arange(begin + count, len(y) + 1)
        first = np.full(len(last), begin)
    fits = straightness(y, first, last)
    good = fits.accepted() & (fits.slope > 0)
    if begin is not None:
        good = np.logical_and.accumulate(good)
    if good.any():
        slope = np.where(good, fits.slope, 1.0)
        error = np.where(good, fits.error / (last - first) / slope, np.inf)
        best = int(np.argmin(error))
        return int(first[best]), int(last[best])
    bend = np.abs(fits.difference) / np.maximum(fits.slope, 1e-300)
    best = int(np.argmin(bend))
    return (int(first[best]), int(last[best])) if bend[best] <= MAX_REL_CURVATURE else None
