"""The summary of a run: growth, level, energies and class of one design point in time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.behaviour import RunClass, too_short
from squealstudy.motion.outcome.energies import (
    ModalShares,
    energy_round_off,
    first_window,
    held_energies,
    mean_shares,
    modal_shares,
    mode_energies,
    moving_energy,
    transfer,
)
from squealstudy.motion.outcome.growth import GrowthFit
from squealstudy.motion.outcome.growth_rows import growth_columns, growth_rows, has_moved, mode_fits
from squealstudy.motion.outcome.level import OF_THE_WINDOW, Level, LevelParts, StepParts
from squealstudy.motion.outcome.levels import (
    TorqueLevels,
    TorqueSums,
    errors_by_rows,
    period_swings,
    swing_spread,
)
from squealstudy.motion.outcome.periods import (
    EXACT_PERIOD_RESIDUAL,
    Fundamental,
    judged_rows,
    judged_window,
    own_frequency,
)
from squealstudy.motion.outcome.settling import (
    MIN_AGREEMENT_HALF_WIDTH,
    SETTLED,
    level_to_come,
    longer_window,
    settled,
)
from squealstudy.motion.outcome.torque import find_levels, find_lines, levels_of
from squealstudy.motion.outcome.verdict import run_verdict
from squealstudy.wording import CHANGING, FAILED, GROWING, LIMIT_CYCLE, STABLE, SUSTAINED

LEAST_ROWS = 10  # fewest rows of a history that is summarised
PASSING = (STABLE, GROWING)  # classes of motion that does not last
MAX_DURATION_FACTOR = 100.0  # largest duration that is proposed, over the duration of the run
LEAST_PERIODS = 20.0  # of the fastest mode, in the least duration that is proposed
FREQUENCY_ERROR = 0.1  # with a larger relative error another step has another period


@dataclass(frozen=True)
class Summary:
    """Columns of a run in the points table, and its rows in the modes and growth tables."""

    point: Mapping[str, Any]
    modes: list[dict[str, Any]]
    growth: list[dict[str, Any]]


def summarise(
    run: Motion, by_step: Callable[[bool], StepParts] = lambda _: OF_THE_WINDOW
) -> Summary:
    """Levels, growth, class and shares of a run: the columns of its row.

    A failed run is summarised up to its failure, with the class ``failed``. For a record of fewer
    than ten rows there are only the class, the course of the integration and the forecast.

    Parameters
    ----------
    run : Motion
    by_step : callable
        Returns the errors of levels by the step; called with whether the motion lasts. By default
        bounds are those of the window alone.
    """
    if run.point.schedule is not None:
        return _changing(run)
    energy = moving_energy(run)
    verdict = _class(run, energy)
    if len(run.times) < LEAST_ROWS or (verdict.name == FAILED and not np.isfinite(energy).all()):
        return Summary(_course(run) | _forecast(run) | _class_columns(verdict, run), [], [])
    lasts = verdict.name in SUSTAINED
    levels, window = run_levels(
        run,
        by_step(lasts),
        passes=verdict.name in PASSING,
        approaches=verdict.name == LIMIT_CYCLE,
    )
    if energy.max() <= energy_round_off(run):
        levels |= dict.fromkeys(("frequency_hz", "frequency_error", "torque_line_hz"), np.nan)
    behaviour = _behaviour(run, energy, verdict, levels)
    fits = mode_fits(run)
    energies, total = energies_of_steps(run)
    shares = modal_shares(energies[window], total[window])
    point = {
        **_course(run),
        **_forecast(run),
        **growth_columns(run, fits),
        **levels,
        **behaviour,
        **_contact(run, window),
        **_leader(run, shares),
    }
    growth = growth_rows(run, fits, behaviour["class"], window)
    return Summary(point, _mode_rows(run, energies, total, shares), growth)


def look_ahead(runs: Iterable[Motion]) -> None:
    """Compute lines and levels for the summaries of a batch of runs, side by side."""
    steady = [
        run
        for run in runs
        if run.point.schedule is None and run.outcome == "ok" and len(run.times) >= LEAST_ROWS
    ]
    find_lines(steady)
    find_levels([(run, judged_rows(run)) for run in steady])


def _changing(run: Motion) -> Summary:
    """Summary of a run whose speed or pressure changes: its course, forecast and contact shares.

    The forecast is that of steady sliding at the design point's own speed. Shares of the contact
    are those over the whole run.
    """
    ok = run.outcome == "ok" and bool(np.isfinite(run.modal_energy).all())
    point = {**_course(run), **_forecast(run), "class": CHANGING if ok else FAILED}
    if not ok or len(run.times) < LEAST_ROWS:
        return Summary(point, [], [])
    unfitted = [GrowthFit(status=CHANGING)] * len(run.point.growing.lam)
    all_rows = slice(1, len(run.times))
    point |= _contact(run, all_rows) | {
        "growth_method": CHANGING,
        "bounds_reason": "speed or pressure change: levels are those of the windows",
    }
    return Summary(point, [], growth_rows(run, unfitted, CHANGING, all_rows))


def _course(run: Motion) -> dict[str, Any]:
    """Columns on the course of the integration."""
    return {
        "iterations_mean": run.mean_iterations,
        "iterations_max": run.max_iterations,
        "halvings": run.halvings,
        "newton_steps": run.newton_steps,
        "contraction": run.contraction,
        "energy_balance": run.energy.relative,
        "time_reached": run.time,
        "stop_reason": run.stop_reason,
    }


def _forecast(run: Motion) -> dict[str, Any]:
    """Columns of the forecast by the complex modes of the same system."""
    modes = run.point.growing
    lam = modes.lam[0] if len(modes.lam) else complex(np.nan, np.nan)
    return {
        "n_unstable": modes.n_unstable,
        "n_unstable_above": modes.n_above,
        "n_unstable_below": modes.n_below,
        "predicted_frequency_hz": float(abs(lam)) / (2 * np.pi),
        "predicted_growth_rate": float(lam.real),
        "torque_static": run.point.static_torque,
    }


def run_levels(
    run: Motion,
    by_step: StepParts = OF_THE_WINDOW,
    *,
    passes: bool = False,
    approaches: bool = False,
) -> tuple[dict[str, Any], slice]:
    """Torque columns of the last window, and that window.

    Levels of motion that `passes` describe this window only. So where the errors by the step were
    computed, bounds are by the step alone. Bounds of motion that `approaches` a limit reach it.
    """
    torque = run.history["torque"]
    window = judged_window(run)
    rows_judged = judged_rows(run)
    sums = TorqueSums.of(run.history, rows_judged)
    all_sums = TorqueSums.of_rows(torque[rows_judged]) if sums is None else sums
    levels = levels_of(run, rows_judged)
    rows = errors_by_rows(torque[rows_judged]) if sums is None else np.zeros(3)
    own_hz = own_frequency(run, window)
    width = _rows_of(run, own_hz.hz if np.isfinite(own_hz.hz) else levels.frequency_hz)
    half = np.maximum(_half_widths(levels), _before_the_stop(run, rows_judged, own_hz))
    if approaches:
        half[0] = max(half[0], level_to_come(run, rows_judged, half[0]))
    scatter = max(levels.peak_scatter, levels.peak_to_peak - _least_swing(all_sums, width))
    if passes and by_step.measured:
        half, scatter = np.zeros(2), 0.0
    sizes = np.array([by_step.rms * levels.rms, by_step.mean * levels.rms])
    swing = by_step.peak_to_peak * levels.peak_to_peak
    hz, error = told_frequency(own_hz.hz, own_hz.error + by_step.frequency)
    rms = Level.of(levels.rms, LevelParts(half[0], sizes[0], rows[0]), 0.0)
    mean = Level.of(levels.mean, LevelParts(half[1], sizes[1], rows[1]))
    peaks = Level.of(levels.peak_to_peak, LevelParts(scatter, swing, rows[2]), 0.0)
    return {
        "torque_mean": mean.value,
        "torque_mean_low": mean.low,
        "torque_mean_high": mean.high,
        "torque_rms": rms.value,
        "torque_rms_low": rms.low,
        "torque_rms_high": rms.high,
        "torque_rms_window": rms.parts.window,
        "torque_rms_step": rms.parts.step,
        "torque_rms_rows": rms.parts.rows,
        "torque_peak_to_peak": peaks.value,
        "torque_peak_to_peak_low": peaks.low,
        "torque_peak_to_peak_high": peaks.high,
        "swing_spread": swing_spread(all_sums, width),
        "bounds_reason": by_step.reason,
        "frequency_hz": hz,
        "frequency_error": error,
        "torque_line_hz": levels.frequency_hz,
        "dominant_level": levels.line,
        "harmonic_2_level": levels.harmonic_2,
        "harmonic_3_level": levels.harmonic_3,
    }, window


def _half_widths(levels: TorqueLevels) -> np.ndarray:
    """Half-widths (2,) of the 95 % bounds of RMS and mean by the length of a window."""
    widths = np.array([levels.rms_high - levels.rms_low, levels.mean_high - levels.mean_low])
    half: np.ndarray = 0.5 * widths
    return half


def _before_the_stop(run: Motion, rows: slice, own_hz: Fundamental) -> np.ndarray:
    """Half-widths (2,) of the bounds of a window, by rows up to twice as many.

    An irregular run ends early when bounds of its last window happen to be narrow. Those of a
    longer window were not chosen so. 0 for other runs.
    """
    if run.stop_reason != SETTLED or own_hz.left <= EXACT_PERIOD_RESIDUAL:
        return np.zeros(2)
    longer = longer_window(run, rows)
    more_rows = (longer.stop - longer.start) / (rows.stop - rows.start)
    half: np.ndarray = np.sqrt(more_rows) * _half_widths(levels_of(run, longer))
    return half


def told_frequency(hz: float, error: float) -> tuple[float, float]:
    """Own frequency [Hz] and its relative error; NaN where another step gives another period.

    A motion that nearly repeats after one burst, and fully after two, may have either period.
    """
    return (np.nan, np.nan) if error > FREQUENCY_ERROR else (hz, error)


def _least_swing(sums: TorqueSums, width: float) -> float:
    """Least peak to peak of a single period; that of the window if there are too few periods."""
    swings = period_swings(sums, width)
    return float(swings.min() if len(swings) else sums.most.max() - sums.least.min())


def _rows_of(run: Motion, hz: float) -> float:
    """Rows in a period of a frequency [Hz]; NaN if that is NaN."""
    return 1.0 / (hz * float(run.times[-1] - run.times[0]) / max(len(run.times) - 1, 1))


def _class(run: Motion, energy: np.ndarray) -> RunClass:
    """Class of a run, failed ones included."""
    if run.outcome != "ok" or not np.isfinite(run.modal_energy).all():
        return RunClass(FAILED)
    if len(run.times) < LEAST_ROWS:
        return too_short(run.time, len(run.times))
    return run_verdict(run, energy)


def _class_columns(verdict: RunClass, run: Motion) -> dict[str, Any]:
    """Class, and the duration that would decide it; infinite if beyond `MAX_DURATION_FACTOR`.

    How a level changes within a period does not tell how it goes on: at least `LEAST_PERIODS` of
    the first complex mode are proposed.
    """
    lam, until = run.point.growing.lam, verdict.until
    omega = float(abs(lam[0])) if len(lam) else 0.0
    least = LEAST_PERIODS * 2 * np.pi / omega if omega > 0.0 else 0.0
    if until < least:
        return {"class": verdict.name, "undecided_until": least}
    until = np.inf if until > MAX_DURATION_FACTOR * run.time else until
    return {"class": verdict.name, "undecided_until": until}


def _behaviour(
    run: Motion, energy: np.ndarray, verdict: RunClass, levels: Mapping[str, Any]
) -> dict[str, Any]:
    """Columns on the class, on whether the run has settled, and on which mode took over.

    Nothing has settled at a level that is not known to the width of the band in which levels agree.
    """
    torque = run.history["torque"]
    is_settled, since = settled(run.times, energy, torque, verdict.name)
    band = MIN_AGREEMENT_HALF_WIDTH * levels["torque_rms"]
    if verdict.name in SUSTAINED and levels["torque_rms_window"] > band:
        is_settled, since = False, np.nan
    first, last, when = transfer(run.times, run.sensed_v**2, run.sensed, held_energies(run))
    return {
        **_class_columns(verdict, run),
        "settled": is_settled,
        "settled_time": since,
        "transfer_from": first,
        "transfer_to": last,
        "transfer_time": when,
    }


def _contact(run: Motion, window: slice) -> dict[str, Any]:
    """Shares of the contact area that stick or are open, and the creep of sticking points.

    `stick_creep` is the largest sliding speed of a point that sticks, at any step of the last
    window, over that of its steady sliding, also where the imposed speed changes. Such a point
    creeps by the slope of friction: it sticks while its friction is below the bound, where it
    slides slower than bound / k_t. That is the regularisation speed, or more where its pressure
    exceeds the highest of steady sliding. NaN where nothing sticks.
    """
    stick, opened = (over_steps(run, f"{name}_mean", name, window) for name in ("stick", "open"))
    most, widest = (over_steps(run, f"{name}_max", name, window) for name in ("stick", "open"))
    creep = over_steps(run, "creep_max", "creep", window)
    sticks = most > 0
    return {
        "stick_creep": float(creep[sticks].max()) if sticks.any() and run.point.speed else np.nan,
        "stick_share": float(stick.mean()),
        "stick_share_max": float(most.max()),
        "open_share": float(opened.mean()),
        "open_share_max": float(widest.max()),
    }


def over_steps(run: Motion, summed: str, at_rows: str, window: slice) -> np.ndarray:
    """The rows of a window of the column that is summed over every step, if there is one.

    Else those of the column at the rows: integrators outside the kernels, and old histories, have
    no sums.
    """
    history = run.history.get(summed)
    if history is None or not np.isfinite(history[window]).all():
        history = run.history[at_rows]
    column: np.ndarray = history[window]
    return column


def _leader(run: Motion, shares: ModalShares) -> dict[str, Any]:
    """The mode with most energy over the last window."""
    if not shares.share.any() or not has_moved(run):
        return {"dominant_mode": 0, "dominant_share": np.nan, "energy_outside_share": np.nan}
    k = int(np.argmax(shares.share))
    return {
        "dominant_mode": int(run.sensed[k]),
        "dominant_share": float(shares.share[k]),
        "energy_outside_share": shares.outside,
    }


def energies_of_steps(run: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Energies of the sensed modes (rows, ns) and of all modes (rows,), J.

    Means over the time since the row before where the integrator sums them, else those at the rows.
    """
    total = run.history.get("modal_energy_mean")
    squares = run.squares[1:]
    if total is None or len(squares) != len(run.times) - 1 or not np.isfinite(total).all():
        return mode_energies(run.sensed_q, run.sensed_v, run.omega), run.modal_energy
    energies = 0.5 * (squares[:, 1] + run.omega**2 * squares[:, 0])
    first = mode_energies(run.sensed_q[:1], run.sensed_v[:1], run.omega)
    return np.concatenate([first, energies]), total


def _mode_rows(
    run: Motion, energies: np.ndarray, total: np.ndarray, shares: ModalShares
) -> list[dict[str, Any]]:
    """Rows of the real modes of a run, with their shares of the energy."""
    begin = first_window(len(run.times))
    first = mean_shares(energies[begin], total[begin])
    return [
        {
            "mode": int(mode),
            "frequency_hz": float(run.omega[k]) / (2 * np.pi),
            "energy_share": float(shares.share[k]),
            "energy_share_low": float(shares.low[k]),
            "energy_share_high": float(shares.high[k]),
            "energy_mean": float(shares.mean[k]),
            "first_share": float(first[k]),
        }
        for k, mode in enumerate(run.sensed)
    ]
