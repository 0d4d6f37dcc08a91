"""Follows a curve of periodic motions on a basis of few vectors that grows with them.

A small model is followed in all coordinates. In a projected one each point is corrected in all
coordinates, harmonic by harmonic (`blocks`). Where that correction is too large it joins the basis
and the step is made again, from the previous motion balanced in the larger basis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from squealstudy.cycles.continuation import (
    CurvePoint,
    Steps,
    Test,
    follow,
    grown,
    newton,
    next_point,
)
from squealstudy.cycles.equations import CycleEquations, PeriodicMotion
from squealstudy.cycles.projection import CURVE_BASIS_ERROR, SIZE_HELD
from squealstudy.errors import ConvergenceError

if TYPE_CHECKING:
    from squealstudy.cycles.oscillator import LocalForces

BASIS = "basis"  # the basis errs by too much, or is too large
LOST = "not_converged"  # no next point was found
MAX_ENRICHMENTS_PER_STEP = 6  # enrichments for one step, before it is halved
ROUGH_EVENT_TOLERANCE = 2e-2  # tolerance over the step of an event that is corrected afterwards
MAX_RESTARTS = 2  # restarts of a lost curve on a new basis
MAX_BASIS_CHANGE = 5e-2  # a motion is the same if another basis changes it by less
MAX_POINTS_BACK = 4  # most points that are removed because a larger basis does not have them
# cosine between directions before and after a change of basis, below which the sign is unclear
MIN_DIRECTION_COSINE = 0.5
# arc length to the point that gives the direction of a curve in another basis
DIRECTION_PROBE_LENGTH = 1e-2

Ended = Callable[[np.ndarray, PeriodicMotion], str]  # (unknowns, motion) -> reason to end, or empty


@dataclass(frozen=True, eq=False)
class CurveMotion:
    """A motion on a curve.

    Attributes
    ----------
    motion : PeriodicMotion
        The motion in all coordinates.
    residual : float
        Residual of the balance in the basis.
    error : float
        Error of the basis, relative in elastic energy, by the correction of each harmonic.
    event : str
        Name of the test that is zero here.
    """

    motion: PeriodicMotion
    residual: float
    error: float
    event: str = ""


class CurveBasis(Protocol):
    """The basis that the motions of a curve are balanced in.

    A `Projection` at one design, a `branch.Moving` along a parameter.
    """

    @property
    def complete(self) -> bool:
        """Whether the basis is that of all coordinates."""
        ...

    @property
    def size(self) -> int:
        """Number of vectors."""
        ...

    def equations(self, harmonics: int) -> CycleEquations:
        """Equations of motions in the basis."""
        ...

    def correction(
        self, motion: PeriodicMotion, fresh: bool = ..., local: LocalForces | None = ...
    ) -> PeriodicMotion:
        """Correction of a motion that is balanced in the basis."""
        ...

    def error(self, motion: PeriodicMotion, correction: PeriodicMotion) -> float:
        """Norm of a correction over that of the motion."""
        ...

    def improve(
        self, motion: PeriodicMotion, target: float, held_unknown: int
    ) -> tuple[PeriodicMotion, float, float]:
        """The motion in a basis in which it errs by less than `target`, its error and residual."""
        ...

    def remember(self, motion: PeriodicMotion) -> None:
        """Note a motion that a rebuilt basis has to span."""
        ...

    def compact(self, motion: PeriodicMotion) -> None:
        """Rebuild a basis that is too large."""
        ...

    def grow(self, motion: PeriodicMotion, change: PeriodicMotion) -> None:
        """Add a correction to the basis."""
        ...


@dataclass
class Path:
    """A curve that is followed, and its direction.

    Attributes
    ----------
    projection : CurveBasis
    harmonics : int
    first : (int, float)
        Index of the unknown that changes first, and the sign of its change.
    ended : callable
        Returns the reason to end at a point, or an empty text.
    steps : Steps
    tests : mapping of str -> callable
        Events that are located.
    watched : int or None
        See `continuation.follow`.
    """

    projection: CurveBasis
    harmonics: int
    first: tuple[int, float]
    ended: Ended
    steps: Steps
    tests: Mapping[str, Test]
    watched: int | None = None

    def from_motion(
        self, start: PeriodicMotion, fixed_unknown: int = SIZE_HELD
    ) -> tuple[list[CurveMotion], str]:
        """The curve through a motion, which keeps its size or its parameter (`fixed_unknown`).

        Returns
        -------
        motions : list of CurveMotion
            The points of the curve and its events; on a projected model an event is located to
            `ROUGH_EVENT_TOLERANCE` of its step.
        end : str
            The reason that `ended` gave; ``basis`` where too many vectors would be needed;
            ``steps`` or ``not_converged``.

        Raises
        ------
        ConvergenceError
            Where there is no motion near the start.
        """
        if self.projection.complete:
            return self._plain(start, fixed_unknown)
        motion, error, residual = self.projection.improve(start, CURVE_BASIS_ERROR, fixed_unknown)
        curve_motions = [CurveMotion(motion, residual, error)]
        reached, end = 0, ""
        for _ in range(1 + MAX_RESTARTS):
            try:
                end = self._growing(curve_motions, fixed_unknown)
            except ConvergenceError as error_there:
                end = error_there.status
            if end != LOST or len(curve_motions) <= reached + 1:
                break
            reached = len(curve_motions)
        return curve_motions, end

    def _plain(self, start: PeriodicMotion, held_unknown: int) -> tuple[list[CurveMotion], str]:
        """Follow the curve with a complete basis, which need not grow along it."""
        equations = self.projection.equations(self.harmonics)
        u = equations.pack(start)
        equations.accepted(u)
        normal = np.zeros(len(u))
        normal[held_unknown] = 1.0
        u, *_ = newton(equations, u, normal, float(u[held_unknown]))
        curve = follow(
            equations,
            u,
            self._first_direction(u),
            self.steps,
            self.tests,
            lambda u: self.ended(u, equations.motion(u)),
            watched=self.watched,
        )
        curve_motions = [
            CurveMotion(equations.motion(p.u), p.residual, 0.0, "".join(p.events))
            for p in curve.points
        ]
        return curve_motions, curve.end

    def _first_direction(self, u: np.ndarray) -> np.ndarray:
        direction = np.zeros(len(u))
        direction[self.first[0]] = self.first[1]
        return direction

    def _growing(self, motions: list[CurveMotion], held_unknown: int) -> str:
        """Add the motions of the curve after the last one to `motions`; return why it ends."""
        projection, steps = self.projection, self.steps
        h, tries = steps.first, 0
        equations, current = self._begun(motions, held_unknown)
        while len(motions) < steps.count:
            step = next_point(
                equations,
                current,
                h,
                steps.least,
                self.tests,
                ROUGH_EVENT_TOLERANCE,
                watched=self.watched,
            )
            if step is None:  # the next motion may need directions that the basis lacks here
                motions_of_step = (
                    None if tries else self._grown(equations, current, motions[-1].motion)
                )
                if motions_of_step is None:
                    return LOST
                tries, h = tries + 1, steps.first
                equations, current = self._again(motions, *motions_of_step)
                continue
            following, events, taken, iterations = step
            motion = equations.motion(following.u)
            change = projection.correction(motion, local=equations.forces(following.u))
            error = projection.error(motion, change)
            if error > CURVE_BASIS_ERROR:
                tries += 1
                h = taken if tries % MAX_ENRICHMENTS_PER_STEP else 0.5 * taken
                if h < steps.least:
                    return BASIS
                if motions_of_step := self._grown(
                    equations, current, motion, equations.forces(following.u)
                ):
                    equations, current = self._again(motions, *motions_of_step)
                continue
            h = grown(taken, iterations, steps, float(current.tangent @ following.tangent))
            tries, current = 0, following
            equations.accepted(following.u)
            for p in (*events, following):
                motion_here = equations.motion(p.u)
                motions.append(CurveMotion(motion_here, p.residual, error, "".join(p.events)))
            projection.remember(motion)
            if reason := self.ended(following.u, motion):
                return reason
        return "steps"

    def _begun(
        self, motions: list[CurveMotion], held_unknown: int
    ) -> tuple[CycleEquations, CurvePoint]:
        """Equations and point at the last motion of the curve, to continue it.

        Where the curve was lost, that motion gets a new basis: the one that has grown along the
        curve may lead to another curve.
        """
        if len(motions) == 1:
            return self._here(motions[0].motion)
        for _ in range(MAX_POINTS_BACK):
            plain = [k for k, m in enumerate(motions) if not m.event]
            if len(plain) < 2:
                break
            previous, last = (motions[k].motion for k in plain[-2:])
            try:
                motion, error, residual = self.projection.improve(
                    last, CURVE_BASIS_ERROR, held_unknown
                )
                restarted = self._here(
                    motion, between(previous, motion, 1.0 + ROUGH_EVENT_TOLERANCE), previous
                )
            except ConvergenceError:
                motion = None
            if (
                motion is not None
                and self.projection.error(last, _change(last, motion)) < MAX_BASIS_CHANGE
            ):
                motions[-1] = CurveMotion(motion, residual, error)
                return restarted
            del motions[plain[-2] + 1 :]
        raise ConvergenceError(LOST, "the curve was lost, and not found again")

    def _grown(
        self,
        equations: CycleEquations,
        current: CurvePoint,
        motion: PeriodicMotion,
        local: LocalForces | None = None,
    ) -> tuple[PeriodicMotion, PeriodicMotion] | None:
        """Extend the basis by the correction of a motion; None where it does not grow.

        Returns the motion at the current point, and one ahead of it, in all coordinates.
        """
        projection = self.projection
        start, ahead = (
            equations.motion(current.u + length * current.tangent)
            for length in (0.0, DIRECTION_PROBE_LENGTH)
        )
        projection.remember(ahead)
        projection.compact(motion)
        before = projection.size
        projection.grow(motion, projection.correction(motion, True, local))
        return (start, ahead) if projection.size > before else None

    def _again(
        self, motions: list[CurveMotion], start: PeriodicMotion, ahead: PeriodicMotion
    ) -> tuple[CycleEquations, CurvePoint]:
        """Equations and point at the last motion in the present, larger basis.

        A point that does not exist in the larger basis was an artefact of the smaller one: it is
        removed, and the curve continues from the point before.
        """
        for _ in range(MAX_POINTS_BACK):
            plain = [k for k, m in enumerate(motions) if not m.event]
            try:
                return self._here(start, ahead, motions[plain[-2]].motion if plain[1:] else None)
            except ConvergenceError:
                if len(plain) < 3:
                    raise
                ahead = motions[plain[-1]].motion
                del motions[plain[-2] + 1 :]
                start = motions[-1].motion
        raise ConvergenceError(LOST, "the curve was lost in a larger basis")

    def _here(
        self,
        motion: PeriodicMotion,
        ahead: PeriodicMotion | None = None,
        previous: PeriodicMotion | None = None,
    ) -> tuple[CycleEquations, CurvePoint]:
        """Equations and point at a motion in the present basis, with the direction to `ahead`.

        ConvergenceError where that direction is unclear, or leads back to `previous`.
        """
        equations = self.projection.equations(self.harmonics)
        u = equations.pack(motion)
        equations.accepted(u)
        direction = self._first_direction(u)
        if ahead is not None:
            direction = equations.pack(ahead) - u
            direction /= np.linalg.norm(direction)
        u, residual, _, bordered = newton(equations, u, direction, None)
        tangent = bordered.towards(direction)
        points_back = previous is not None and tangent @ (equations.pack(previous) - u) > 0.0
        if ahead is not None and (points_back or tangent @ direction < MIN_DIRECTION_COSINE):
            raise ConvergenceError(LOST, "which way the curve goes on cannot be told")
        return equations, CurvePoint(u, tangent, residual)


def _change(before: PeriodicMotion, after: PeriodicMotion) -> PeriodicMotion:
    return PeriodicMotion(after.Q - before.Q, after.omega - before.omega)


def between(first: PeriodicMotion, second: PeriodicMotion, share: float) -> PeriodicMotion:
    """Linear interpolation of two motions that are in phase and have as many harmonics."""
    omega = first.omega + share * (second.omega - first.omega)
    parameter = first.parameter + share * (second.parameter - first.parameter)
    return PeriodicMotion(first.Q + share * (second.Q - first.Q), omega, parameter)
