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

# error over the last change: series that converge like 1/H are bounded too
SERIES_SAFETY_FACTOR = 2.0
SURER = 2.5  # the same of finer ones, whose own error is up to a part of that of the cycle
FALL = 4.0  # by what changes fall at most from rung to rung, where the next one is not known
# times the harmonics of a cycle: of those that it is held against
FINER_HARMONIC_FACTORS = (2.25, 4.0)
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
class CycleLevels:
    """A cycle, and its `ContactOscillator.levels`."""

    motion: PeriodicMotion
    levels: dict[str, float]


def change(before: CycleLevels, now: CycleLevels) -> SeriesErrors:
    """By what two findings of one cycle differ."""
    names = ("torque_rms", "contact_velocity", "torque_peak")
    level, velocity, peak = (_rel_change(before.levels[n], now.levels[n]) for n in names)
    velocity = 0.0 if math.isnan(velocity) else velocity
    level = velocity if math.isnan(level) else level
    return SeriesErrors(level, velocity, peak, abs(before.motion.omega / now.motion.omega - 1.0))


def _rel_change(before: float, now: float) -> float:
    return abs(before - now) / now if now > 0 else np.nan


def of_changes(found: Sequence[CycleLevels]) -> SeriesErrors:
    """Errors of the last of some rungs, by what the last two of them changed."""
    changes = [change(a, b) for a, b in itertools.pairwise(found[-3:])]
    last = changes[-1] if len(changes) == 1 else changes[-1].larger(changes[0] * (1.0 / FALL))
    return last * SERIES_SAFETY_FACTOR


def of_finer(
    contact: ContactOscillator, projection: Projection, found: CycleLevels
) -> tuple[SeriesErrors, PeriodicMotion] | None:
    """Errors by the same cycle with more harmonics and twice the samples, and that motion.

    The largest change of two such cycles, of which one may agree by chance. None where not known.
    """
    H, motion = found.motion.harmonics, found.motion
    orders = sorted({min(math.ceil(f * H), MOST_FINER) for f in FINER_HARMONIC_FACTORS})
    orders = [order for order in orders if order >= LEAST_FINER * H]
    if not projection.complete or not orders:
        return None
    osc = contact.oscillator
    osc = replace(osc, samples=2 * len(osc.sampling(H).synthesis))
    finer, errors = Projection.about(osc, motion), SeriesErrors(0.0, 0.0, 0.0, 0.0)
    try:
        for order in orders:
            motion, _ = finer.cycle_near(motion, order)
            levels = contact.levels(motion, 2 * LEVEL_SAMPLES)
            errors = errors.larger(change(found, CycleLevels(motion, levels)))
    except ConvergenceError:
        return None
    return errors * SURER, motion


def in_the_end(
    contact: ContactOscillator, found: CycleLevels, errors: SeriesErrors, other: PeriodicMotion
) -> SeriesErrors:
    """With what is owed to the tolerance of balances, and of peaks to samples and to the corner.

    Between the samples of levels a peak is missed by at most its curvature times the square of half
    a sample, over two. Where sliding comes to rest or turns, its own error leads up and down the
    steep slope of the law, and all motions that overshoot there have the law's peak: sliding is
    moved by what it differs by from an `other` finding of the cycle.
    """
    torque = contact.torque(found.motion)
    peak = float(np.abs(torque - torque.mean()).max())
    if not peak > 0.0:
        return errors + SeriesErrors(SOLVED, SOLVED, np.nan, SOLVED)
    spectrum = np.abs(np.fft.rfft(torque))[1:] * 2.0 / len(torque)
    h = np.arange(1, found.motion.harmonics + 1)
    missed = 0.5 * (np.pi / len(torque)) ** 2 * float(h**2 @ spectrum[: len(h)])
    slip = contact.slip_apart(found.motion, other)
    shifted_torques = (contact.torque(found.motion, side * slip) for side in (-1.0, 1.0))
    led = max(abs(float(np.abs(t - t.mean()).max()) - peak) for t in shifted_torques)
    return errors + SeriesErrors(SOLVED, SOLVED, (missed + led) / peak + SOLVED, SOLVED)
