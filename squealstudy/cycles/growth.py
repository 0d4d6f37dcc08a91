"""Growth over amplitude of one mode family, on a basis that grows with the motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from squealstudy.cycles.branch import FAR, MOST_OTHERS, OTHER, ZERO
from squealstudy.cycles.continuation import LOCATED, Curve, Steps, follow
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.projection import SIZE, Projection
from squealstudy.errors import ConvergenceError

BASIS = "basis"  # the basis errs by too much: the curve goes on with a larger one
WORST, TARGET, FINE = 3e-2, 3e-3, 3e-4  # error of the basis: on the curve, after it has grown
SHARES = (1.0, 0.4, 0.15, 0.05)  # of a step at whose end the basis does not hold
ROUGHLY = 1e-3  # of a step: where a zero is, if it is corrected anyhow


@dataclass(frozen=True, eq=False)
class CurveMotion:
    """A motion on the curve.

    Attributes
    ----------
    motion : PeriodicMotion
        Of all coordinates.
    residual : float
        Of the balance in the basis.
    error : float
        Of the basis, relative in elastic energy, by the blocks of the harmonics.
    event : str
        C at a zero of added damping.
    """

    motion: PeriodicMotion
    residual: float
    error: float
    event: str = ""


def family_curve(
    projection: Projection,
    start: PeriodicMotion,
    stop: Callable[[PeriodicMotion], bool],
    steps: Steps,
) -> tuple[list[CurveMotion], str]:
    """Added damping over amplitude from a small motion along a complex mode on.

    Returns
    -------
    motions : list of CurveMotion
        Zeros (event C) stand among them; on a projected model to a part of a step.
    end : str
        ``far`` where `stop` said so; ``other_resonance`` where the first harmonic is no more than
        a part of the motion; ``basis`` where too many vectors would be needed; ``steps`` or
        ``not_converged``.

    Raises
    ------
    ConvergenceError
        Where the mode cannot be continued.
    """
    run = _Run(projection, stop, steps, start.harmonics)
    motion, error, residual = projection.improve(start, TARGET, SIZE)
    run.found.append(CurveMotion(motion, residual, error))
    ahead: PeriodicMotion | None = None
    while len(run.found) < steps.count:
        curve, there = run.stretch(ahead)
        if curve.end == BASIS and there is not None:
            ahead = _ahead(projection, run.found[-1].motion, there)
            if ahead is None:
                return run.found, BASIS
        elif curve.end == "not_converged" and not projection.complete:
            before, last = projection.size, run.found[-1]
            try:
                projection.improve(last.motion, FINE, SIZE)
            except ConvergenceError:
                return run.found, curve.end
            if projection.size == before:
                return run.found, curve.end
            ahead = None
        else:
            return run.found, curve.end
    return run.found, "steps"


def _ahead(
    projection: Projection, last: PeriodicMotion, there: PeriodicMotion
) -> PeriodicMotion | None:
    """A motion between two, as far as can be, on a basis that has grown to hold it."""
    projection.remember(last)
    for share in SHARES:
        Q = last.Q + share * (there.Q - last.Q)
        omega, mu = (
            a + share * (b - a) for a, b in ((last.omega, there.omega), (last.mu, there.mu))
        )
        try:
            return projection.improve(PeriodicMotion(Q, omega, mu), TARGET, SIZE)[0]
        except ConvergenceError:
            continue
    return None


class _Run:
    def __init__(
        self,
        projection: Projection,
        stop: Callable[[PeriodicMotion], bool],
        steps: Steps,
        harmonics: int,
    ) -> None:
        self.projection, self.stop, self.steps = projection, stop, steps
        self.harmonics, self.found = harmonics, []  # type: tuple[int, list[CurveMotion]]

    def stretch(self, ahead: PeriodicMotion | None) -> tuple[Curve, PeriodicMotion | None]:
        """The curve on from the last motion, as far as the basis holds, towards `ahead`.

        And the motion at which the basis no longer holds, which does not join what is found.
        """
        projection = self.projection
        equations = projection.equations(self.harmonics)
        n = projection.small.n
        u = equations.pack(projection.lowered(self.found[-1].motion))
        equations.accepted(u)
        along = np.zeros(len(u))
        along[-2] = 1.0
        if ahead is None and len(self.found) > 1:  # as it came
            before = equations.pack(projection.lowered(self.found[-2].motion))
            along[-3:] = (u - before)[-3:]
        elif ahead is not None:
            along[-3:] = (equations.pack(projection.lowered(ahead)) - u)[-3:]
        errors: list[float] = [self.found[-1].error]

        def ended(u: np.ndarray) -> str:
            motion = projection.lifted(equations.motion(u))
            error = projection.error(motion, projection.correction(motion))
            if error > WORST:
                return BASIS
            errors.append(error)
            if np.linalg.norm(u[n:-3]) > MOST_OTHERS:
                return OTHER
            return FAR if self.stop(motion) else ""

        located = LOCATED if projection.complete else ROUGHLY
        tests = {ZERO: lambda u, _: float(u[-1])}
        curve = follow(equations, u, along, self.steps, tests, ended, located)
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
            self.found.append(CurveMotion(motion, point.residual, error, "".join(point.events)))
        return curve, there
