"""A curve of periodic motions on a basis that grows with them.

A small model is followed as it is. Of a projected one each point is corrected in all coordinates
by blocks; where that correction is too large the curve ends, the basis grows, and it goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from squealstudy.cycles.continuation import LOCATED, Curve, Steps, Test, follow
from squealstudy.cycles.equations import CycleEquations, PeriodicMotion
from squealstudy.cycles.projection import SIZE
from squealstudy.errors import ConvergenceError

BASIS = "basis"  # the basis errs by too much: the curve goes on with a larger one
LOST = "not_converged"
WORST, TARGET, FINE = 3e-2, 3e-3, 3e-4  # error of the basis: on the curve, after it has grown
SHARES = (1.0, 0.4, 0.15, 0.05)  # of a step at whose end the basis does not hold
ROUGHLY = 1e-3  # of a step: where an event is, if it is corrected anyhow

Ended = Callable[[np.ndarray, PeriodicMotion], str]  # of unknowns and the motion; why it ends there


class Basis(Protocol):
    """What a curve is followed on: a `Projection` at one design, `Moving` along a parameter."""

    @property
    def complete(self) -> bool:
        """Whether it is that of all coordinates."""
        ...

    @property
    def size(self) -> int:
        """Number of vectors."""
        ...

    def equations(self, harmonics: int) -> CycleEquations:
        """Of the curve, in the basis."""
        ...

    def lowered(self, motion: PeriodicMotion) -> PeriodicMotion:
        """A motion of all coordinates in those of the basis."""
        ...

    def lifted(self, motion: PeriodicMotion) -> PeriodicMotion:
        """The other way."""
        ...

    def correction(self, motion: PeriodicMotion, fresh: bool = False) -> PeriodicMotion:
        """As of `Projection`."""
        ...

    def error(self, motion: PeriodicMotion, correction: PeriodicMotion) -> float:
        """As of `Projection`."""
        ...

    def improve(
        self, motion: PeriodicMotion, target: float, held: int
    ) -> tuple[PeriodicMotion, float, float]:
        """As of `Projection`."""
        ...

    def remember(self, motion: PeriodicMotion) -> None:
        """As of `Projection`."""
        ...


@dataclass(frozen=True, eq=False)
class CurveMotion:
    """A motion on a curve.

    Attributes
    ----------
    motion : PeriodicMotion
        Of all coordinates.
    residual : float
        Of the balance in the basis.
    error : float
        Of the basis, relative in elastic energy, by the blocks of the harmonics.
    event : str
        Name of the test that is zero here.
    """

    motion: PeriodicMotion
    residual: float
    error: float
    event: str = ""


@dataclass
class Path:
    """What is followed, and which way.

    Attributes
    ----------
    projection : Basis
    harmonics : int
    first : (int, float)
        Place among the unknowns, and sign, of what changes first.
    ended : callable
        Why the curve ends at a point; empty where it goes on.
    steps : Steps
    tests : mapping of str -> callable
        Events that are located.
    watched : int or None
        As of `continuation.follow`.
    """

    projection: Basis
    harmonics: int
    first: tuple[int, float]
    ended: Ended
    steps: Steps
    tests: Mapping[str, Test]
    watched: int | None = None

    def from_motion(self, start: PeriodicMotion, held: int = SIZE) -> tuple[list[CurveMotion], str]:
        """The curve through a motion, which keeps its size or its mu (`held`).

        Returns
        -------
        motions : list of CurveMotion
            Events stand among them; on a projected model to a part of a step.
        end : str
            What `ended` said; ``basis`` where too many vectors would be needed; ``steps`` or
            ``not_converged``.

        Raises
        ------
        ConvergenceError
            Where there is no motion near the start.
        """
        projection = self.projection
        motion, error, residual = projection.improve(start, TARGET, held)
        found = [CurveMotion(motion, residual, error)]
        ahead: PeriodicMotion | None = None
        while len(found) < self.steps.count:
            curve, there = self._stretch(found, ahead)
            if curve.end == BASIS and there is not None:
                ahead = self._ahead(found[-1].motion, there)
                if ahead is None:
                    return found, BASIS
            elif curve.end == LOST and not projection.complete:
                before = projection.size
                try:
                    projection.improve(found[-1].motion, FINE, SIZE)
                except ConvergenceError:
                    return found, curve.end
                if projection.size == before:
                    return found, curve.end
                ahead = None
            else:
                return found, curve.end
        return found, "steps"

    def _ahead(self, last: PeriodicMotion, there: PeriodicMotion) -> PeriodicMotion | None:
        """A motion between two, as far as can be, on a basis that has grown to hold it."""
        self.projection.remember(last)
        for share in SHARES:
            try:
                return self.projection.improve(between(last, there, share), TARGET, SIZE)[0]
            except ConvergenceError:
                continue
        return None

    def _stretch(
        self, found: list[CurveMotion], ahead: PeriodicMotion | None
    ) -> tuple[Curve, PeriodicMotion | None]:
        """The curve on from the last motion, as far as the basis holds, towards `ahead`.

        And the motion at which the basis no longer holds, which does not join what is found.
        """
        projection = self.projection
        equations = projection.equations(self.harmonics)
        u = equations.pack(projection.lowered(found[-1].motion))
        equations.accepted(u)
        along = np.zeros(len(u))
        along[self.first[0]] = self.first[1]
        if ahead is None and len(found) > 1:  # as it came
            before = equations.pack(projection.lowered(found[-2].motion))
            along[-3:] = (u - before)[-3:]
        elif ahead is not None:
            along[-3:] = (equations.pack(projection.lowered(ahead)) - u)[-3:]
        errors: list[float] = [found[-1].error]

        def ended(u: np.ndarray) -> str:
            motion = projection.lifted(equations.motion(u))
            error = projection.error(motion, projection.correction(motion))
            if error > WORST:
                return BASIS
            errors.append(error)
            return self.ended(u, motion)

        located = LOCATED if projection.complete else ROUGHLY
        curve = follow(
            equations, u, along, self.steps, self.tests, ended, located, watched=self.watched
        )
        points, there = curve.points[1:], None
        if curve.end == BASIS:
            there = projection.lifted(equations.motion(points[-1].u))
            while points and (points[-1].events or points[-1] is curve.points[-1]):
                points.pop()
        plain = 0
        for point in points:
            plain += not point.events
            error = errors[min(plain + bool(point.events), len(errors) - 1)]
            motion = projection.lifted(equations.motion(point.u))
            found.append(CurveMotion(motion, point.residual, error, "".join(point.events)))
        return curve, there


def between(one: PeriodicMotion, other: PeriodicMotion, share: float) -> PeriodicMotion:
    """A motion on the way from one to another of as many harmonics, in phase with it."""
    omega, mu = (a + share * (b - a) for a, b in ((one.omega, other.omega), (one.mu, other.mu)))
    return PeriodicMotion(one.Q + share * (other.Q - one.Q), omega, mu)
