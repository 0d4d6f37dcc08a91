"""Class of a run: that of its motion, unless another instability may still change it."""

from __future__ import annotations

import numpy as np

from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.behaviour import (
    MAX_LN_DRIFT,
    TREND_SIGMAS,
    RunClass,
    classify,
)
from squealstudy.motion.outcome.energies import energy_round_off, level_shares
from squealstudy.motion.outcome.envelope import level_trend
from squealstudy.motion.outcome.levels import JUDGED_SHARE, block_mean_squares
from squealstudy.motion.outcome.periods import (
    comes_back,
    decided_by,
    judged_window,
    repeats_stick_slip,
    sticks_mostly,
)
from squealstudy.motion.outcome.spectrum import hann
from squealstudy.wording import IRREGULAR, LIMIT_CYCLE, STABLE, UNDECIDED

MIN_STEPS_PER_PERIOD = 2.0  # fewer show no motion of that period: no class is told
MIN_STEPS_OF_GROWTH = 12.0  # fewer may turn predicted growth into decay
NEARLY_ALL = 0.8  # a mode with this share of the energy is the whole motion but for harmonics
JUDGED_ROWS = 40  # fewest rows of a history whose modes are judged
MIN_ENERGY_SHARE = 0.05  # least energy share of a mode that is part of the motion
MAX_RISING_SHARE = 0.3  # a rising mode with more of the energy leads the motion (a choice)
ENERGY_SHARE_ROUND_OFF = 1e-10  # energy share that may be round-off of contact forces
RISE_LINES = 8  # stretches of a window by which a rise behind another motion is sought
RISE_PERIODS = 4.0  # fewest periods of the mode in each of them
GROWTH_SIGMAS = 5.0  # standard errors that such a rise must exceed, as many modes are tested
MIN_LN_GROWTH = 0.1  # least rise of ln amplitude over the window
MIN_GROWTH_HALF_RATIO = 0.6  # least rise in the second half over that in the first
NEUTRAL_RATIO = 1e-9  # a smaller damping ratio of the fastest mode is round-off
NEUTRAL_CHANGE = 0.3  # largest change of the energy from half to half of a run that stays as it is
SMALLEST_POSITIVE = 1e-300
MAX_FORECAST_DURATIONS = 1e3  # largest forecast time over the run's duration
N_TORQUE_BLOCKS = 10  # blocks of the judged part whose torque levels are compared
DRIFT_DURATION_FACTOR = 2.0  # duration that is proposed over the duration, if torque still drifts
N_LINE_STRETCHES = 4  # stretches of a window in which the line of a mode is measured
# half-width of a mode's line over its frequency: limit cycles are a few per cent off the mode
LINE_REL_HALF_WIDTH = 0.1


def run_verdict(run: Motion, energy: np.ndarray) -> RunClass:
    """Class of a run so far, from its `moving_energy`.

    A run that seems to decay is undecided until the motion shows that all modes with predicted
    growth decay too. It can show that only for modes that are followed (those outside the band are
    not, nor are too many), and only if something has moved. A limit cycle is undecided while a mode
    that is no part of it rises, or while the torque drifts to another level: one mode may feed
    another at the same energy. Stick-slip that repeats is a limit cycle, since linear growth does
    not apply to contact that sticks for most of a period. Other undecided motion that repeats is a
    limit cycle too. Steps that are too long for the period of the first complex mode decide
    nothing.
    """
    steps_per_period = _steps_per_period(run)
    if steps_per_period < MIN_STEPS_PER_PERIOD:
        return RunClass(UNDECIDED, np.inf)
    initial = 0.0 if run.point.continued else float(run.modal_energy[0])
    run_class = classify(
        run.times, energy, initial, energy_round_off(run), growth=_predicted_pace(run)
    )
    modes = run.point.growing
    judged = len(run.times) >= JUDGED_ROWS
    if run_class.name == IRREGULAR and judged and repeats_stick_slip(run):
        return RunClass(LIMIT_CYCLE)  # windows scattered since each had a part of a period
    if run_class.name == UNDECIDED and judged:
        if sticks_mostly(run):
            repeats = repeats_stick_slip(run) or comes_back(run)
            return RunClass(LIMIT_CYCLE) if repeats else RunClass(UNDECIDED, decided_by(run))
        run_class = RunClass(LIMIT_CYCLE) if comes_back(run) else run_class
    if run_class.name == UNDECIDED and _neutral(run, energy):
        return RunClass(UNDECIDED, np.inf)
    if run_class.name == LIMIT_CYCLE:
        until = rises_until(run)
        if not np.isfinite(until) and torque_drifts(run):
            until = DRIFT_DURATION_FACTOR * float(run.times[-1])
        return RunClass(UNDECIDED, until) if np.isfinite(until) else run_class
    if run_class.name != STABLE:
        return run_class
    unseen = modes.n_outside > 0 or modes.n_unstable > modes.n_followed
    unseen |= modes.n_unstable > 0 and steps_per_period < MIN_STEPS_OF_GROWTH
    if unseen or (modes.n_unstable and energy.max() <= energy_round_off(run)):
        return RunClass(UNDECIDED, np.inf)
    until = max((grows_until(run, k) for k in range(modes.n_followed)), default=0.0)
    return RunClass(UNDECIDED, until) if until > 0 else run_class


def _steps_per_period(run: Motion) -> float:
    """Steps in a period of the first complex mode; infinite where either is not known."""
    lam = run.point.growing.lam
    if not len(lam) or run.steps < len(run.times) - 1 or not abs(lam[0]) > 0.0:
        return np.inf
    return float(2 * np.pi / abs(lam[0]) * run.steps / run.time)


def _neutral(run: Motion, energy: np.ndarray) -> bool:
    """Whether small motions neither grow nor decay, and neither did that of the run."""
    lam = run.point.growing.lam
    if not len(lam) or abs(lam[0].real) > NEUTRAL_RATIO * abs(lam[0]):
        return False
    first, second = (float(half.mean()) for half in np.array_split(energy, 2))
    return abs(second - first) <= NEUTRAL_CHANGE * first


def torque_drifts(run: Motion) -> bool:
    """Whether the RMS of the torque has a trend over the judged rows, or their second half."""
    torque = run.history["torque"]
    judged = torque[judged_window(run)]
    if len(judged) < JUDGED_ROWS:
        return False
    squares = block_mean_squares(judged, N_TORQUE_BLOCKS)
    if not squares.min() > 0:
        return False
    levels = np.sqrt(squares)
    trends = (level_trend(part) for part in (levels, levels[N_TORQUE_BLOCKS // 2 :]))
    return any(abs(rise) > max(MAX_LN_DRIFT, TREND_SIGMAS * error) for rise, error, _ in trends)


def _predicted_pace(run: Motion) -> float:
    """Rate at which the level of the final motion would change by the complex modes alone, 1/s.

    With unstable modes it is the sum of the growth rates of the followed ones that are part of the
    motion, times their energy shares. Without it is the decay rate of the least damped mode, if
    that has nearly all energy; else 0.
    """
    rows, modes = len(run.times), run.point.growing
    if rows < JUDGED_ROWS or not len(modes.lam):
        return 0.0
    shares = level_shares(run, slice(round(0.6 * rows), None))
    rates = np.asarray(modes.lam).real
    if modes.n_unstable or modes.n_outside:
        unstable = np.arange(len(rates)) < modes.n_followed
        return float((shares * rates)[unstable & (shares >= MIN_ENERGY_SHARE)].sum())
    return min(float(rates[0]), 0.0) if shares[0] >= NEARLY_ALL else 0.0


def grows_until(run: Motion, k: int) -> float:
    """Time at which unstable mode `k` would have all the energy, s; 0 where the mode decays."""
    rows = len(run.times)
    if rows < JUDGED_ROWS:
        return np.inf
    share, rate, error = mode_course(run, k, slice(round(0.6 * rows), None))
    if share > 0 and rate < -error:
        return 0.0
    pace = rate if rate > error else float(run.point.growing.lam[k].real)
    if not (share > 0 and pace > 0):
        return np.inf
    return _foreseen(run, share, pace)


def rises_until(run: Motion) -> float:
    """Duration [s] of a run that is long enough to judge modes that rise behind the leading one.

    Such a mode may be followed and unstable, or only sensed, without predicted growth: a limit
    cycle may lose energy to modes whose frequencies add up to its own. The judged part of that run
    begins where the mode would have all the energy. Infinite where no mode rises, or too slowly.
    """
    rows = len(run.times)
    if rows < JUDGED_ROWS:
        return np.inf
    window = slice(round(0.6 * rows), None)
    energy = max(float(run.modal_energy[window].mean()), SMALLEST_POSITIVE)
    modes = run.point.growing
    until = np.inf
    for k in range(modes.n_followed):
        scale = float(run.point.growing.energy[k]) / energy
        until = min(until, _rises(run, window, run.xi(k), float(abs(modes.lam[k])), scale))
    for v, omega in zip(run.sensed_v.T, run.omega, strict=True):
        until = min(until, _rises(run, window, v, float(omega), 1 / energy))
    return until / (1 - JUDGED_SHARE)


def _rises(run: Motion, window: slice, amplitude: np.ndarray, omega: float, scale: float) -> float:
    """Time [s] at which an amplitude that rises at a constant pace would have all the energy.

    Infinite where it does not rise so; also where it has 30 % of the energy, as such a mode is the
    motion itself, which is judged by its level.
    """
    time, frequency = run.times[window], omega / (2 * np.pi)
    length = float(time[-1] - time[0])
    if frequency * length < RISE_LINES * RISE_PERIODS:  # so slow a line may be a drift
        return np.inf
    size = line_sizes(time, amplitude[window], frequency, RISE_LINES)
    share = scale * float(size[-1]) ** 2
    if not ENERGY_SHARE_ROUND_OFF < share < MAX_RISING_SHARE:
        return np.inf
    rate, error = _growth(length / RISE_LINES, size)
    if rate <= GROWTH_SIGMAS * error or rate * length < MIN_LN_GROWTH:
        return np.inf
    y = np.log(np.maximum(size, SMALLEST_POSITIVE))
    half = RISE_LINES // 2
    if y[-1] - y[half] < MIN_GROWTH_HALF_RATIO * (
        y[half - 1] - y[0]
    ):  # a forced line on its way to a level
        return np.inf
    return _foreseen(run, share, rate)


def _foreseen(run: Motion, share: float, rate: float) -> float:
    """Time [s] at which a share of the energy would have grown to all of it, or infinity.

    It is infinite beyond `MAX_FORECAST_DURATIONS`.
    """
    end = float(run.times[-1])
    until = end + max(0.0, -0.5 * float(np.log(share)) / rate)
    return until if until <= MAX_FORECAST_DURATIONS * end else np.inf


def mode_course(run: Motion, k: int, window: slice) -> tuple[float, float, float]:
    """Energy share and growth of the followed mode `k` over a window of 16 rows or more.

    It is observed through its left vector, near its own frequency: so the lines of another mode's
    limit cycle do not count.

    Returns
    -------
    share : float
        Energy of the mode in the last of four stretches over all energy of the window.
    rate, error : float
        Growth rate of its amplitude, 1/s, and the standard error.
    """
    time, lam = run.times[window], run.point.growing.lam[k]
    size = line_sizes(time, run.xi(k)[window], float(abs(lam)) / (2 * np.pi))
    rate, error = _growth(float(time[-1] - time[0]) / N_LINE_STRETCHES, size)
    energy = float(run.point.growing.energy[k] * size[-1] ** 2)
    return energy / max(float(run.modal_energy[window].mean()), SMALLEST_POSITIVE), rate, error


def expected_rise(run: Motion, window: slice, duration: float) -> float:
    """Largest energy that a followed complex mode would gain until `duration`, over all energy.

    Growth over the window that exceeds its standard error is taken to continue.

    Parameters
    ----------
    run : Motion
    window : slice
        Rows that are judged, 16 or more.
    duration : float
        End of the run, s.
    """
    worst = 0.0
    for k in range(len(run.point.growing.lam)):
        share, rate, error = mode_course(run, k, window)
        if rate > error:
            ahead = np.exp(min(2 * rate * max(duration - run.times[-1], 0.0), 700.0)) - 1
            worst = max(worst, share * float(ahead))
    return worst


def line_sizes(
    time: np.ndarray, amplitude: np.ndarray, frequency_hz: float, lines: int = N_LINE_STRETCHES
) -> np.ndarray:
    """RMS (lines,) of an amplitude (rows,) near a frequency, in successive stretches.

    Each stretch has a Hann window. All within `LINE_REL_HALF_WIDTH` of plus or minus the frequency
    counts.
    """
    step = float(time[-1] - time[0]) / (len(time) - 1)
    rows = len(time) // lines
    cut = amplitude[len(amplitude) - lines * rows :].reshape(lines, rows)
    weight = hann(rows)
    power = np.abs(np.fft.fft(weight * cut, axis=1)) ** 2 / (rows * float(weight @ weight))
    distance = np.abs(np.abs(np.fft.fftfreq(rows, step)) - frequency_hz)
    in_line = distance <= max(LINE_REL_HALF_WIDTH * frequency_hz, 2.0 / (rows * step))
    sizes: np.ndarray = np.sqrt(power[:, in_line].sum(axis=1))
    return sizes


def _growth(width: float, size: np.ndarray) -> tuple[float, float]:
    """Growth rate [1/s] of sizes that are `width` seconds apart, and its standard error."""
    y = np.log(np.maximum(size, SMALLEST_POSITIVE))
    x = width * (np.arange(len(y)) - 0.5 * (len(y) - 1))
    rate = float(x @ y / (x @ x))
    residual = y - y.mean() - rate * x
    return rate, float(np.sqrt(residual @ residual / (len(y) - 2) / (x @ x)))
