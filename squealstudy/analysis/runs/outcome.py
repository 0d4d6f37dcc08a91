"""Whether the outcome of a run is known before its end: settled into a limit cycle, or decayed.

A limit cycle is known where its class, its level and the quiet of all other predicted
instabilities are: a second one may rise for long behind the first, and change the level in the end.
"""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.runs.growth import fit_growth
from squealstudy.analysis.runs.levels import LEAST_PERIODS
from squealstudy.analysis.runs.modal_run import ModalRun, moving_energy, round_off
from squealstudy.analysis.runs.rising_modes import expected_rise, hann
from squealstudy.analysis.runs.settling import settled
from squealstudy.analysis.runs.summary import run_levels
from squealstudy.analysis.runs.verdict import run_verdict
from squealstudy.analysis.tables.run_classes import LEVELLED, STABLE

SETTLED, DECAYED = "settled", "decayed"
LEAST_ROWS = 200  # of a record that is judged
PARTS = 3  # windows in the last one whose levels must agree
GONE = 1e-6  # of the first energy
FALLEN = 0.25  # of the first energy, for a decay that agrees with the prediction
AGREES = 0.05  # of the predicted rate


def known_outcome(run: ModalRun, duration: float, tolerance: float) -> str:
    """``settled``, ``decayed``, or empty where the run must go on, an undecided one included.

    Settled: a limit cycle or an irregular motion by the tests of the whole record (`behaviour`),
    the torque's RMS over the last window known within `tolerance`, equal within `tolerance` over
    its thirds (the mean torque too), and no followed complex mode whose energy would rise
    noticeably until `duration`.

    Decayed: stable, no predicted instability, and the energy of the vibration is gone (1e-6 of the
    first) or a quarter of the first while the fitted decay agrees with the predicted one.

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
    name = run_verdict(run, energy).name
    if name == STABLE:
        return DECAYED if modes.n_unstable == 0 and _has_decayed(run, energy) else ""
    settles = name in LEVELLED and _has_settled(run, energy, name, duration, tolerance)
    return SETTLED if settles else ""


def _has_decayed(run: ModalRun, energy: np.ndarray) -> bool:
    """Whether the vibration of a stable run is gone, or goes as predicted."""
    part = max(1, len(energy) // 25)
    first, last = float(energy[:part].mean()), float(energy[-part:].mean())
    if last <= max(GONE * first, round_off(run)):
        return True
    lam = run.point.modes.lam[0] if len(run.point.modes.lam) else complex(np.nan, np.nan)
    short = run.time[-1] * abs(lam) / (2 * np.pi) < LEAST_PERIODS
    if short or last > FALLEN * first:
        return False
    fit = fit_growth(run.time, run.xi(0))
    error = max(abs(fit.growth_rate - lam.real), 0.5 * (fit.high - fit.low))
    return fit.status == "ok" and error <= AGREES * abs(lam.real)


def _has_settled(
    run: ModalRun, energy: np.ndarray, name: str, duration: float, tolerance: float
) -> bool:
    """The cheap tests first."""
    torque = run.result.history["torque"]
    levels, window = run_levels(run)
    frequency, rms = levels["dominant_frequency_hz"], levels["torque_rms"]
    length = float(run.time[-1] - run.time[window][0])
    if not (rms > 0 and length * frequency >= LEAST_PERIODS):
        return False
    if 0.5 * (levels["torque_rms_high"] - levels["torque_rms_low"]) > tolerance * rms:
        return False
    if level_drift(torque[window]) > tolerance:
        return False
    if not settled(run.time, energy, torque, name)[0]:
        return False
    return expected_rise(run, window, duration) <= 2 * tolerance  # energy is a level squared


def level_drift(torque: np.ndarray) -> float:
    """Largest difference of RMS and of mean between thirds of a window (rows,), relative.

    Hann-weighted, or thirds of a few periods each would differ by what they cut off.
    """
    rows = len(torque) // PARTS
    cut, weight = torque[len(torque) - PARTS * rows :].reshape(PARTS, rows), hann(rows)
    mean = cut @ weight / weight.sum()
    rms = np.sqrt((cut - mean[:, None]) ** 2 @ weight / weight.sum())
    spread = [float(np.ptp(x) / max(abs(float(x.mean())), 1e-300)) for x in (mean, rms)]
    return max(spread)
