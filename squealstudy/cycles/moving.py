"""A basis for the cycles of a branch, which moves along its parameter."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

from squealstudy.cycles.continuation import TOLERANCE
from squealstudy.cycles.equations import BranchEquations, PeriodicMotion
from squealstudy.cycles.floquet import Floquet
from squealstudy.cycles.harmonics import most_finer, with_harmonics
from squealstudy.cycles.oscillator import LocalForces, Oscillator
from squealstudy.cycles.projection import DAMPING_HELD, PROJECTED_TOLERANCE, Projection
from squealstudy.errors import ConvergenceError

# number of harmonics over a cycle's, tried in order, with which it is solved again for the errors
# of its multipliers: less than one where more do not converge, or it has `most_finer` already
FINER_HARMONIC_FACTORS = (2.25, 1.5, 1 / 1.5)
Oscillators = Callable[[float], Oscillator]  # value of the parameter -> oscillator


def with_finer_samples(osc: Oscillator, harmonics: int) -> Oscillator:
    """The oscillator with twice as many samples of a period as it has for so many harmonics."""
    return replace(osc, samples=2 * len(osc.sampling(harmonics).synthesis))


class Moving:
    """A basis that moves along a parameter; `parameter` of motions is its value.

    Parameters
    ----------
    oscillators : callable
        Returns the oscillator at a value of the parameter.
    bounds : (low, high)
        Range of the parameter.
    start : PeriodicMotion
        The motion whose harmonics are the first vectors of the basis.
    """

    def __init__(
        self, oscillators: Oscillators, bounds: tuple[float, float], start: PeriodicMotion
    ) -> None:
        self._oscillators, self._bounds, self._omega = oscillators, bounds, start.omega
        self._value = start.parameter
        self.fixed = Projection.on_harmonics_of(oscillators(start.parameter), start)

    @property
    def complete(self) -> bool:
        """Whether the basis is that of all coordinates."""
        return self.fixed.complete

    @property
    def size(self) -> int:
        """Number of vectors."""
        return self.fixed.size

    def equations(self, harmonics: int) -> BranchEquations:
        """Equations of cycles along the parameter, in the basis."""
        tolerance = TOLERANCE if self.complete else PROJECTED_TOLERANCE
        vectors = self.fixed.of_harmonics(harmonics)
        return BranchEquations(
            self._oscillators, harmonics, self._omega, self._bounds, tolerance, vectors
        )

    def finer_equations(self, motion: PeriodicMotion, harmonics: int) -> BranchEquations:
        """Equations of cycles in all coordinates, with twice the samples that a motion has."""

        def finer(value: float) -> Oscillator:
            return with_finer_samples(self._oscillators(value), motion.harmonics)

        return BranchEquations(finer, harmonics, self._omega, self._bounds)

    def correction(
        self, motion: PeriodicMotion, fresh: bool = True, local: LocalForces | None = None
    ) -> PeriodicMotion:
        """`Projection.correction` at the motion's own value of the parameter."""
        correction = self._at(motion.parameter).correction(
            replace(motion, parameter=0.0), fresh, local
        )
        return replace(correction, parameter=0.0)

    def error(self, motion: PeriodicMotion, correction: PeriodicMotion) -> float:
        """Norm of a correction over that of the motion."""
        return self.fixed.error(motion, correction)

    def improve(
        self, motion: PeriodicMotion, target: float, held_unknown: int
    ) -> tuple[PeriodicMotion, float, float]:
        """`Projection.improve` at the motion's own value of the parameter."""
        improved, error, residual = self._at(motion.parameter).improve(
            replace(motion, parameter=0.0), target, held_unknown
        )
        return replace(improved, parameter=motion.parameter), error, residual

    def remember(self, motion: PeriodicMotion) -> None:
        """Note a motion that a rebuilt basis has to span."""
        self.fixed.remember(motion)

    def compact(self, motion: PeriodicMotion) -> None:
        """Rebuild a basis that is too large."""
        self.fixed.compact(motion)

    def grow(self, motion: PeriodicMotion, change: PeriodicMotion) -> None:
        """`Projection.grow` at the motion's own value of the parameter."""
        self._at(motion.parameter).grow(replace(motion, parameter=0.0), change)

    def stability(
        self, motion: PeriodicMotion, highest: float, series_errors: bool = True
    ) -> Floquet:
        """Multipliers of a cycle, judged on modes up to `highest` [rad/s].

        In all coordinates their errors include those of the series, if `series_errors`: for these
        the cycle is solved again with another number of harmonics.
        """
        projection, cycle = self._at(motion.parameter), replace(motion, parameter=0.0)
        other = self._finer(projection, cycle) if series_errors and self.complete else None
        return projection.stability(cycle, highest, other)

    @staticmethod
    def _finer(projection: Projection, cycle: PeriodicMotion) -> PeriodicMotion | None:
        """The cycle with other harmonics and more samples; None where it is not found."""
        osc = with_finer_samples(projection.oscillator, cycle.harmonics)
        for factor in FINER_HARMONIC_FACTORS:
            harmonics = math.ceil(factor * cycle.harmonics)
            if factor > 1.0:
                harmonics = min(harmonics, most_finer(osc.n))
                if harmonics <= cycle.harmonics:
                    continue
            other = replace(cycle, Q=with_harmonics(cycle.Q, harmonics))
            with suppress(ConvergenceError):
                return Projection.on_harmonics_of(osc, other).solve(other, DAMPING_HELD)[0]
        return None

    def at_value(self, motion: PeriodicMotion) -> tuple[PeriodicMotion, float]:
        """The cycle near a motion in the basis at the motion's own value, and its residual."""
        cycle, residual = self._at(motion.parameter).solve(
            replace(motion, parameter=0.0), DAMPING_HELD
        )
        return replace(cycle, parameter=motion.parameter), residual

    def _at(self, value: float) -> Projection:
        if value != self._value:
            self.fixed.move(self._oscillators(value))
            self._value = value
        return self.fixed
