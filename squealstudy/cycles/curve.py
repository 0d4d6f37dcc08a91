"""A curve of periodic motions on a basis that grows with them.

A small model is followed as it is. Of a projected one each point is corrected in all coordinates
by blocks; where that correction is too large the basis grows by it and the step is made again: the
motion before it is balanced in the larger basis after a Newton step or two.
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
LOST = "not_converged"
MAX_ENRICHMENTS_PER_STEP = 6  # enrichments for one step, before it is halved
ROUGH_EVENT_TOLERANCE = 2e-2  # tolerance over the step of an event that is corrected afterwards
MAX_RESTARTS = 2  # restarts of a lost curve on a new basis
MAX_BASIS_CHANGE = 5e-2  # change of a motion on another basis, beyond which it is another one
MAX_POINTS_BACK = 4  # points that are taken back at most where a larger basis does not have them
# cosine of the way on in another basis, below which it may as well be the way back
MIN_DIRECTION_COSINE = 0.5
# arc-length of the place that tells which way a curve goes on in another basis
DIRECTION_PROBE_LENGTH = 1e-2

Ended = Callable[[np.ndarray, PeriodicMotion], str]  # of unknowns and the motion; why it ends there


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
        """A basis that begins anew will hold this motion."""
        ...

    def compact(self, motion: PeriodicMotion) -> None:
        """A large basis begins anew."""
        ...

    def grow(self, motion: PeriodicMotion, change: PeriodicMotion) -> None:
        """A correction joins the basis."""
        ...


@dataclass
class Path:
    """A curve that is followed, and its direction.

    Attributes
    ----------
    projection : CurveBasis
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
            Events stand among them; on a projected model to a part of a step.
        end : str
            What `ended` said; ``basis`` where too many vectors would be needed; ``steps`` or
            ``not_converged``.

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
        equations = self.projection.equations(self.harmonics)
        u = equations.pack(start)
        equations.accepted(u)
        normal = np.zeros(len(u))
        normal[held_unknown] = 1.0
        u, *_ = newton(equations, u, normal, float(u[held_unknown]))
        curve = follow(
            equations,
            u,
            self._along(u),
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

    def _along(self, u: np.ndarray) -> np.ndarray:
        along = np.zeros(len(u))
        along[self.first[0]] = self.first[1]
        return along

    def _growing(self, motions: list[CurveMotion], held_unknown: int) -> str:
        """Why the curve on from the first motion ended; what is found on it is added."""
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
            if step is None:  # what the last motion has missing may be what its successor needs
                way = None if tries else self._grown(equations, current, motions[-1].motion)
                if way is None:
                    return LOST
                tries, h = tries + 1, steps.first
                equations, current = self._again(motions, *way)
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
                if way := self._grown(equations, current, motion, equations.forces(following.u)):
                    equations, current = self._again(motions, *way)
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
        """The last motion of the curve, from which it goes on.

        After others it is balanced on a basis of its own: one that has grown along the curve may
        have lost its way.
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
                begun = self._here(
                    motion, between(previous, motion, 1.0 + ROUGH_EVENT_TOLERANCE), previous
                )
            except ConvergenceError:
                motion = None
            if (
                motion is not None
                and self.projection.error(last, _change(last, motion)) < MAX_BASIS_CHANGE
            ):
                motions[-1] = CurveMotion(motion, residual, error)
                return begun
            del motions[plain[-2] + 1 :]
        raise ConvergenceError(LOST, "the curve was lost, and not found again")

    def _grown(
        self,
        equations: CycleEquations,
        current: CurvePoint,
        motion: PeriodicMotion,
        local: LocalForces | None = None,
    ) -> tuple[PeriodicMotion, PeriodicMotion] | None:
        """Extend the basis by what a motion lacks; None where it lacks nothing.

        The point where the curve is, and one ahead of it, of all coordinates.
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
        """The last point in the basis as it is now.

        One that the larger basis does not have was made by what the smaller one lacked: it is taken
        from the curve, which goes on from the one before it.
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
        """A motion of the curve, in the basis as it is, and the way on to the side of `ahead`.

        Which is not to be that to the side of `previous`, the motion before.
        """
        equations = self.projection.equations(self.harmonics)
        u = equations.pack(motion)
        equations.accepted(u)
        along = self._along(u)
        if ahead is not None:
            along = equations.pack(ahead) - u
            along /= np.linalg.norm(along)
        u, residual, _, bordered = newton(equations, u, along, None)
        tangent = bordered.towards(along)
        points_back = previous is not None and tangent @ (equations.pack(previous) - u) > 0.0
        if ahead is not None and (points_back or tangent @ along < MIN_DIRECTION_COSINE):
            raise ConvergenceError(LOST, "which way the curve goes on cannot be told")
        return equations, CurvePoint(u, tangent, residual)


def _change(before: PeriodicMotion, after: PeriodicMotion) -> PeriodicMotion:
    return PeriodicMotion(after.Q - before.Q, after.omega - before.omega)


def between(first: PeriodicMotion, second: PeriodicMotion, share: float) -> PeriodicMotion:
    """A motion on the way from one to another of as many harmonics, in phase with it."""
    omega = first.omega + share * (second.omega - first.omega)
    parameter = first.parameter + share * (second.parameter - first.parameter)
    return PeriodicMotion(first.Q + share * (second.Q - first.Q), omega, parameter)
