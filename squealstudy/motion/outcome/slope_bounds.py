"""The slope of a line through a logarithm, and its bounds.

The bounds include noise and three other causes that bend a line: growth that depends on the
amplitude, remains of the start, and other modes that a projection does not remove.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import special

FIT_BLOCKS = (48, 24, 12)  # blocks of a line; fewer are used if neighbours are correlated
MAX_CORRELATION = 0.3  # largest correlation of neighbouring blocks that counts as none
CURVE_ROUND_OFF = 1e-10  # relative bent part of a curve up to which it is straight
# block means of a ratio of amplitudes over its largest value; less turns too fast to tilt a line
LEAST_SLOW_SHARE = 0.1
LEAST_REL_ERROR = 1e-7  # least relative error of a slope: chosen, above the round-off of runs


def block_means(log: np.ndarray, width: int, real: bool) -> np.ndarray:
    """Means of a logarithm over blocks of rows; if `real`, the logarithm of the amplitude's RMS.

    A real envelope that ripples comes close to zero, and the mean of its logarithm would depend on
    the dips. Noise on a complex amplitude does not bias the mean of the logarithm.
    """
    cut = in_blocks(log, width)
    if not real:
        return np.asarray(cut.mean(axis=1))
    peak = cut.max(axis=1)
    return np.asarray(peak + 0.5 * np.log(np.exp(2 * (cut - peak[:, None])).mean(axis=1)))


def in_blocks(values: np.ndarray, width: int) -> np.ndarray:
    """Whole blocks (m, width) of values (rows,)."""
    return values[: len(values) // width * width].reshape(-1, width)


def slope_interval(
    log: np.ndarray, step: float, real: bool, mixed: Sequence[np.ndarray] = ()
) -> tuple[float, float, float, float]:
    """Line through block means of a logarithm (rows,) whose rows are `step` seconds apart.

    Parameters
    ----------
    log : ndarray (rows,)
    step : float
        s.
    real : bool
        Whether it is that of a real envelope, not of a complex amplitude.
    mixed : sequence of ndarray (rows,) complex
        Amplitudes of other modes over this one's. Steps of finite length have other left vectors
        than the equations, along which a share of the other modes is therefore observed, too.

    Returns
    -------
    slope, half_width : float
        Slope and half-width of its 95 % interval, 1/s. The latter follows from the HC3 variance and
        Student's t, and is widened by the correlation that twelve blocks still have. It is at least
        the tilt of the line by other terms: one in the amplitude, as growth a (1 + b r) depends on
        it; one in its inverse, for motion that dies away or stays; and one in each of `mixed`.
    time, level : float
        Mean time from the first row [s] and mean of the blocks: a point of the line.
    """
    for count in FIT_BLOCKS:
        width = max(1, len(log) // count)
        y = block_means(log, width, real)
        x = step * width * (np.arange(len(y)) - 0.5 * (len(y) - 1))
        slope = float(x @ y / (x @ x))
        residual = y - y.mean() - slope * x
        sum_of_squares = float(residual @ residual)
        products = float(residual[1:] @ residual[:-1])
        rho = products / sum_of_squares + 2.0 / len(y) if sum_of_squares > 0 else 0.0
        if rho < MAX_CORRELATION:
            break
    leverage = 1.0 / len(y) + x**2 / (x @ x)
    error = float(np.sqrt(np.sum((x * residual / (1 - leverage)) ** 2))) / float(x @ x)
    rho = min(max(rho, 0.0), 0.9)
    correlation_factor = float(np.sqrt((1 + rho) / (1 - rho)))
    half_width = float(special.stdtrit(len(y) - 2, 0.975)) * error * correlation_factor
    log_growth = slope * x
    shapes = [np.exp(sign * log_growth - np.abs(log_growth).max())[:, None] for sign in (1, -1)]
    shapes += [curve for ratio in mixed if (curve := _slow_part(ratio, width)) is not None]
    tilts = [_tilt(x, residual, curve, correlation_factor) for curve in shapes]
    half_width = max(half_width, *tilts, LEAST_REL_ERROR * abs(slope))
    return slope, half_width, step * (0.5 * len(y) * width - 0.5), float(y.mean())


def _slow_part(ratio: np.ndarray, width: int) -> np.ndarray | None:
    """Real and imaginary block means (m, 2) of a complex ratio (rows,); None where they vanish."""
    size = np.abs(ratio).max()
    mean = in_blocks(ratio, width).mean(axis=1) / (size or 1.0)
    if not np.abs(mean).max() > LEAST_SLOW_SHARE:
        return None
    return np.column_stack([mean.real, mean.imag])


def _tilt(
    x: np.ndarray, residual: np.ndarray, curves: np.ndarray, correlation_factor: float
) -> float:
    """Tilt of a fitted line by other terms, with one standard error added [1/s].

    Parameters
    ----------
    x, residual : ndarray (m,)
        Times from the middle [s], and the logarithm less the line.
    curves : ndarray (m, p)
        The terms, fitted beside the line together.
    correlation_factor : float
        Factor on standard errors by correlation.
    """
    linear_part = (x @ curves) / (x @ x)
    bent = curves - curves.mean(axis=0) - x[:, None] * linear_part
    size = np.sqrt((bent**2).sum(axis=0))
    is_bent = size > CURVE_ROUND_OFF * np.sqrt((curves**2).sum(axis=0))
    if not is_bent.any():
        return 0.0
    bent, linear_part = bent[:, is_bent] / size[is_bent], linear_part[is_bent] / size[is_bent]
    inverse = np.linalg.pinv(bent.T @ bent)
    coefficients = inverse @ (bent.T @ residual)
    remainder = residual - bent @ coefficients
    variance = float(remainder @ remainder) / (len(x) - 2 - len(coefficients))
    error = float(np.sqrt(variance * max(linear_part @ inverse @ linear_part, 0.0)))
    return abs(float(linear_part @ coefficients)) + error * correlation_factor
