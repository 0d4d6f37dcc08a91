"""One limit cycle of a design: as many harmonics as its level asks for, errors, stability.

A cycle errs since its series is cut off, its forces are sampled, and its basis is small. Friction
with corners has harmonics that fall by a power of their order, and two numbers of harmonics may
agree by chance: the last change alone is no bound, and shows nothing of what all owe to the same
samples. A small model is therefore solved once more with so many harmonics and samples that what is
left is small beside the change. Where that costs more than the cycle itself, and on projected
models, the last two changes are looked at.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.cycles.contact import LEVEL_SAMPLES, ContactOscillator
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.floquet import Floquet
from squealstudy.cycles.growth import MIN_REL_FREQUENCY, STANDSTILL
from squealstudy.cycles.harmonics import most_finer
from squealstudy.cycles.projection import Projection
from squealstudy.errors import ConvergenceError

OK, INACCURATE = "ok", "inaccurate"
HARMONIC_COUNTS = (5, 7, 11, 17, 25, 39, 59)  # harmonics tried, each half as many again
PROJECTED_LADDER = HARMONIC_COUNTS[:3]  # on projected models, where more cost seconds each
# times the tolerance: an error that half as many harmonics again do not mend
GIVE_UP_ERROR_RATIO = 2.5
MAX_ERROR_FOR_STABILITY = 0.1  # error of a level up to which the stability of a cycle is told
LEVELS = ("torque_rms", "contact_velocity")  # by which cycles are told apart
# relative difference of frequencies and levels of one cycle found twice, beside errors
SAME_CYCLE_REL_TOLERANCE = 1e-5
SAME_CYCLE_MAX_REL_TOLERANCE = 1e-2  # and the most of it, however large the errors are
# error over the last change: series that converge like 1/H are bounded too
SERIES_SAFETY_FACTOR = 2.0
# the same of a finer series, which errs by up to a part of the cycle's error
FINER_SERIES_SAFETY_FACTOR = 2.5
# a change is taken to be at least that before it over this: two cycles may agree by chance
MAX_CHANGE_RATIO = 4.0
# times the harmonics of a cycle: of those that it is held against
FINER_HARMONIC_FACTORS = (2.25, 4.0)
LEAST_FINER = 1.5  # the same where that would be more than `most_finer`
# times the samples: Hulten's contact that opens errs by 3.5e-5 in frequency, twice show 1.3e-5
FINER_SAMPLES = 4
SOLVED = 1e-8  # relative: to which balances are solved


@dataclass(frozen=True)
class Search:
    """Settings of a search for cycles.

    Attributes
    ----------
    harmonics : int or None
        None: as many as the tolerance asks for.
    tolerance : float
        Of levels, relative.
    reach : float
        Contact velocity [m/s] up to which curves are followed.
    highest : float
        rad/s: complex modes up to it are in what the stability of cycles is judged on.
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
        N m.
    level_error, velocity_error, peak_error, frequency_error : float
        Bounds, relative: of the series (`errors_by_changes`), and of the basis. The level is the
        RMS of the torque, or the contact velocity where friction has none; the velocity is a peak,
        to which harmonics converge more slowly, as to that of the torque (NaN where it has none).
    basis_error : float
        The basis's share of the level's error: by how much it was corrected in all coordinates.
    n_vectors : int
        Size of the basis.
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
        """Whether it is stable; None where that cannot be said, or the cycle is too inexact."""
        return self.multipliers.stable if self.level_error < MAX_ERROR_FOR_STABILITY else None


def cycle_near(
    contact: ContactOscillator, projection: Projection, motion: PeriodicMotion, search: Search
) -> Cycle:
    """The cycle near a motion, with as many harmonics as asked for; ConvergenceError."""
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
                continue  # one number of harmonics may miss a kink that the next ones find
            break  # more harmonics are lost: what is known of the last ones is the error
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
            finer = errors_by_finer_series(contact, projection, rungs[-1], errors_by_changes(rungs))
            if finer is not None:
                errors, other = finer[0] + of_basis, finer[1]
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
    """The number asked for, after two thirds of it to tell its error."""
    return max(1, min(harmonics - 1, round(harmonics / 1.5))), harmonics


def same_cycle(cycle: Cycle, other: Cycle) -> bool:
    """Whether two families have found one cycle."""
    a, b = ([c.motion.omega, *(c.levels[n] for n in LEVELS)] for c in (cycle, other))
    return are_one_cycle(a, b, cycle.error + other.error)


def are_one_cycle(numbers: Sequence[float], other_numbers: Sequence[float], errors: float) -> bool:
    """Whether frequencies and `LEVELS` are those of one cycle, by the relative errors of both."""
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
        Of the torque's RMS (of the contact velocity where friction has no torque), of the contact
        velocity, of the torque's peak (NaN without torque) and of the frequency.
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
        """The four."""
        return self.level, self.velocity, self.peak, self.frequency

    def larger(self, other: SeriesErrors) -> SeriesErrors:
        """The larger error of each number."""
        pairs = zip(self.all, other.all, strict=True)
        return SeriesErrors(*(float(np.maximum(a, b)) for a, b in pairs))


@dataclass(frozen=True, eq=False)
class CycleLevels:
    """A cycle, and its `ContactOscillator.levels`."""

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
    """Errors of the last of some cycles with ever more harmonics, by the last two changes."""
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
    """Errors by the same cycle with more harmonics and samples, and that motion.

    The largest change of two such cycles, of which one may agree by chance; of one alone not less
    than a part of `errors_by_changes`. None where not known.
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


def with_peak_and_tolerance(
    contact: ContactOscillator,
    cycle_levels: CycleLevels,
    errors: SeriesErrors,
    other: PeriodicMotion,
) -> SeriesErrors:
    """Errors with those of the balances' tolerance; of peaks also those of samples and corners.

    Between the samples of levels a peak, of velocity too, is missed by at most its curvature times
    the square of half a sample, over two. Where sliding comes to rest or turns, its own error leads
    up and down the steep slope of the law, and all motions that overshoot there have the law's
    peak: sliding is moved by what it differs by from an `other` finding of the cycle.
    """
    torque, velocity = contact.torque(cycle_levels.motion), cycle_levels.levels["contact_velocity"]
    between = contact.velocity_between_samples(cycle_levels.motion)
    of_velocity = SOLVED + (between / velocity if velocity > 0.0 else 0.0)
    peak = float(np.abs(torque - torque.mean()).max())
    if not peak > 0.0:
        return errors + SeriesErrors(SOLVED, of_velocity, np.nan, SOLVED)
    spectrum = np.abs(np.fft.rfft(torque))[1:] * 2.0 / len(torque)
    h = np.arange(1, cycle_levels.motion.harmonics + 1)
    missed = 0.5 * (np.pi / len(torque)) ** 2 * float(h**2 @ spectrum[: len(h)])
    slip = contact.slip_apart(cycle_levels.motion, other)
    shifted_torques = (contact.torque(cycle_levels.motion, side * slip) for side in (-1.0, 1.0))
    led = max(abs(float(np.abs(t - t.mean()).max()) - peak) for t in shifted_torques)
    return errors + SeriesErrors(SOLVED, of_velocity, (missed + led) / peak + SOLVED, SOLVED)
