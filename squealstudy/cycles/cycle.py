"""One limit cycle of a design: as many harmonics as its level needs, errors, stability.

A cycle has errors since its series is cut off, its forces are sampled, and its basis is small. The
harmonics of friction with corners fall only by a power of their order, and two numbers of harmonics
may agree by chance. So the last change alone is no bound, and it does not show an error of the
samples that all series share. A small model is therefore solved once more with so many harmonics
and samples that the error left is small beside the change. Where that would cost more than the
cycle itself, and on projected models, the error is estimated from the last two changes.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.cycles.contact import LEVEL_SAMPLES, ContactOscillator
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.floquet import SMALL_MAX_COORDINATES, Floquet
from squealstudy.cycles.growth import MIN_REL_FREQUENCY, STANDSTILL
from squealstudy.cycles.harmonics import most_finer
from squealstudy.cycles.projection import Projection
from squealstudy.cycles.time_nodes import cycle_at_nodes, has_corners, with_half_the_nodes
from squealstudy.errors import ConvergenceError

OK, INACCURATE = "ok", "inaccurate"
HARMONIC_COUNTS = (5, 7, 11, 17, 25, 39, 59)  # harmonics tried, each half as many again
PROJECTED_LADDER = HARMONIC_COUNTS[:3]  # on projected models, where more cost seconds each
# with a larger ratio of the error to the tolerance, 1.5 times as many harmonics would not be enough
GIVE_UP_ERROR_RATIO = 2.5
MAX_ERROR_FOR_STABILITY = 0.1  # the stability of a cycle is judged if its level has a smaller error
LEVELS = ("torque_rms", "contact_velocity")  # levels by which cycles are compared
# cycles are the same if frequencies and levels differ by no more than their errors plus this share;
SAME_CYCLE_REL_TOLERANCE = 1e-5
SAME_CYCLE_MAX_REL_TOLERANCE = 1e-2  # upper limit of that sum
# factor from the last change to the error: it bounds series that converge like 1/H, too
SERIES_SAFETY_FACTOR = 2.0
# factor from the change to a finer series to the error: the finer series has a part of that error
FINER_SERIES_SAFETY_FACTOR = 2.5
# a change counts as at least the previous change over this number: two cycles may agree by chance
MAX_CHANGE_RATIO = 4.0
# numbers of harmonics of the finer series over that of the cycle
FINER_HARMONIC_FACTORS = (2.25, 4.0)
LEAST_FINER = 1.5  # least such factor where `most_finer` limits the number
# samples of the finer series over those of the cycle: the samples of Hulten's contact that opens
# cause an error of 3.5e-5 in frequency, of which twice as many show 1.3e-5
FINER_SAMPLES = 4
# factor from the change to the cycle at nodes of time to the error
NODES_SAFETY_FACTOR = 1.5
BALANCE_REL_ERROR = 1e-8  # relative error of a cycle's numbers by the tolerance of its balance


@dataclass(frozen=True)
class Search:
    """Settings of a search for cycles.

    Attributes
    ----------
    harmonics : int or None
        Number of harmonics; None for as many as the tolerance needs.
    tolerance : float
        Relative error of levels.
    reach : float
        Contact velocity [m/s] up to which curves are followed.
    highest : float
        Angular frequency [rad/s] up to which complex modes span the deviations that the stability
        of cycles is judged by.
    """

    harmonics: int | None
    tolerance: float
    reach: float
    highest: float = np.inf


@dataclass(frozen=True, eq=False)
class Cycle:
    """A limit cycle.

    Attributes
    ----------
    motion : PeriodicMotion
    multipliers : Floquet
    levels : mapping
        `ContactOscillator.levels`.
    torque_harmonics : ndarray (H,)
        Amplitudes of the torque's harmonics 1 to H, N m.
    level_error, velocity_error, peak_error, frequency_error : float
        Estimated relative errors, by the series and by the basis. The level is the RMS of the
        torque, or the contact velocity where friction has no torque. The contact velocity and the
        peak of the torque (NaN without torque) are peaks, which converge more slowly.
    basis_error : float
        The basis's part of the level's error: the level's change by the correction in all
        coordinates.
    n_vectors : int
        Number of vectors in the basis.
    residual : float
    status : str
        ``ok`` or ``inaccurate``: the level's error is beyond the tolerance.
    """

    motion: PeriodicMotion
    multipliers: Floquet
    levels: dict[str, float]
    torque_harmonics: np.ndarray
    level_error: float
    velocity_error: float
    peak_error: float
    frequency_error: float
    basis_error: float
    n_vectors: int
    residual: float
    status: str

    @property
    def error(self) -> float:
        """The larger error of level and contact velocity."""
        return max(self.level_error, self.velocity_error)

    @property
    def attracts(self) -> bool | None:
        """Whether the cycle is stable; None where that is open, or its level is too inexact."""
        return self.multipliers.stable if self.level_error < MAX_ERROR_FOR_STABILITY else None


def cycle_near(
    contact: ContactOscillator, projection: Projection, motion: PeriodicMotion, search: Search
) -> Cycle:
    """The cycle near a motion, with as many harmonics as `search` needs.

    Raises
    ------
    ConvergenceError
        Where there is none.
    """
    slowest = MIN_REL_FREQUENCY * motion.omega
    tried: tuple[int, ...] = HARMONIC_COUNTS if projection.complete else PROJECTED_LADDER
    if search.harmonics is not None:
        tried = _pair(search.harmonics)
    rougher, other, rungs, errors = motion, motion, list[CycleLevels](), SeriesErrors()
    basis_error = residual = np.inf
    for harmonics in tried:
        try:
            motion, residual = projection.cycle_near(motion, harmonics)
        except ConvergenceError:
            if len(rungs) < 2:
                raise
            if projection.complete:
                continue  # one number of harmonics may fail at a corner of forces, more may not
            break  # the last cycle stands, with the error that its changes show
        if motion.omega < slowest:
            raise ConvergenceError(STANDSTILL, "a motion that comes to a standstill is no cycle")
        rougher = rungs[-1].motion if rungs else rougher
        cycle = projection.corrected(motion)
        rungs.append(CycleLevels(cycle, contact.levels(cycle)))
        if len(rungs) == 1:
            continue
        of_basis = change(CycleLevels(motion, contact.levels(motion)), rungs[-1])
        errors, basis_error = errors_by_changes(rungs) + of_basis, of_basis.level
        other = rougher
        if errors.level < search.tolerance or harmonics == tried[-1]:
            judged = series_errors(contact, projection, rungs[-1], errors_by_changes(rungs))
            if judged is not None:
                errors, other = judged[0] + of_basis, judged[1] or rougher
        if errors.level < search.tolerance:
            break
        if not projection.complete and errors.level > GIVE_UP_ERROR_RATIO * search.tolerance:
            break
    last, status = rungs[-1], OK if errors.level < search.tolerance else INACCURATE
    errors = with_peak_and_tolerance(contact, last, errors, other)
    return Cycle(
        last.motion,
        projection.stability(
            last.motion, search.highest, other if projection.complete else rougher
        ),
        last.levels,
        contact.torque_harmonics(last.motion),
        errors.level,
        errors.velocity,
        errors.peak,
        errors.frequency,
        basis_error,
        projection.size,
        residual,
        status,
    )


def _pair(harmonics: int) -> tuple[int, int]:
    """The number asked for, and before it two thirds of it, whose change estimates the error."""
    return max(1, min(harmonics - 1, round(harmonics / 1.5))), harmonics


def same_cycle(cycle: Cycle, other: Cycle) -> bool:
    """Whether two families have found one cycle."""
    a, b = ([c.motion.omega, *(c.levels[n] for n in LEVELS)] for c in (cycle, other))
    return are_one_cycle(a, b, cycle.error + other.error)


def are_one_cycle(numbers: Sequence[float], other_numbers: Sequence[float], errors: float) -> bool:
    """Whether a frequency and `LEVELS` are those of one cycle; `errors` is the sum of both's."""
    tolerance = min(SAME_CYCLE_REL_TOLERANCE + errors, SAME_CYCLE_MAX_REL_TOLERANCE)
    return all(
        abs(a - b) <= tolerance * abs(b) for a, b in zip(numbers, other_numbers, strict=True)
    )


@dataclass(frozen=True)
class SeriesErrors:
    """Relative errors of a cycle's numbers, or changes of them.

    Attributes
    ----------
    level, velocity, peak, frequency : float
        Errors of the torque's RMS (or of the contact velocity where friction has no torque), of the
        contact velocity, of the torque's peak (NaN without torque) and of the frequency.
    """

    level: float = np.inf
    velocity: float = np.inf
    peak: float = np.inf
    frequency: float = np.inf

    def __add__(self, other: SeriesErrors) -> SeriesErrors:
        return SeriesErrors(*(a + b for a, b in zip(self.all, other.all, strict=True)))

    def __mul__(self, factor: float) -> SeriesErrors:
        return SeriesErrors(*(factor * a for a in self.all))

    @property
    def all(self) -> tuple[float, float, float, float]:
        """All four errors."""
        return self.level, self.velocity, self.peak, self.frequency

    def larger(self, other: SeriesErrors) -> SeriesErrors:
        """The larger error of each number."""
        pairs = zip(self.all, other.all, strict=True)
        return SeriesErrors(*(float(np.maximum(a, b)) for a, b in pairs))


@dataclass(frozen=True, eq=False)
class CycleLevels:
    """A cycle, and its `ContactOscillator.levels`, or those of `levels_of_states`."""

    motion: PeriodicMotion
    levels: dict[str, float]


def change(before: CycleLevels, now: CycleLevels) -> SeriesErrors:
    """Relative differences of one cycle, solved with two numbers of harmonics."""
    names = ("torque_rms", "contact_velocity", "torque_peak")
    level, velocity, peak = (_rel_change(before.levels[n], now.levels[n]) for n in names)
    velocity = 0.0 if math.isnan(velocity) else velocity
    level = velocity if math.isnan(level) else level
    return SeriesErrors(level, velocity, peak, abs(before.motion.omega / now.motion.omega - 1.0))


def _rel_change(before: float, now: float) -> float:
    return abs(before - now) / now if now > 0 else np.nan


def errors_by_changes(cycle_levels: Sequence[CycleLevels]) -> SeriesErrors:
    """Errors of the last of several cycles with ever more harmonics, by the last two changes."""
    changes = [change(a, b) for a, b in itertools.pairwise(cycle_levels[-3:])]
    last = (
        changes[-1]
        if len(changes) == 1
        else changes[-1].larger(changes[0] * (1.0 / MAX_CHANGE_RATIO))
    )
    return last * SERIES_SAFETY_FACTOR


def errors_by_finer_series(
    contact: ContactOscillator,
    projection: Projection,
    cycle_levels: CycleLevels,
    by_changes: SeriesErrors,
) -> tuple[SeriesErrors, PeriodicMotion] | None:
    """Errors by the same cycle with more harmonics and samples, and the motion with the most.

    The error follows from the larger change to two such cycles, as one may agree by chance. Where
    there is one only, the error is not less than a part of `by_changes` (`errors_by_changes`).
    None on a projected model, where more harmonics would cost too much, and where they do not
    converge.
    """
    H, motion = cycle_levels.motion.harmonics, cycle_levels.motion
    max_harmonics = most_finer(contact.oscillator.n)
    orders = sorted({min(math.ceil(f * H), max_harmonics) for f in FINER_HARMONIC_FACTORS})
    orders = [order for order in orders if order >= LEAST_FINER * H]
    if not projection.complete or not orders:
        return None
    osc = contact.oscillator
    osc = replace(osc, samples=FINER_SAMPLES * len(osc.sampling(H).synthesis))
    finer, errors = Projection.on_harmonics_of(osc, motion), SeriesErrors(0.0, 0.0, 0.0, 0.0)
    try:
        for order in orders:
            motion, _ = finer.cycle_near(motion, order)
            levels = contact.levels(motion, 2 * LEVEL_SAMPLES)
            errors = errors.larger(change(cycle_levels, CycleLevels(motion, levels)))
    except ConvergenceError:
        return None
    errors = errors * FINER_SERIES_SAFETY_FACTOR
    if len(orders) == 1:
        errors = errors.larger(by_changes * (1.0 / (SERIES_SAFETY_FACTOR * MAX_CHANGE_RATIO)))
    return errors, motion


def errors_at_nodes(contact: ContactOscillator, cycle_levels: CycleLevels) -> SeriesErrors | None:
    """Errors by the cycle at nodes; None without corners, of many coordinates, or without it.

    The rule of the nodes errs by the square of their distance: twice that tells how much.
    """
    osc, motion = contact.oscillator, cycle_levels.motion
    if osc.n > SMALL_MAX_COORDINATES or not has_corners(osc, motion):
        return None
    try:
        fine = cycle_at_nodes(osc, motion)
    except ConvergenceError:
        return None
    limit, omega = contact.levels_of_states(fine.q, fine.v), fine.omega
    with contextlib.suppress(ConvergenceError):  # then the rule's error stays in, a part of 1e5
        coarse = with_half_the_nodes(osc, fine)
        few = contact.levels_of_states(coarse.q, coarse.v)
        limit = {name: level + (level - few[name]) / 3.0 for name, level in limit.items()}
        omega += (omega - coarse.omega) / 3.0
    at_nodes = CycleLevels(replace(motion, omega=omega), limit)
    return change(cycle_levels, at_nodes) * NODES_SAFETY_FACTOR


def series_errors(
    contact: ContactOscillator,
    projection: Projection,
    cycle_levels: CycleLevels,
    by_changes: SeriesErrors,
) -> tuple[SeriesErrors, PeriodicMotion | None] | None:
    """The larger errors of `errors_by_finer_series` and at nodes; its motion, None without it.

    Where only nodes have the cycle errors are not less than `by_changes`; None without both.
    """
    finer = errors_by_finer_series(contact, projection, cycle_levels, by_changes)
    at_nodes = errors_at_nodes(contact, cycle_levels)
    if at_nodes is None:
        return finer
    errors, motion = (by_changes, None) if finer is None else finer
    return errors.larger(at_nodes), motion


def with_peak_and_tolerance(
    contact: ContactOscillator,
    cycle_levels: CycleLevels,
    errors: SeriesErrors,
    other: PeriodicMotion,
) -> SeriesErrors:
    """Add the errors of the balances' tolerance, and to those of peaks errors of samples and laws.

    Samples miss a peak by at most its curvature times the square of half a sample, over two. Where
    sliding nearly comes to rest friction is steep over speed, and a small error of sliding changes
    the peak of the torque much. So the torque is computed again with sliding moved, both ways, by
    the largest difference to an `other` solution of the cycle.
    """
    torque, velocity = contact.torque(cycle_levels.motion), cycle_levels.levels["contact_velocity"]
    between = contact.velocity_between_samples(cycle_levels.motion)
    rel_velocity_error = BALANCE_REL_ERROR + (between / velocity if velocity > 0.0 else 0.0)
    peak = float(np.abs(torque - torque.mean()).max())
    if not peak > 0.0:
        return errors + SeriesErrors(
            BALANCE_REL_ERROR, rel_velocity_error, np.nan, BALANCE_REL_ERROR
        )
    spectrum = np.abs(np.fft.rfft(torque))[1:] * 2.0 / len(torque)
    h = np.arange(1, cycle_levels.motion.harmonics + 1)
    between_samples = 0.5 * (np.pi / len(torque)) ** 2 * float(h**2 @ spectrum[: len(h)])
    slip = contact.slip_apart(cycle_levels.motion, other)
    shifted_torques = (contact.torque(cycle_levels.motion, side * slip) for side in (-1.0, 1.0))
    by_slip = max(abs(float(np.abs(t - t.mean()).max()) - peak) for t in shifted_torques)
    return errors + SeriesErrors(
        BALANCE_REL_ERROR,
        rel_velocity_error,
        (between_samples + by_slip) / peak + BALANCE_REL_ERROR,
        BALANCE_REL_ERROR,
    )
