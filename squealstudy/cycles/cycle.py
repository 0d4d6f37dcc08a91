"""One limit cycle of a design: as many harmonics as its level asks for, errors, stability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.floquet import Floquet
from squealstudy.cycles.growth import MIN_REL_FREQUENCY, STANDSTILL
from squealstudy.cycles.projection import Projection
from squealstudy.cycles.series_error import (
    CycleLevels,
    SeriesErrors,
    change,
    in_the_end,
    of_changes,
    of_finer,
)
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


@dataclass(frozen=True)
class Search:
    """What is looked for.

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
        Bounds, relative: of the series (`series_error`), and of the basis. The level is the RMS of
        the torque, or the contact velocity where friction has none; the velocity is a peak, to
        which harmonics converge more slowly, as to that of the torque (NaN where it has none).
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
        """Of level and contact velocity, the larger."""
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
            break  # more harmonics are lost: what is known of the last ones is the error
        if motion.omega < slowest:
            raise ConvergenceError(STANDSTILL, "a motion that comes to a standstill is no cycle")
        rougher = rungs[-1].motion if rungs else rougher
        cycle = projection.corrected(motion)
        rungs.append(CycleLevels(cycle, contact.levels(cycle)))
        if len(rungs) == 1:
            continue
        of_basis = change(CycleLevels(motion, contact.levels(motion)), rungs[-1])
        errors, basis_error = of_changes(rungs) + of_basis, of_basis.level
        other = rougher
        if errors.level < search.tolerance or harmonics == tried[-1]:
            finer = of_finer(contact, projection, rungs[-1])
            if finer is not None:
                errors, other = finer[0] + of_basis, finer[1]
        if errors.level < search.tolerance:
            break
        if not projection.complete and errors.level > GIVE_UP_ERROR_RATIO * search.tolerance:
            break
    last, status = rungs[-1], OK if errors.level < search.tolerance else INACCURATE
    errors = in_the_end(contact, last, errors, other)
    return Cycle(
        last.motion,
        projection.stability(last.motion, search.highest, rougher),
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


def same_cycle(one: Cycle, other: Cycle) -> bool:
    """Whether two families have found one cycle."""
    a, b = ([c.motion.omega, *(c.levels[n] for n in LEVELS)] for c in (one, other))
    return are_one_cycle(a, b, one.error + other.error)


def are_one_cycle(one: Sequence[float], other: Sequence[float], errors: float) -> bool:
    """Whether frequencies and `LEVELS` are those of one cycle, by the relative errors of both."""
    near = min(SAME_CYCLE_REL_TOLERANCE + errors, SAME_CYCLE_MAX_REL_TOLERANCE)
    return all(abs(a - b) <= near * abs(b) for a, b in zip(one, other, strict=True))
