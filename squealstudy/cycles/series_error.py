"""What a limit cycle errs by: its series is cut off, its forces are sampled, its basis is small.

Friction with corners has harmonics that fall by a power of their order, and rungs of the ladder
that agree by chance: the last change alone is no bound, and none of them sees what all owe to the
same samples. A small model is therefore solved once more with so many harmonics and samples that
what is left is small beside the change. Where that costs more than the cycle itself, and on
projected models, the last two changes are looked at.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.cycles.contact import LEVEL_SAMPLES, ContactOscillator
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.projection import Projection
from squealstudy.errors import ConvergenceError

SAFETY = 2.0  # error over the last change: series that converge like 1/H are bounded too
FALL = 4.0  # by what changes fall at most from rung to rung, where the next one is not known
FINER = 2.25  # times the harmonics of a cycle, two rungs: of the one that it is held against
LEAST_FINER = 1.5  # the same where that would be more than
MOST_FINER = 39  # harmonics: of more the cost is that of the whole cycle
SOLVED = 1e-8  # relative: to which balances are solved


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
        """Of each number the larger error."""
        pairs = zip(self.all, other.all, strict=True)
        return SeriesErrors(*(float(np.maximum(a, b)) for a, b in pairs))


@dataclass(frozen=True, eq=False)
class Found:
    """A cycle, and its `ContactOscillator.levels`."""

    motion: PeriodicMotion
    levels: dict[str, float]


def change(before: Found, now: Found) -> SeriesErrors:
    """By what two findings of one cycle differ."""
    names = ("torque_rms", "contact_velocity", "torque_peak")
    level, velocity, peak = (_apart(before.levels[n], now.levels[n]) for n in names)
    velocity = 0.0 if math.isnan(velocity) else velocity
    level = velocity if math.isnan(level) else level
    return SeriesErrors(level, velocity, peak, abs(before.motion.omega / now.motion.omega - 1.0))


def _apart(before: float, now: float) -> float:
    return abs(before - now) / now if now > 0 else np.nan


def of_changes(found: Sequence[Found]) -> SeriesErrors:
    """Errors of the last of some rungs, by what the last two of them changed."""
    changes = [change(a, b) for a, b in itertools.pairwise(found[-3:])]
    last = changes[-1] if len(changes) == 1 else changes[-1].larger(changes[0] * (1.0 / FALL))
    return last * SAFETY


def of_finer(
    contact: ContactOscillator, projection: Projection, found: Found
) -> SeriesErrors | None:
    """Errors by the same cycle with more harmonics and twice the samples; None where not known."""
    H = found.motion.harmonics
    finer = min(math.ceil(FINER * H), MOST_FINER)
    if not projection.complete or finer < LEAST_FINER * H:
        return None
    osc = contact.oscillator
    osc = replace(osc, samples=2 * len(osc.sampling(H).synthesis))
    try:
        motion, _ = Projection.about(osc, found.motion).cycle_near(found.motion, finer)
    except ConvergenceError:
        return None
    levels = contact.levels(motion, 2 * LEVEL_SAMPLES)
    return change(found, Found(motion, levels)) * SAFETY


def of_samples(torque_harmonics: np.ndarray, found: Found) -> SeriesErrors:
    """What is owed to the tolerance of the balance, and to peaks between the samples of levels.

    A peak is missed by at most its curvature times the square of half a sample, over two.
    """
    h = np.arange(1, len(torque_harmonics) + 1)
    missed = 0.5 * (np.pi / LEVEL_SAMPLES) ** 2 * float(h**2 @ torque_harmonics)
    peak = found.levels["torque_peak"]
    peak = missed / peak if peak > 0 else np.nan
    return SeriesErrors(SOLVED, SOLVED, SOLVED + peak, SOLVED)
