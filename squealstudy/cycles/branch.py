"""Branches of cycles along a parameter, through folds, with their stability.

Events carry the names of bifurcation tools: H, the cycle shrinks to steady sliding (Hopf); F, the
parameter turns back (fold); NS, a pair of multipliers leaves the unit circle, or PD, one at -1;
BP, one passes 1 though the parameter does not turn back.

Where forces are linear up to a size, as those of a contact that has not lifted off yet, cycles of
all sizes lie at one value of the parameter. There neither the round-off of that value nor a
multiplier that stays 1 is an event. Two multipliers are 1 there, the trivial one and another, and
round-off decides which of them is taken for the trivial one.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from squealstudy.cycles.continuation import Steps, newton
from squealstudy.cycles.curve import CurveMotion, Path, between
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.floquet import Floquet
from squealstudy.cycles.folds import FOLD, fold_error, folds_alone
from squealstudy.cycles.moving import Moving, Oscillators
from squealstudy.cycles.projection import DAMPING_HELD, SIZE_HELD
from squealstudy.errors import ConvergenceError

HOPF, NS, PD, BP = "H", "NS", "PD", "BP"  # events beside a FOLD
RANGE, SHRUNK, CLOSED = "range", "hopf", "closed"  # why branches end, beside what `stop` says
# a step may close a loop if the start of the branch lies near it: at most so many step lengths
# along the step, and sideways from it
MAX_STEPS_PAST_START, MAX_STEPS_BESIDE_START = 1.2, 0.5
# largest difference in log size, relative frequency and share of the range at a loop's start
CLOSURE_TOLERANCE, PROJECTED_CLOSURE_TOLERANCE = 1e-6, 1e-3
PROJECTED_STEPS = Steps(first=0.1, least=1e-3, largest=0.3, count=120)
BIFURCATION_REL_TOLERANCE = 1e-6  # tolerance of NS, PD and BP over the range of the parameter
FOLD_NEIGHBOURS = 2, 5  # how many points away, on either side, a fold is looked for
# error of a Hopf point over the last step: sizes fall as a square root, so that a cycle may be
# missed
HOPF_STEPS = 2.0
# neighbours that differ by less than this share of the range lie at one value of the parameter
ONE_VALUE_REL_WIDTH = 1e-7
MIN_IMAGINARY = 1e-6  # least imaginary part of a multiplier that belongs to a complex pair
NEAR_ONE = 1e-4  # a double multiplier 1 is split by the square root of the matrix's error


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """A cycle on a branch.

    Attributes
    ----------
    motion : PeriodicMotion
        The cycle in all coordinates; its `parameter` is the value of the parameter.
    multipliers : Floquet
    residual : float
        Residual of the balance in the basis.
    error : float
        Error of the basis (`CurveMotion.error`).
    event : str
        H, F, NS, PD, BP or empty.
    apart : float
        Error of the parameter's value at an event, 0 at other points. At NS, PD and BP it follows
        from the errors of the multipliers; a whole step is added where the event was not located
        within its step. At a fold it is the error of the series, NaN where that is not known
        (`folds.fold_error`). At a Hopf point it is twice the last step.
    """

    motion: PeriodicMotion
    multipliers: Floquet
    residual: float
    error: float = 0.0
    event: str = ""
    apart: float = 0.0


class Loop:
    """Tells whether a branch has come back to the cycle that it began with.

    A step may have come back if it passes near the start in frequency, log size and parameter, in
    the direction of the first step. Then the balance is solved from the nearest place on the step,
    with the log size or the parameter as at the start: it leads to the start itself or to another
    cycle. Phases, which may turn on the way round, are not compared.
    """

    def __init__(self, moving: Moving, start: PeriodicMotion) -> None:
        self._moving, self._start = moving, start
        self._at = self._first = self._from = self._chord = np.zeros(3)
        self._share = np.inf
        self._last: PeriodicMotion | None = None

    def back(self, coordinates: np.ndarray, motion: PeriodicMotion) -> bool:
        """Whether the step to this motion passes the start; to be called for every step.

        `coordinates` (3,) are the last unknowns: scaled frequency, log size, scaled parameter.
        """
        last, self._last = self._last, motion
        if last is None:
            with contextlib.suppress(ConvergenceError):  # then the start is used as it is
                self._start = self._near(self._start, DAMPING_HELD)
            self._at = self._place(self._start)
            self._first, self._from = coordinates - self._at, coordinates
            return False
        self._chord = chord = coordinates - self._from
        step = self._at - self._from
        self._share = share = float(step @ chord / (chord @ chord))
        aside = np.linalg.norm(step - share * chord)
        near = (
            0.0 <= share <= MAX_STEPS_PAST_START
            and aside <= MAX_STEPS_BESIDE_START * np.linalg.norm(chord)
        )
        if near and chord @ self._first > 0.0 and self._same(between(last, motion, share)):
            return True
        self._from = coordinates
        return False

    def passed(self, motion: PeriodicMotion) -> bool:
        """Whether a motion of the last step is beyond the start."""
        along = (self._place(motion) - self._from) @ self._chord
        return bool(along > self._share * (self._chord @ self._chord))

    def _place(self, motion: PeriodicMotion) -> np.ndarray:
        """Scaled frequency, log size and scaled parameter (3,) of a motion."""
        scaled_place: np.ndarray = self._moving.equations(motion.harmonics).pack(motion)[-3:]
        return scaled_place

    def _same(self, motion: PeriodicMotion) -> bool:
        """Whether the cycle near a motion is the start."""
        coordinate = (
            DAMPING_HELD
            if abs(self._chord[DAMPING_HELD]) > abs(self._chord[SIZE_HELD])
            else SIZE_HELD
        )
        try:
            start = self._place(self._near(self._start, DAMPING_HELD))
            difference = (
                self._place(self._near(motion, coordinate, float(start[coordinate]))) - start
            )
        except ConvergenceError:
            return False
        closeness = CLOSURE_TOLERANCE if self._moving.complete else PROJECTED_CLOSURE_TOLERANCE
        return bool(np.abs(difference).max() < closeness)

    def _near(
        self, motion: PeriodicMotion, held_unknown: int, value: float | None = None
    ) -> PeriodicMotion:
        """The cycle near a motion, with one unknown fixed: at `value`, or as the motion has it."""
        equations = self._moving.equations(motion.harmonics)
        u = equations.pack(motion)
        equations.accepted(u)
        normal = np.zeros(len(u))
        normal[held_unknown] = 1.0
        u, *_ = newton(equations, u, normal, float(u[held_unknown]) if value is None else value)
        return equations.motion(u)


def cycles_along(
    oscillators: Oscillators,
    start: PeriodicMotion,
    bounds: tuple[float, float],
    direction: float,
    stop: Callable[[PeriodicMotion], str],
    steps: Steps | None = None,
) -> tuple[Moving, list[CurveMotion], str]:
    """Follow the curve of `branch` without multipliers; its basis, its cycles, why it ended."""
    moving = Moving(oscillators, bounds, start)
    loop = Loop(moving, start)

    def ended(u: np.ndarray, motion: PeriodicMotion) -> str:
        if not 0.0 <= u[-1] <= 1.0:
            return RANGE
        return stop(motion) or (CLOSED if loop.back(u[-3:], motion) else "")

    path = Path(
        projection=moving,
        harmonics=start.harmonics,
        first=(DAMPING_HELD, direction),
        ended=ended,
        steps=steps or (Steps() if moving.complete else PROJECTED_STEPS),
        tests={FOLD: lambda _, t: float(t[-1])},
    )
    curve, end = path.from_motion(start, DAMPING_HELD)
    if end == CLOSED:  # events beyond the start were found once already, in the first step
        while curve[-2].event and loop.passed(curve[-2].motion):
            del curve[-2]
        curve[-1] = curve[0]
    curve = folds_alone(curve, ONE_VALUE_REL_WIDTH * abs(bounds[1] - bounds[0]))
    return moving, _cut(moving, curve, bounds) if end == RANGE else curve, end


def branch(
    oscillators: Oscillators,
    start: PeriodicMotion,
    bounds: tuple[float, float],
    direction: float,
    stop: Callable[[PeriodicMotion], str],
    steps: Steps | None = None,
    highest: float = np.inf,
) -> tuple[list[BranchPoint], str]:
    """Follow cycles along a parameter from one of them, to the end of the range or a Hopf point.

    A closed branch, between two folds without a Hopf point, ends where it began.

    Parameters
    ----------
    oscillators : callable
        Returns the oscillator at a value of the parameter.
    start : PeriodicMotion
        The first cycle; its `parameter` is the value of the parameter.
    bounds : (low, high)
        Range of the parameter.
    direction : float
        1 towards higher values first, -1 towards lower ones.
    stop : callable
        Returns why the branch ends at a motion, ``hopf`` where that has shrunk to steady sliding;
        an empty text where it goes on.
    steps : Steps or None
        Arc lengths; None for those of the model's size.
    highest : float
        Angular frequency [rad/s] up to which complex modes span the deviations that stability is
        judged by.

    Returns
    -------
    points : list of BranchPoint
    end : str
        ``range``, ``closed``, what `stop` said, ``steps``, ``basis`` or ``not_converged``.

    Raises
    ------
    ConvergenceError
        Where there is no cycle near the start.
    """
    moving, curve, end = cycles_along(oscillators, start, bounds, direction, stop, steps)
    points = [
        BranchPoint(
            p.motion,
            stability.at_fold() if p.event == FOLD else stability,
            p.residual,
            p.error,
            p.event,
            _fold_apart(moving, curve, k) if p.event == FOLD else 0.0,
        )
        for k, p in enumerate(curve)
        for stability in [moving.stability(p.motion, highest)]
    ]
    if end == SHRUNK:
        steps_to_end = abs(curve[-1].motion.parameter - curve[-2].motion.parameter)
        points[-1] = replace(points[-1], event=HOPF, apart=HOPF_STEPS * steps_to_end)
    with_changes = _with_changes(moving, points, highest, abs(bounds[1] - bounds[0]))
    return [point for point in with_changes if not _is_of_a_fold(point, points)], end


def _is_of_a_fold(point: BranchPoint, points: list[BranchPoint]) -> bool:
    """Whether the multiplier that passes 1 at a point does so at a fold, within both errors."""
    return point.event == BP and any(
        abs(point.motion.parameter - other.motion.parameter) <= point.apart + other.apart
        for other in points
        if other.event == FOLD
    )


def _fold_apart(moving: Moving, curve: list[CurveMotion], k: int) -> float:
    """Error of the value of the fold at index `k`; NaN where it is not known."""
    for reach in FOLD_NEIGHBOURS:  # with more harmonics the fold may be beyond the nearest points
        before, after = (
            list(itertools.takewhile(lambda p: not p.event, side))
            for side in (curve[max(k - reach, 0) : k][::-1], curve[k + 1 : k + 1 + reach])
        )
        if not (before and after):
            return np.nan
        error = fold_error(moving, before[-1].motion, curve[k].motion, after[-1].motion)
        if np.isfinite(error):
            return error
    return np.nan


def _cut(
    moving: Moving, curve: list[CurveMotion], bounds: tuple[float, float]
) -> list[CurveMotion]:
    """Replace the last point, which has passed the end of the range, by the cycle at that end."""
    last, before = curve[-1].motion, curve[-2].motion
    low, high = bounds
    end = high if (last.parameter - low) / (high - low) > 1.0 else low
    share = (end - before.parameter) / (last.parameter - before.parameter)
    try:
        motion, residual = moving.at_value(replace(between(before, last, share), parameter=end))
    except ConvergenceError:
        return curve[:-1]
    return [*curve[:-1], CurveMotion(motion, residual, curve[-1].error)]


def _with_changes(
    moving: Moving, points: list[BranchPoint], highest: float, width: float
) -> list[BranchPoint]:
    """The points, and between them those at which multipliers pass the unit circle."""
    steps = np.abs(np.diff([point.motion.parameter for point in points]))
    at_one_value = np.concatenate(([False], steps < ONE_VALUE_REL_WIDTH * width, [False]))
    with_changes = points[:1]
    for k, (start_point, end_point) in enumerate(itertools.pairwise(points)):
        # multipliers of linear motion do not change; folds and Hopf points are events already
        has_no_change = {FOLD, HOPF} & {start_point.event, end_point.event} or at_one_value[k + 1]
        leaves_one_value = at_one_value[k : k + 3].any()  # a second multiplier is 1 at an end
        if not has_no_change and not (
            leaves_one_value and _outside_apart(start_point) == _outside_apart(end_point)
        ):
            changes = _changes(moving, start_point, end_point, highest, width)
            with_changes += [p for p in changes if not (leaves_one_value and p.event == BP)]
        with_changes.append(end_point)
    return with_changes


def _outside(multipliers: Floquet) -> int:
    return int((np.abs(multipliers.multipliers[:-1]) > 1.0).sum())


def _outside_apart(point: BranchPoint) -> int:
    """Number of multipliers outside the unit circle but for those near 1 and real positive ones.

    All are counted, the last too: where two are 1 either may have been taken for the trivial one.
    """
    multipliers = point.multipliers.multipliers
    is_apart = (np.abs(multipliers.imag) > MIN_IMAGINARY) | (multipliers.real < 0.0)
    is_apart &= np.abs(multipliers - 1.0) > NEAR_ONE
    return int((is_apart & (np.abs(multipliers) > 1.0)).sum())


def _changes(
    moving: Moving, before: BranchPoint, after: BranchPoint, highest: float, width: float
) -> list[BranchPoint]:
    """The points between two at which multipliers pass the unit circle, single or as a pair."""
    counts = sorted((_outside(before.multipliers), _outside(after.multipliers)))
    passing, events = counts[0], []
    while passing < counts[1]:
        event = _passing(moving, before, after, passing, highest, width)
        events.append(event)
        passing += 2 if event.event == NS else 1
    goes_back = after.motion.parameter < before.motion.parameter
    return sorted(events, key=lambda p: -p.motion.parameter if goes_back else p.motion.parameter)


def _passing(
    moving: Moving,
    before: BranchPoint,
    after: BranchPoint,
    number: int,
    highest: float,
    width: float,
) -> BranchPoint:
    """The point at which the multiplier with index `number`, by size, passes the unit circle."""
    logs = [float(np.log(np.abs(p.multipliers.multipliers[number]))) for p in (before, after)]
    share = logs[0] / (logs[0] - logs[1])
    interval = abs(after.motion.parameter - before.motion.parameter)
    inside = min((before, after), key=lambda p: abs(p.multipliers.multipliers[number]) - 1.0)
    # near the circle the error of a size is that of its log, which is linear over the step
    size_error = max(float(p.multipliers.errors[number]) for p in (before, after))
    rel_error = size_error / abs(logs[0] - logs[1]) if interval else 0.0
    motion = between(before.motion, after.motion, share)
    point = replace(inside, motion=motion, apart=interval * (1.0 + rel_error))
    if moving.complete:  # a small model: each evaluation costs little

        def at(share: float) -> BranchPoint:
            motion, residual = moving.at_value(between(before.motion, after.motion, share))
            return BranchPoint(motion, moving.stability(motion, highest, False), residual)

        def size(share: float) -> float:
            return float(np.log(np.abs(at(share).multipliers.multipliers[number])))

        try:
            precision = min(0.5, BIFURCATION_REL_TOLERANCE * width / interval) if interval else 0.5
            point = at(float(brentq(size, 0.0, 1.0, xtol=precision)))
            judged = moving.stability(point.motion, highest)
            point = replace(point, multipliers=judged, apart=interval * rel_error)
        except (ConvergenceError, ValueError):  # the point stays the one interpolated in the step
            pass
    passing = complex(point.multipliers.multipliers[number])
    if abs(passing.imag) > MIN_IMAGINARY:
        return replace(point, event=NS)
    return replace(point, event=PD if passing.real < 0 else BP)
