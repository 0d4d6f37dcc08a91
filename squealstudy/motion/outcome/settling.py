"""Whether a run has reached its levels, from when on it has them, and whether it may end there.

The outcome of a run is known before its end where it has settled into a limit cycle or decayed. It
has settled where its class and its level are known, and no other predicted instability rises: a
second one may grow for long behind the first, and change the level in the end.
"""

from __future__ import annotations

import numpy as np

from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.behaviour import (
    MAX_LN_TREND,
    MAX_REL_SCATTER,
    REST_RATIO_FALLING,
    TREND_SIGMAS,
)
from squealstudy.motion.outcome.energies import energy_round_off, moving_energy
from squealstudy.motion.outcome.envelope import (
    WINDOW_COUNT_RANGE,
    LevelWindows,
    window_means,
    windows,
)
from squealstudy.motion.outcome.growth import fit_growth
from squealstudy.motion.outcome.levels import (
    JUDGED_SHARE,
    LEAST_PERIODS,
    TorqueLevels,
    judged_part,
    last_window,
    torque_levels,
)
from squealstudy.motion.outcome.periods import judged_window
from squealstudy.motion.outcome.spectrum import FLUCTUATION_ROUND_OFF, hann
from squealstudy.motion.outcome.torque import levels_of
from squealstudy.motion.outcome.verdict import expected_rise, run_verdict
from squealstudy.wording import STABLE, SUSTAINED

MIN_AGREEMENT_HALF_WIDTH = 0.05  # least half-width of the band within which levels agree
# largest ratio of the changes of a level from window to window: chosen on Hulten's oscillator
SLOWEST_HALF_RATIO = 0.7
MIN_HALF_WIDTH_OVER_CHANGE = 0.15  # a drift within a window makes its bounds this wide at least
SETTLED, DECAYED = "settled", "decayed"
ROW_LEVELS = "levels of rows"  # key of what is computed once for a run
LEAST_ROWS = 200  # fewest rows of a record that is judged
N_AGREEING_WINDOWS = 3  # parts of the last window whose levels must agree
VANISHED_ENERGY_RATIO = 1e-6  # the vibration is gone at a smaller share of its first energy
DECAYED_ENERGY_RATIO = 0.25  # the same where the decay agrees with the predicted one
MAX_REL_RATE_DIFFERENCE = 0.05  # difference of the fitted and the predicted rate of that decay


def settled(
    time: np.ndarray, energy: np.ndarray, torque: np.ndarray, name: str
) -> tuple[bool, float]:
    """Whether the levels of the last 40 % agree, and the earliest time from which all do.

    In a limit cycle or an irregular motion they agree where the RMS of the vibration and that of
    the torque neither trend (by 5 %, and three standard errors) nor scatter (by 10 % about the
    trend). In a stable run they agree where both are at rest: below 1 % of the largest. Other runs
    have not settled. Nor has a run of so few periods that the torque's levels are those of a longer
    part of the record (`levels.last_window`), if it was not settled from the start of that part.

    Parameters
    ----------
    time : ndarray (rows,)
        Times of the rows, equally spaced, s.
    energy : ndarray (rows,)
        Energy of the vibration, J.
    torque : ndarray (rows,)
        Torque, N m.
    name : str
        Class of the run.

    Returns
    -------
    settled : bool
    time : float
        Start of the first window, s, from which energy, mean and RMS of the torque in each stay
        near those judged and no peak exceeds theirs; NaN where the run has not settled.
    """
    if len(time) < WINDOW_COUNT_RANGE[0] or name not in (*SUSTAINED, STABLE):
        return False, np.nan
    mean = float(torque[-round(JUDGED_SHARE * len(torque)) :].mean())
    swing = torque - mean
    round_off = FLUCTUATION_ROUND_OFF * float(np.abs(torque).max())
    motion, force = windows(time, energy), windows(time, swing**2)
    moves = _start(motion, _away(motion, name, 0.0))
    quiet = float(force.level[force.judged :].max()) <= round_off
    differs = _away(force, STABLE if quiet else name, round_off)
    if differs is not None:
        differs = (
            differs | _shifted(torque, force, mean, round_off) | _exceeds(swing, force, round_off)
        )
    since = max(moves, _start(force, differs))  # infinite where either has not settled
    if not since <= time[last_window(time, torque)][0]:
        return False, np.nan
    return True, since


def _start(levels: LevelWindows, differs: np.ndarray | None) -> float:
    """Start of the first window after the last that `differs`, s; infinite where there is none."""
    if differs is None:
        return np.inf
    first = int(np.flatnonzero(differs)[-1]) + 1 if differs.any() else 0
    return float(levels.start[first]) if first <= levels.judged else np.inf


def _away(levels: LevelWindows, name: str, round_off: float) -> np.ndarray | None:
    """Mask of the levels that differ from those judged; None where the judged ones disagree.

    Levels below `round_off` are at rest.
    """
    level, judged = levels.level, levels.level[levels.judged :]
    if name == STABLE:
        rest_level = max(REST_RATIO_FALLING * float(level.max()), round_off)
        return level > rest_level if judged.max() <= rest_level else None
    rise, error, scatter = levels.trend()
    if scatter > MAX_REL_SCATTER or abs(rise) > max(MAX_LN_TREND, TREND_SIGMAS * error):
        return None
    return _outside(level, levels.judged, float(judged.mean()), 0.0)


def _outside(values: np.ndarray, judged: int, mean: float, round_off: float) -> np.ndarray:
    """Mask of values farther from the mean than the band, `round_off` and every judged value."""
    off = np.abs(values - mean)
    is_outside: np.ndarray = off > max(
        MIN_AGREEMENT_HALF_WIDTH * abs(mean), round_off, 1.01 * float(off[judged:].max())
    )
    return is_outside


def _shifted(torque: np.ndarray, levels: LevelWindows, mean: float, round_off: float) -> np.ndarray:
    """Mask of the windows whose mean torque differs from the judged mean."""
    return _outside(window_means(torque, len(levels.level)), levels.judged, mean, round_off)


def _exceeds(swing: np.ndarray, levels: LevelWindows, round_off: float) -> np.ndarray:
    """Mask of the windows in which the torque swings wider than in those judged."""
    count = len(levels.level)
    cut = np.abs(swing[len(swing) % count :]).reshape(count, -1)
    peak = cut.max(axis=1)
    top = float(peak[levels.judged :].max())
    wider: np.ndarray = peak > max(
        (1 + MIN_AGREEMENT_HALF_WIDTH) * top, REST_RATIO_FALLING * float(peak.max()), round_off
    )
    return wider


def known_outcome(run: Motion, duration: float, tolerance: float) -> str:
    """``settled``, ``decayed``, or empty where the run must go on, an undecided one included.

    A run has settled if it is a limit cycle or an irregular motion by the tests of the whole record
    (`behaviour`), if the torque's RMS over the last window is known within `tolerance` and equal
    within `tolerance` over its thirds (the mean torque too), and if no followed complex mode would
    gain much energy until `duration`.

    It has decayed if it is stable, no instability is predicted, and the energy of the vibration is
    gone (1e-6 of the first), or a quarter of the first while the fitted decay agrees with the
    predicted one.

    A run with unstable modes that are not followed (outside the band, or too many) goes on.

    Parameters
    ----------
    run : Motion
        The run so far.
    duration : float
        When it ends otherwise, s.
    tolerance : float
        Relative error and difference of levels that is accepted.
    """
    modes = run.point.growing
    if modes.n_outside or modes.n_unstable > len(modes.lam) or len(run.times) < LEAST_ROWS:
        return ""
    if run.outcome != "ok" or not np.isfinite(run.modal_energy).all():
        return ""
    if modes.n_unstable and not _level_stays(run, tolerance):
        return ""  # the tests below cost more
    energy = moving_energy(run)
    name = run_verdict(run, energy).name
    if name == STABLE:
        return DECAYED if modes.n_unstable == 0 and _has_decayed(run, energy) else ""
    if not (name in SUSTAINED and _level_stays(run, tolerance)):
        return ""
    if not settled(run.times, energy, run.history["torque"], name)[0]:
        return ""
    rise = expected_rise(run, judged_window(run), duration)
    return SETTLED if rise <= 2 * tolerance else ""  # energy is a level squared


def _has_decayed(run: Motion, energy: np.ndarray) -> bool:
    """Whether the vibration of a stable run is gone, or decays as predicted."""
    part = max(1, len(energy) // 25)
    first, last = float(energy[:part].mean()), float(energy[-part:].mean())
    if last <= max(VANISHED_ENERGY_RATIO * first, energy_round_off(run)):
        return True
    lam = run.point.growing.lam[0] if len(run.point.growing.lam) else complex(np.nan, np.nan)
    short = run.times[-1] * abs(lam) / (2 * np.pi) < LEAST_PERIODS
    if short or last > DECAYED_ENERGY_RATIO * first:
        return False
    fit = fit_growth(run.times, run.xi(0))
    error = max(abs(fit.growth_rate - lam.real), 0.5 * (fit.high - fit.low))
    return fit.status == "ok" and error <= MAX_REL_RATE_DIFFERENCE * abs(lam.real)


def _level_stays(run: Motion, tolerance: float) -> bool:
    """Whether the torque's level is known within `tolerance`, and equal over thirds."""
    window = judged_window(run)
    levels = levels_of_rows(run, window)
    length = float(run.times[-1] - run.times[window][0])
    if not (levels.rms > 0 and length * levels.frequency_hz >= LEAST_PERIODS):
        return False
    if 0.5 * (levels.rms_high - levels.rms_low) > tolerance * levels.rms:
        return False
    return level_drift(run.history["torque"][window]) <= tolerance


def levels_of_rows(run: Motion, window: slice) -> TorqueLevels:
    """`torque_levels` of the rows of a window, without sums over steps, computed once."""
    key = ROW_LEVELS, window.start, window.stop
    if key not in run.windows:
        run.windows[key] = torque_levels(run.times[window], run.history["torque"][window])
    levels: TorqueLevels = run.windows[key]
    return levels


def longer_window(run: Motion, window: slice) -> slice:
    """Rows up to twice as long as a window at the end of a run, without the way to its levels.

    They begin where the energy of the vibration first is as it is in the last 40 % at the earliest.
    """
    levels = windows(run.times, moving_energy(run))
    level, judged = levels.level, levels.level[levels.judged :]
    has_come = level >= judged.min() if level[0] < judged.min() else level <= judged.max()
    start = float(levels.start[int(np.argmax(has_come))])
    first = max(2 * window.start - window.stop, int(np.searchsorted(run.times, start)), 1)
    return slice(min(first, window.start), window.stop)


def level_to_come(run: Motion, window: slice, half: float) -> float:
    """Distance [N m] by which the torque's RMS over a window may still go on.

    Beats hide a slow drift within the window, but not between it and as many rows before it. That
    change may go on by `SLOWEST_HALF_RATIO` of itself from window to window. 0 where there are no
    such rows, for a window that leaves out the end of a transient, and where the change is over:
    then it is much larger than `half` [N m], the half-width of the window's own bounds.
    """
    longer, count = longer_window(run, window), window.stop - window.start
    is_shortened = window.start > judged_part(window.stop).start
    if is_shortened or window.start - longer.start < count // 2:
        return 0.0
    before = levels_of(run, slice(longer.start, window.start)).rms
    change = abs(levels_of(run, window).rms - before)
    if half < MIN_HALF_WIDTH_OVER_CHANGE * change:
        return 0.0
    return change * SLOWEST_HALF_RATIO / (1.0 - SLOWEST_HALF_RATIO)


def level_drift(torque: np.ndarray) -> float:
    """Largest relative difference of RMS and of mean between thirds of a window (rows,).

    They are Hann-weighted: thirds of a few periods would differ by the parts of periods at their
    ends.
    """
    rows = len(torque) // N_AGREEING_WINDOWS
    cut, weight = (
        torque[len(torque) - N_AGREEING_WINDOWS * rows :].reshape(N_AGREEING_WINDOWS, rows),
        hann(rows),
    )
    mean = cut @ weight / weight.sum()
    rms = np.sqrt((cut - mean[:, None]) ** 2 @ weight / weight.sum())
    spread = [float(np.ptp(x) / max(abs(float(x.mean())), 1e-300)) for x in (mean, rms)]
    return max(spread)
