"""The growth rate of an amplitude in a run, as the slope of its logarithm, with bounds.

`growth.fit_growth` needs the slope and its 95 % interval. The interval includes noise and three
causes that bend the logarithm: growth that depends on the amplitude, remains of the start, and
other modes that a projection does not remove.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import special

FIT_BLOCKS = (48, 24, 12)  # numbers of blocks that are averaged; fewer if neighbours correlate
MAX_CORRELATION = 0.3  # neighbouring blocks with less correlation count as independent
CURVE_ROUND_OFF = 1e-10  # a curve with a smaller relative part off a line counts as straight
# a ratio of amplitudes whose block means stay below this share of its largest value oscillates too
# fast to change a fitted slope
LEAST_SLOW_SHARE = 0.1
LEAST_REL_ERROR = 1e-7  # least relative half-width of an interval, chosen above round-off of runs


def block_means(log: np.ndarray, width: int, real: bool) -> np.ndarray:
    """Means of a logarithm over blocks of rows; of a real amplitude the logarithm of its RMS.

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
        Logarithm of the amplitude.
    step : float
        Time between rows, s.
    real : bool
        Whether the amplitude is a real envelope, not complex.
    mixed : sequence of ndarray (rows,) complex
        Ratios of the amplitudes of other modes to this one. A time step of finite length changes
        the left vectors of the equations. Projections on the unchanged ones therefore contain a
        share of the other modes.

    Returns
    -------
    slope, half_width : float
        Slope and half-width of its 95 % interval, 1/s. The latter follows from the HC3 variance and
        Student's t, and is widened where twelve blocks still correlate. It is at least the
        change of slope that further terms of a fit could cause: a term in the amplitude r, for
        growth a (1 + b r); a term in 1 / r, for motion that dies away or stays; and each of
        `mixed`.
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
    slope_changes = [_slope_change(x, residual, curve, correlation_factor) for curve in shapes]
    half_width = max(half_width, *slope_changes, LEAST_REL_ERROR * abs(slope))
    return slope, half_width, step * (0.5 * len(y) * width - 0.5), float(y.mean())


def _slow_part(ratio: np.ndarray, width: int) -> np.ndarray | None:
    """Block means (m, 2) of the real and imaginary part of a ratio; None for fast oscillation."""
    size = np.abs(ratio).max()
    mean = in_blocks(ratio, width).mean(axis=1) / (size or 1.0)
    if not np.abs(mean).max() > LEAST_SLOW_SHARE:
        return None
    return np.column_stack([mean.real, mean.imag])


def _slope_change(
    x: np.ndarray, residual: np.ndarray, curves: np.ndarray, correlation_factor: float
) -> float:
    """Change of a fitted slope [1/s] by further terms, with one standard error added.

    Parameters
    ----------
    x, residual : ndarray (m,)
        Times from the middle [s], and the logarithm minus the line.
    curves : ndarray (m, p)
        The further terms at these times, fitted together with the line.
    correlation_factor : float
        Factor on standard errors by correlation.
    """
    linear_part = (x @ curves) / (x @ x)
    bent = curves - curves.mean(axis=0) - x[:, None] * linear_part
    size = np.sqrt((bent**2).sum(axis=0))
    is_curved = size > CURVE_ROUND_OFF * np.sqrt((curves**2).sum(axis=0))
    if not is_curved.any():
        return 0.0
    bent, linear_part = (
        bent[:, is_curved] / size[is_curved],
        linear_part[is_curved] / size[is_curved],
    )
    inverse = np.linalg.pinv(bent.T @ bent)
    coefficients = inverse @ (bent.T @ residual)
    remainder = residual - bent @ coefficients
    variance = float(remainder @ remainder) / (len(x) - 2 - len(coefficients))
    error = float(np.sqrt(variance * max(linear_part @ inverse @ linear_part, 0.0)))
    return abs(float(linear_part @ coefficients)) + error * correlation_factor
