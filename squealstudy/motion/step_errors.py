"""Errors of the levels of a run by its step, from runs with another step.

Steps of models with few contact points are cut at the corners of their laws, and levels converge by
second order or nearly so. The whole run is repeated with half the step, where the difference is
three quarters of the error, and with twice the step, where it is three times the error; of that
half is taken. The larger one counts: either may be small by chance, in smooth runs too, as levels
of beats go up and down with the phase that a step shifts.

With many points some corner lies in every step and the order is between one and two. From the state
in which the run ended, 20 periods are run with its step and with twice that. The difference is then
at least the error of the step, at first order as well. Where the longer step fails half the step is
taken, where the difference is at least half the error. Each difference counts twice.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from squealstudy.motion.arrays import FEW_POINTS
from squealstudy.motion.integrator import KernelIntegrator
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.level import NOT_ASKED, OF_THE_WINDOW, StepParts
from squealstudy.motion.outcome.levels import TorqueSums, torque_levels
from squealstudy.motion.outcome.periods import judged_window, own_frequency
from squealstudy.motion.outcome.spectrum import hann
from squealstudy.motion.outcome.summary import over_steps
from squealstudy.motion.outcome.torque import find_plain_levels, plain_levels_of
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import ModalSystem

MEASURED_PERIODS = 20.0  # periods of the torque's line that are run again with many points
ROWS_PER_PERIOD = 16
LEVEL_SAFETY_FACTOR = 2.0  # error over the difference of levels
# factor on the change by twice the step that makes it comparable with that by half the step: the
# latter is a quarter of the former at second order, half of it at first order
SECOND_DIFFERENCE_RATIO = 0.5
# relative errors of RMS, mean, peak to peak and frequency where friction begins to stick: over cut
# sub-steps it settles by the trapezoidal rule, with an error that does not depend on the step
SETTLES = np.array([1e-4, 3e-4, 2e-3, 1e-5])
# ratio of the difference in the second half over that in the first, up to which the level comes to
# rest, and its limit over the difference in the second half, if it rises as 1 - exp(-t / tau)
RESTS = ((1.5, 1.15), (2.08, 1.31), (2.45, 1.91))
HALF, TWICE = 0.5, 2.0  # steps of repeated runs over the step of the run
# steps in a period of the motion or of its mode: with fewer levels do not converge
LEAST_STEPS_PER_PERIOD = 12.0
MAX_REL_STEP_PART = 0.5  # a level with a larger relative error counts as unknown

RunsAgain = dict[float, Motion]  # the same run with other steps, by the ratio of steps


def has_few_points(system: ModalSystem) -> bool:
    """Whether steps of a model are cut at corners, and a run of it may be made again."""
    return len(system.area) <= FEW_POINTS


def step_parts(
    system: ModalSystem,
    run: Motion,
    settings: MotionSettings,
    lasts: bool = True,
    again: RunsAgain | None = None,
) -> StepParts:
    """Errors of the levels of a run by its step.

    Parameters
    ----------
    system : ModalSystem
    run : Motion
        The run, with its start in its point.
    settings : MotionSettings
        Settings of the run, with rows saved.
    lasts : bool
        Whether its motion lasts. With many contact points no errors are computed of one that does
        not.
    again : mapping of float to Motion
        With few contact points, the run repeated (`runs_again`); made here by default.
    """
    if not isinstance(settings.integrator, KernelIntegrator):
        return StepParts.unknown(f"'{settings.integrator.name}' has no step that could be halved")
    if has_few_points(system):
        others = runs_again(system, [run], settings)[0] if again is None else again
        return _by_other_steps(run, others, lasts, settings.step)
    if not lasts:
        return NOT_ASKED
    return _from_the_end(system, run, settings)


def runs_again(
    system: ModalSystem, runs: Sequence[Motion], settings: MotionSettings
) -> list[RunsAgain]:
    """Each run repeated with half the step and, if rows allow, with twice the step."""
    by_step: dict[float, list[Motion]] = {}
    for factor in (HALF, TWICE):
        rows = settings.save_every / factor
        if rows % 1:  # rows would not be at the same times
            continue
        finer_settings = replace(
            settings,
            duration=runs[0].time,
            step=factor * settings.step,
            save_every=round(rows),
        )
        by_step[factor] = simulate(
            system, [run.point for run in runs], finer_settings, passing=True
        )
    made_again = [{factor: again[k] for factor, again in by_step.items()} for k in range(len(runs))]
    find_plain_levels(
        (other, rows)
        for run, others in zip(runs, made_again, strict=True)
        for other in others.values()
        if run.point.schedule is None and _is_whole(run, other)
        for rows in [_summed(judged_window(run))]
    )
    return made_again


def _is_whole(run: Motion, other: Motion) -> bool:
    """Whether the other run came to the end of the first."""
    return other.outcome == "ok" and len(other.times) == len(run.times)


def _by_other_steps(run: Motion, others: RunsAgain, lasts: bool, step: float) -> StepParts:
    """Errors from the same run with other steps [s], over the window of its levels.

    The larger change counts: one of them may be small by chance. With a step that is far too long
    both are.
    """
    window, half = judged_window(run), others.get(HALF)
    if half is not None and not _is_whole(run, half):
        return StepParts.unknown(f"with half the step: {half.message or 'no run'}")
    own, change = _levels(run, window), np.full(4, np.nan)
    lam = run.point.growing.lam[:1]
    hz = float(np.fmax(own[-1], np.abs(lam).max(initial=0.0) / (2 * np.pi)))
    if lasts and hz * step * LEAST_STEPS_PER_PERIOD > 1.0:
        steps = f"{1.0 / (hz * step):.2g} steps"
        return StepParts.unknown(f"a period at {hz:.4g} Hz has {steps}: a shorter one is needed")
    for factor, share in ((HALF, 1.0), (TWICE, SECOND_DIFFERENCE_RATIO)):
        if factor in others and _is_whole(run, others[factor]):
            change = np.fmax(change, share * np.abs(own - _levels(others[factor], window, own)))
    if not lasts and not (own[0] > 0 and np.isfinite(change[:3]).all()):
        return OF_THE_WINDOW  # the run is at rest
    return _parts(own, change, settling(run, window), MAX_REL_STEP_PART if lasts else np.inf)


def settling(run: Motion, window: slice) -> np.ndarray:
    """Relative errors `SETTLES` (4,) if steps are cut and contact sticks there, else zeros."""
    sticks = over_steps(run, "stick_max", "stick", window).max() > 0.0
    return SETTLES if run.cuts and sticks else 0.0 * SETTLES


def _levels(run: Motion, window: slice, like: np.ndarray | None = None) -> np.ndarray:
    """RMS, mean, peak to peak and own frequency (4,) of a window, computed once for equal rows.

    No frequency is computed where `like`, the levels with another step, has none.
    """
    rows_judged = _summed(window)
    key = "levels and frequency", rows_judged.start, rows_judged.stop
    if key not in run.windows:
        levels = plain_levels_of(run, rows_judged)
        has_none = like is not None and np.isnan(like[-1])
        hz = np.nan if has_none else own_frequency(run, rows_judged).hz
        run.windows[key] = np.append(levels, hz)
    levels_of_run: np.ndarray = run.windows[key]
    return levels_of_run


def _summed(window: slice) -> slice:
    """The rows of a window without that of the start, to which no step belongs."""
    return slice(max(window.start, 1), window.stop)


def _parts(
    level: np.ndarray,
    change: np.ndarray,
    more: np.ndarray | float = 0.0,
    most: float = MAX_REL_STEP_PART,
) -> StepParts:
    """Twice the changes (4,) over the levels, plus `more`; the last is NaN without a frequency."""
    rms, _, swing, hz = level
    if not (rms > 0 and swing > 0 and np.isfinite(change[:3]).all()):
        return StepParts.unknown("nothing vibrates at its end")
    change = LEVEL_SAFETY_FACTOR * change / np.array([rms, rms, swing, hz])
    if change[0] > most:
        return StepParts.unknown(
            f"another step changes the level by {50 * change[0]:.0f} %: a shorter one is needed"
        )
    return StepParts(*(change + more).tolist())


def _from_the_end(system: ModalSystem, run: Motion, settings: MotionSettings) -> StepParts:
    """Error from 20 periods that begin at the state in which the run ended."""
    torque = run.history["torque"]
    window = judged_window(run)
    frequency = torque_levels(run.times[window], torque[window]).frequency_hz
    if not np.isfinite(frequency):
        return StepParts.unknown("the torque has no line whose periods could be counted")
    save_every = 2 * max(1, round(1.0 / (2 * ROWS_PER_PERIOD * frequency * settings.step)))
    count = int(np.ceil(MEASURED_PERIODS / (frequency * settings.step * save_every)))
    point = replace(run.point, q0=run.q, v0=run.v, continued=True)
    length = count * save_every * settings.step

    def run_with(factor: float) -> Motion:
        end_settings = replace(
            settings,
            duration=length,
            step=factor * settings.step,
            save_every=round(save_every / factor),
            save_q=False,
        )
        return simulate(system, [point], end_settings)[0]

    reference_run = run_with(1.0)
    others = (run_with(factor) for factor in (2.0, 0.5))
    other = next((other_run for other_run in others if other_run.outcome == "ok"), None)
    if reference_run.outcome != "ok" or other is None:
        return StepParts.unknown("no run with another step came to its end")
    halves = (
        slice(1, len(reference_run.times) // 2),
        slice(len(reference_run.times) // 2, len(reference_run.times)),
    )
    sums = [
        [_weighted(other_run.history, half) for half in halves]
        for other_run in (reference_run, other)
    ]
    first, second = (np.abs(a - b) for a, b in zip(*sums, strict=True))
    hz, changed = (
        own_frequency(other_run, slice(1, len(other_run.times))).hz
        for other_run in (reference_run, other)
    )
    level, change = np.append(sums[0][1], hz), np.append(second, abs(changed - hz))
    return _parts(level, change * _total_difference_ratio(first[0], second[0], run.time / length))


def _weighted(history: Mapping[str, np.ndarray], rows: slice) -> np.ndarray:
    """RMS, mean and peak to peak (3,) of rows, Hann-weighted since they are no whole periods."""
    sums = TorqueSums.of(history, rows)
    torque = history["torque"][rows]
    if sums is None:
        sums = TorqueSums.of_rows(torque)
    weight = hann(len(torque))
    mean = float(weight @ sums.mean / weight.sum())
    square = float(weight @ sums.squares(mean) / weight.sum())
    return np.array([np.sqrt(square), mean, sums.most.max() - sums.least.min()])


def _total_difference_ratio(first: float, second: float, ratio: float) -> float:
    """Ratio of the final difference of two levels to that in the second half of 20 periods.

    `first` and `second` are the differences in the two halves; the run is `ratio` times as long. A
    level that answers slowly to another step has gone only part of its way in 20 periods. If it
    does not come to rest there, it has moved on at the same speed for the length of the run at
    most: the mean of the second half of a straight line is three quarters of its end.
    """
    for most, beyond in RESTS:
        if second <= most * first:
            return beyond
    return max(RESTS[-1][1], ratio / 0.75)
