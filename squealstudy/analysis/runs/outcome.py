"""Whether the outcome of a run is known before its end: settled into a limit cycle, or decayed.

A limit cycle is known where its class, its level and the quiet of all other predicted
instabilities are: a second one may rise for long behind the first, and change the level in the end.
"""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.runs.behaviour import NOISE, settled
from squealstudy.analysis.runs.growth import fit_growth
from squealstudy.analysis.runs.levels import LEAST_PERIODS
from squealstudy.analysis.runs.summary import ModalRun, moving_energy, run_class, run_levels

SETTLED, DECAYED = "settled", "decayed"
LEAST_ROWS = 200  # of a record that is judged
PARTS = 3  # windows in the last one whose levels must agree
LINES = 4  # stretches of it in which the line of a mode is measured
WIDTH = 0.1  # of its frequency either side: limit cycles are a few per cent off the complex mode
GONE = 1e-6  # of the first energy
FALLEN = 0.25  # of the first energy, for a decay that agrees with the prediction
AGREES = 0.05  # of the predicted rate


def known_outcome(run: ModalRun, duration: float, tolerance: float) -> str:
    """``settled``, ``decayed``, or empty where the run must go on.

    Settled: a limit cycle by the tests of the whole record (`behaviour`), the torque's RMS over the
    last window known within `tolerance`, equal within `tolerance` over its thirds (the mean torque
    too), and no followed complex mode whose energy would rise noticeably until `duration`.

    Decayed: no predicted instability, and the energy of the vibration is gone (1e-6 of the first)
    or a quarter of the first while the fitted decay agrees with the predicted one.

    A run with unstable modes that are not followed (above the band, or too many) goes on.

    Parameters
    ----------
    run : ModalRun
        As far as it has come.
    duration : float
        Its end otherwise, s.
    tolerance : float
        Relative, for levels.
    """
    modes = run.point.modes
    if modes.n_above or modes.n_unstable > len(modes.lam) or len(run.time) < LEAST_ROWS:
        return ""
    if run.result.outcome != "ok" or not np.isfinite(run.energy).all():
        return ""
    energy = moving_energy(run)
    if modes.n_unstable == 0 and has_decayed(run, energy):
        return DECAYED
    return SETTLED if _has_settled(run, energy, duration, tolerance) else ""


def has_decayed(run: ModalRun, energy: np.ndarray) -> bool:
    """Whether a stable point's vibration is gone, or goes as predicted.

    Parameters
    ----------
    run : ModalRun
    energy : ndarray (rows,)
        `summary.moving_energy`, J.
    """
    part = max(1, len(energy) // 25)
    first, last = float(energy[:part].mean()), float(energy[-part:].mean())
    if last <= max(GONE * first, NOISE):
        return True
    lam = run.point.modes.lam[0] if len(run.point.modes.lam) else complex(np.nan, np.nan)
    short = run.time[-1] * abs(lam) / (2 * np.pi) < LEAST_PERIODS
    if short or last > FALLEN * first or run_class(run, energy, np.nan) != "stable":
        return False
    fit = fit_growth(run.time, run.xi(0))
    error = max(abs(fit.growth_rate - lam.real), 0.5 * (fit.high - fit.low))
    return fit.status == "ok" and error <= AGREES * abs(lam.real)


def _has_settled(run: ModalRun, energy: np.ndarray, duration: float, tolerance: float) -> bool:
    """The cheap tests first."""
    levels, window = run_levels(run)
    frequency, rms = levels["dominant_frequency_hz"], levels["torque_rms"]
    length = float(run.time[-1] - run.time[window][0])
    if not (rms > 0 and length * frequency >= LEAST_PERIODS):
        return False
    if 0.5 * (levels["torque_rms_high"] - levels["torque_rms_low"]) > tolerance * rms:
        return False
    if level_drift(run.result.history["torque"][window]) > tolerance:
        return False
    if not settled(run.time, energy, frequency)[0]:
        return False
    if run_class(run, energy, frequency) != "limit_cycle":
        return False
    return expected_rise(run, window, duration) <= 2 * tolerance  # energy is a level squared


def level_drift(torque: np.ndarray) -> float:
    """Largest difference of RMS and of mean between thirds of a window (rows,), relative.

    Hann-weighted, or thirds of a few periods each would differ by what they cut off.
    """
    rows = len(torque) // PARTS
    cut, weight = torque[len(torque) - PARTS * rows :].reshape(PARTS, rows), _hann(rows)
    mean = cut @ weight / weight.sum()
    rms = np.sqrt((cut - mean[:, None]) ** 2 @ weight / weight.sum())
    spread = [float(np.ptp(x) / max(abs(float(x.mean())), 1e-300)) for x in (mean, rms)]
    return max(spread)


def _hann(rows: int) -> np.ndarray:
    weight: np.ndarray = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(rows) + 0.5) / rows)
    return weight


def expected_rise(run: ModalRun, window: slice, duration: float) -> float:
    """Largest energy that a followed complex mode would gain until `duration`, over all energy.

    Each is seen through its left vector, around its own frequency: there the lines of a limit cycle
    of another mode are not. Its growth over the window, where that is beyond its standard error, is
    taken to go on.

    Parameters
    ----------
    run : ModalRun
    window : slice
        Rows that are judged, 16 or more.
    duration : float
        s.
    """
    time, modes = run.time[window], run.point.modes
    total = float(run.energy[window].mean())
    worst = 0.0
    for k, lam in enumerate(modes.lam):
        size = line_sizes(time, run.xi(k)[window], float(abs(lam)) / (2 * np.pi))
        rate, error = _growth(float(time[-1] - time[0]) / LINES, size)
        if rate <= error:
            continue
        share = float(run.point.mode_energy[k] * size[-1] ** 2) / total
        ahead = np.exp(min(2 * rate * max(duration - time[-1], 0.0), 700.0)) - 1
        worst = max(worst, share * float(ahead))
    return worst


def line_sizes(time: np.ndarray, amplitude: np.ndarray, frequency_hz: float) -> np.ndarray:
    """RMS of a complex amplitude (rows,) near a frequency, in successive stretches (LINES,).

    Hann-windowed, within `WIDTH` of the frequency on either side of zero.
    """
    step = float(time[-1] - time[0]) / (len(time) - 1)
    rows = len(time) // LINES
    cut = amplitude[len(amplitude) - LINES * rows :].reshape(LINES, rows)
    hann = _hann(rows)
    power = np.abs(np.fft.fft(hann * cut, axis=1)) ** 2 / (rows * float(hann @ hann))
    distance = np.abs(np.abs(np.fft.fftfreq(rows, step)) - frequency_hz)
    near = distance <= max(WIDTH * frequency_hz, 2.0 / (rows * step))
    sizes: np.ndarray = np.sqrt(power[:, near].sum(axis=1))
    return sizes


def _growth(width: float, size: np.ndarray) -> tuple[float, float]:
    """Rate of the logarithm of sizes `width` seconds apart, 1/s, and its standard error."""
    y = np.log(np.maximum(size, 1e-300))
    x = width * (np.arange(len(y)) - 0.5 * (len(y) - 1))
    rate = float(x @ y / (x @ x))
    rest = y - y.mean() - rate * x
    return rate, float(np.sqrt(rest @ rest / (len(y) - 2) / (x @ x)))
