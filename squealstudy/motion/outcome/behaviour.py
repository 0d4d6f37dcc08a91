"""Classifies a run by its motion: at rest, a limit cycle, growing, irregular, or open.

The pace is the rate of the logarithm of the level. In a decay to rest, which becomes linear, it
tends to a constant; towards a limit cycle to zero. A run that is too short to tell is undecided.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.motion.outcome.envelope import (
    BURST_PERIODS,
    WINDOW_COUNT_RANGE,
    LevelTrend,
    LevelWindows,
    last_part,
    level_trend,
    logarithm,
    windows,
)
from squealstudy.motion.outcome.levels import JUDGED_SHARE
from squealstudy.wording import (
    GROWING,
    IRREGULAR,
    LIMIT_CYCLE,
    STABLE,
    UNDECIDED,
)

# names with LN are of changes of the logarithm of the level
MAX_LN_TREND = 0.05  # a smaller rise of the RMS over the judged part counts as none
MAX_LN_DRIFT = 0.15  # a limit cycle with a smaller drift has not settled, but is not irregular
TREND_SIGMAS = 3.0  # standard errors that a trend must exceed
MAX_REL_SCATTER = 0.10  # scatter of the RMS of windows about their trend; more is irregular
REST_RATIO_FALLING = 1e-2  # a falling level is at rest if its RMS over the largest RMS is smaller
REST_RATIO = 1e-5  # the same for any level: round-off of contact forces is below it
MIN_END_PACE_RATIO = 0.25  # a fall to rest ends with at least this share of its mean pace
LATE_SHARE = 0.2  # share of the record in which the latest plateau is sought
MIN_LN_FALL = 0.01  # least change over a stretch whose pace is used
LOWER_CYCLE_RATIO = 0.1  # largest level of a cycle below a steady fall, over the largest RMS
# largest relative change of pace, while the level falls by a factor e, of a steady fall
MAX_PACE_CHANGE_PER_EFOLD = 0.5
# least growth since the start after which a level counts as reached, where growth is predicted
MIN_LN_GROWTH_PREDICTED = float(np.log(2.0))
MIN_LN_GROWTH = 3.0  # the same without prediction: so much growth is no beat of coupled modes
# least fall since the start after which a level counts as reached: energy was lost faster before
LN_FALL_FROM_START = float(np.log(1.5))
LN_GROWTH_EXPECTED = 0.5  # a level that stays despite more predicted growth has saturated
MAX_LN_DRIFT_SATURATED = 0.02  # largest drift of such a level
MIN_LN_TRANSIENT = 2e-3  # least transient that shows how a level was reached
TRANSIENT_OVER_DRIFT = 5.0  # least ratio of such a transient to the drift that remains
LEAST_DAMPING = 2e-6  # decay with a smaller damping ratio looks like a limit cycle
# a smaller drift over the judged part counts as none where a motion is continued
MAX_LN_DRIFT_CONTINUED = 5e-3
# a smaller drift over a stretch counts as none where no period is known
MAX_LN_DRIFT_NO_PERIOD = 1e-4
MAX_PACE_RATIO = 0.5  # growth ends in a cycle if its pace falls below this share of the first pace
MAX_DRIFT_OVER_TRANSIENT = 1e-3  # drift over the transient before it that counts as none
MAX_LN_TO_PLATEAU = 0.05  # largest distance from a plateau that is approached
MIN_LATE_WINDOWS = 6  # least number of windows in the last fifth
MIN_BURST_WINDOWS = 6  # least number of windows of ten periods for irregular motion
DECAYING_SCATTER_RATIO = 0.7  # scatter dies away if it falls to this share in the second half
DURATION_FACTOR = 1.25  # least duration that is proposed, over the duration of the run


@dataclass(frozen=True)
class RunClass:
    """Class of a run.

    Attributes
    ----------
    name : str
        ``stable``, ``limit_cycle``, ``growing``, ``irregular`` or ``undecided``.
    until : float
        Estimated duration [s] that would decide an undecided run; infinite where no longer run from
        this start would. NaN for all other classes.
    """

    name: str
    until: float = np.nan


def classify(
    time: np.ndarray,
    energy: np.ndarray,
    initial: float = 0.0,
    noise: float = 0.0,
    *,
    growth: float = 0.0,
) -> RunClass:
    """Class of a finished run, from its motion.

    ``stable``: the level is gone (1e-5 of the largest, or `noise`), or is below 1 % of the largest
    and still falls, or falls so steadily that a limit cycle below it would have less than a tenth
    of the largest level, by the laws by which cycles are approached. ``limit_cycle``: the level was
    reached by a transient and drifts less than with the lightest damping (a plateau after growth:
    less than 15 %), or all but stops. ``growing``: it rises at a constant pace, or has grown and
    still rises. ``irregular``: levels of ten periods each scatter by more than 10 %, without a
    trend, and in the end no less than before. ``undecided``: none of these is certain yet.

    Parameters
    ----------
    time, energy : ndarray (rows,)
        Those of `envelope.windows`.
    initial : float
        Energy of the perturbation, J; zero for the continuation of a motion.
    noise : float
        Energy of round-off, J.
    growth : float
        Predicted rate of the level at the end by the modes that move there, 1/s; negative where all
        of them decay, zero where it is not known. If it is positive, a level of twice the initial
        one was reached by growth, otherwise only one of twenty times. A level that stays although
        growth would have raised it by half, or decay lowered it by much more than it drifts, is a
        cycle wherever it began. If growth would have raised it twentyfold, it counts as grown.
    """
    span = float(time[-1] - time[0]) if len(time) > 1 else 0.0
    if len(time) < WINDOW_COUNT_RANGE[0] or not np.isfinite(energy).all():
        return too_short(span, len(time))
    envelope = Envelope.of(windows(time, energy), initial, growth * JUDGED_SHARE * span)
    course = envelope.windows.course(JUDGED_SHARE)
    if envelope.gone(noise) and not _rises(course):
        return RunClass(STABLE)
    if _levels_off(envelope, course):
        return RunClass(LIMIT_CYCLE)
    if _irregular(envelope, course):
        return RunClass(IRREGULAR)
    if _grows(envelope, course):
        return RunClass(GROWING)
    if _falls(envelope, course):
        return RunClass(STABLE)
    return RunClass(UNDECIDED, max(DURATION_FACTOR, _times_longer(envelope, course)) * span)


def too_short(duration: float, rows: int) -> RunClass:
    """Outcome of a run whose record has too few rows to judge: undecided until it has enough."""
    return RunClass(
        UNDECIDED, DURATION_FACTOR * duration * WINDOW_COUNT_RANGE[0] / max(rows - 1, 1)
    )


@dataclass(frozen=True)
class Envelope:
    """Levels of a run, and what its beginning shows; changes are those of the logarithm.

    Attributes
    ----------
    windows : LevelWindows
    ratio : float
        Last level over the largest.
    continued : bool
        Whether an earlier motion goes on, without a perturbation.
    reached : bool
        Whether the level was reached by growth or by a loss that has ended, or continues a motion.
    growth : float
        Judged level over that of the start, or over an earlier one if that is smaller.
    transient : float
        Largest distance of earlier levels beyond the range of those judged; 0 where it is less than
        that range.
    predicted : float
        Predicted growth over the judged part; negative for predicted decay.
    """

    windows: LevelWindows
    ratio: float
    continued: bool
    reached: bool
    growth: float
    transient: float
    predicted: float

    @property
    def grew(self) -> bool:
        """Whether an instability, not a beat of stable modes, made the level."""
        return self.growth >= (MIN_LN_GROWTH_PREDICTED if self.predicted > 0 else MIN_LN_GROWTH)

    @property
    def saturated(self) -> bool:
        """Whether it grew, or would have grown twentyfold over the judged part as predicted."""
        return self.grew or self.predicted >= MIN_LN_GROWTH

    @staticmethod
    def of(windows: LevelWindows, initial: float, predicted: float) -> Envelope:
        """The envelope of levels, by the energy put in [J] and the predicted growth (logarithm)."""
        fine, level = logarithm(windows.fine), logarithm(windows.level)
        now = float(level[windows.judged :].mean())
        put = 0.5 * float(np.log(initial)) if initial > 0 else now
        early = fine[: len(fine) - len(last_part(fine, JUDGED_SHARE))]
        growth = now - min(put, float(early.min()))
        transient = max(_start_overshoot(level), _start_overshoot(fine))
        ratio = float(np.exp(level[-1] - level.max()))
        reached = (
            initial <= 0 or growth >= MIN_LN_GROWTH_PREDICTED or now <= put - LN_FALL_FROM_START
        )
        return Envelope(
            windows=windows,
            ratio=ratio,
            continued=initial <= 0,
            reached=reached,
            growth=growth,
            transient=transient,
            predicted=predicted,
        )

    def gone(self, noise: float) -> bool:
        """Whether the last level is round-off, of the largest or of the system."""
        level = self.windows.level
        return bool(level[-1] <= max(REST_RATIO * level.max(), np.sqrt(noise)))

    def scatter(self) -> tuple[float, float, int]:
        """Scatter of windows of ten periods in the judged part, its error, and their number."""
        judged = last_part(self.windows.burst, JUDGED_SHARE)
        scatter = level_trend(judged)[2]
        return scatter, scatter / float(np.sqrt(2 * (len(judged) - 2))), len(judged)

    def lasting_scatter(self) -> bool:
        """Whether the scatter of the level that was reached has no trend and does not fade."""
        burst = self.windows.burst
        judged = last_part(burst, JUDGED_SHARE)
        rise, error, _ = level_trend(judged)
        reached = int(np.argmax(burst >= 0.5 * judged.mean()))
        level = burst[min(reached, len(burst) - len(judged)) :]
        first, second = (level_trend(half)[2] for half in np.array_split(level, 2))
        return (
            abs(rise) <= max(MAX_LN_DRIFT, TREND_SIGMAS * error)
            and second >= DECAYING_SCATTER_RATIO * first
        )

    def lightest_fall(self, share: float) -> float:
        """Fall of the logarithm over a share of the record at `LEAST_DAMPING`; NaN if unknown."""
        return 2 * np.pi * LEAST_DAMPING * share * self.windows.periods


def _start_overshoot(y: np.ndarray) -> float:
    judged = last_part(y, JUDGED_SHARE)
    before = y[: len(y) - len(judged)]
    overshoot = max(float(before.max() - judged.max()), float(judged.min() - before.min()))
    return overshoot if overshoot >= float(np.ptp(judged)) else 0.0


def _rises(course: LevelTrend) -> bool:
    return course.rise > course.error and course.thirds[2] > 0


def _levels_off(envelope: Envelope, course: LevelTrend) -> bool:
    """Whether the level of the last 40 %, or of the last fifth after growth, will stay."""
    scatter, error, _ = envelope.scatter()
    if max(course.scatter, scatter + error) <= MAX_REL_SCATTER:
        drift = abs(course.rise) + course.error
        if _flat(envelope, course, JUDGED_SHARE) and _shows_approach(envelope, drift):
            return True
        if envelope.predicted >= LN_GROWTH_EXPECTED and max(
            drift, abs(course.begin), abs(course.end)
        ) <= (MAX_LN_DRIFT_SATURATED):
            return True
        if _vanishes(course) and _shows_approach(envelope, abs(course.thirds[2])):
            return True
    late = logarithm(last_part(envelope.windows.fine, LATE_SHARE))
    if not envelope.saturated or len(late) < MIN_LATE_WINDOWS:
        return False
    course = LevelTrend.of(late)
    burst = level_trend(last_part(envelope.windows.burst, LATE_SHARE))[2]
    even = max(course.scatter, burst) <= MAX_REL_SCATTER
    return even and _quiet(course) and course.error <= MAX_LN_TREND


def _shows_approach(envelope: Envelope, drift: float) -> bool:
    """Whether the start shows how the level was reached, or it stays though decay is predicted."""
    min_change = max(MIN_LN_TRANSIENT, TRANSIENT_OVER_DRIFT * drift)
    decays = -envelope.predicted >= min_change
    return envelope.reached or envelope.transient >= min_change or decays


def _quiet(course: LevelTrend) -> bool:
    """Whether the course shows no drift beyond chance."""
    return abs(course.rise) <= course.error and abs(course.end) <= course.end_error


def _flat(envelope: Envelope, course: LevelTrend, share: float) -> bool:
    """Whether the level drifts less than the lightest decay would, or after growth by chance."""
    drift, light = abs(course.rise) + course.error, envelope.lightest_fall(share)
    if np.isnan(light):
        light = MAX_LN_DRIFT_NO_PERIOD
    if envelope.continued:
        light = max(light, MAX_LN_DRIFT_CONTINUED)
    if envelope.saturated and _quiet(course) and abs(course.rise) <= MAX_LN_DRIFT:
        return True
    if drift <= min(MAX_LN_DRIFT, light if course.rise > 0 or _quiet(course) else 0.5 * light):
        return True
    if drift <= min(MAX_LN_DRIFT_NO_PERIOD, MAX_DRIFT_OVER_TRANSIENT * envelope.transient):
        return True
    slows = abs(course.end) <= MAX_PACE_RATIO * abs(course.begin)
    return envelope.grew and envelope.predicted > 0 and slows and drift <= MAX_LN_TREND


def _vanishes(course: LevelTrend) -> bool:
    """Whether the pace goes to zero exponentially, with little of the way left.

    Just beyond a fold, where there is no cycle, it slows down as 1/t^2 at first; at the top of a
    beat linearly. From third to third the first shrinks ever more slowly, the second ever faster.
    """
    first, second, third = course.thirds
    if not (first * second > 0 and second * third > 0):
        return False
    r1, r2 = second / first, third / second
    if not (0 < r2 < 1 and r1 < 1):
        return False
    to_plateau = abs(third) * r2 / (1 - r2)
    quick = max(r1, r2) < 0.6 and r2 <= r1 + 0.05 and third / first <= 0.35
    if quick and to_plateau <= MAX_LN_TO_PLATEAU and (r1 - r2 <= 0.12 or abs(third) <= 3e-3):
        return True
    return max(r1, r2) <= 0.75 and r2 <= r1 <= r2 + 0.12 and to_plateau <= 0.2 * MAX_LN_TO_PLATEAU


def _grows(envelope: Envelope, course: LevelTrend) -> bool:
    """Whether the level rises at a constant pace, or has grown and rises still."""
    if not _rises(course):
        return False
    slows = course.begin - course.end + course.bend_error
    if course.rise >= MIN_LN_FALL and slows <= 0.25 * course.rise:
        return True
    return envelope.grew and course.rise >= MAX_LN_TREND and course.thirds[2] >= 0.1 * course.rise


def _falls(envelope: Envelope, course: LevelTrend) -> bool:
    """Whether the level falls to rest."""
    mean = envelope.windows.course(1.0).rise * JUDGED_SHARE / 3  # of a third of the judged part
    if course.rise >= 0 or max(map(abs, course.thirds[1:])) <= -0.1 * mean:  # the fall has ended
        return False
    for share in (JUDGED_SHARE, 0.7, 1.0):
        stretch = envelope.windows.course(share)
        if stretch.rise <= -MIN_LN_FALL and _falls_steadily(stretch, envelope.ratio):
            return True
    level = logarithm(envelope.windows.level)
    pace = float(level[-1] - level[0]) / (len(level) - 1)
    mean_fall = pace * (len(level) - envelope.windows.judged)
    falls = course.rise < -course.error and course.end < MIN_END_PACE_RATIO * mean_fall
    return envelope.ratio <= REST_RATIO_FALLING and falls


def slowing(course: LevelTrend) -> float:
    """Upper bound of the relative loss of pace per e-fold of level in a fall."""
    loss = abs(course.begin) - abs(course.end) + course.bend_error
    return max(loss, 0.0) / course.rise**2


def _falls_steadily(course: LevelTrend, ratio: float) -> bool:
    """Whether a cycle that the fall approaches is below LOWER_CYCLE_RATIO of the largest level.

    The pace of an approach from above to a level c is s (1 - (c / a)^m) at the level a: its loss of
    pace per e-fold h gives (c / a)^m = h / (m + h). The larger of m = 1 and 2 is taken. A fall by
    dry friction gains pace, and may end suddenly: it must be deep.
    """
    h = slowing(course)
    below = max(h / (1 + h), float(np.sqrt(h / (2 + h))))
    gain = abs(course.end) - abs(course.begin) + course.bend_error
    middle = ratio * float(np.exp(0.5 * abs(course.rise)))  # level at which that loss is measured
    return below * middle <= LOWER_CYCLE_RATIO and (
        gain <= MAX_PACE_CHANGE_PER_EFOLD * course.rise**2 or ratio <= LOWER_CYCLE_RATIO
    )


def _irregular(envelope: Envelope, course: LevelTrend) -> bool:
    """Whether a run vibrates irregularly instead of settling to one level."""
    scatter, error, count = envelope.scatter()
    if (
        count < MIN_BURST_WINDOWS
        or scatter - 1.645 * error <= MAX_REL_SCATTER
        or not envelope.lasting_scatter()
    ):
        return False
    if max(envelope.growth, envelope.predicted) >= MIN_LN_GROWTH:
        return abs(course.rise) <= max(course.error, MAX_LN_DRIFT)
    return abs(course.rise) + course.error <= envelope.lightest_fall(JUDGED_SHARE)


def _times_longer(envelope: Envelope, course: LevelTrend) -> float:
    """The duration that would decide over that of the record; infinite where none would."""
    light = envelope.lightest_fall(JUDGED_SHARE)
    if course.rise < -course.error:
        return _fall_longer(envelope, course)
    if course.rise > course.error:
        return max(MIN_LN_FALL / course.rise, 2.0)
    if not _shows_approach(envelope, abs(course.rise) + course.error) and course.error <= light:
        return np.inf
    scatter, _, count = envelope.scatter()
    if scatter > MAX_REL_SCATTER and count < MIN_BURST_WINDOWS:
        periods = MIN_BURST_WINDOWS * BURST_PERIODS / JUDGED_SHARE  # of a record that holds them
        return float(np.fmax(MIN_BURST_WINDOWS / count, periods / envelope.windows.periods))
    return 2.0 if np.isnan(light) or envelope.grew else max(2.0, course.error / light)


def _fall_longer(envelope: Envelope, course: LevelTrend) -> float:
    """The duration, over that of the record, until a fall is deep or surely of constant pace."""
    pace = abs(min(course.rise, course.end)) / JUDGED_SHARE
    deep = 1 + float(np.log(max(envelope.ratio / LOWER_CYCLE_RATIO, 1.0))) / pace
    h = 2 * LOWER_CYCLE_RATIO**2  # `_falls_steadily` with m = 2, before the level has fallen
    until_sure = max(MIN_LN_FALL / abs(course.rise), float(np.sqrt(slowing(course) / h)))
    return DURATION_FACTOR * min(deep, until_sure)
