"""Curves of solutions of F(u) = 0, m equations of m + 1 unknowns, by pseudo-arc-length.

A step predicts along the tangent and corrects by Newton on the plane normal to it; it is halved
where that does not converge and grows where it converges fast (Keller 1977).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Any, Protocol

import numpy as np
from scipy.linalg import get_lapack_funcs
from scipy.optimize import brentq

from squealstudy.errors import ConvergenceError

TOLERANCE = 1e-9  # bound of the scaled residual and of the square of the last Newton step
MAX_NEWTON_STEPS = 20
# Newton's method fails if so many steps have not reduced the residual to this share
STALL_STEPS, STALL_RATIO = 5, 0.5
MAX_NEWTON_STEP_LENGTH = 10.0  # longer Newton steps are useless: unknowns are scaled to one
MIN_NEWTON_SHARE = 0.1  # a line search ends at this share of a Newton step
# a rough Jacobian is used again after a step that reduced the residual to less than this share
JACOBIAN_REUSE_RATIO = 0.1
MIN_DECREASE_SHARE = 0.1  # share s of a Newton step has to reduce the residual by 0.1 s (Armijo)
GROW_NEWTON_STEPS, SHRINK_NEWTON_STEPS = 2, 5  # Newton steps at which the arc-length grows, shrinks
MIN_TANGENT_COSINE = 0.9  # a step was too long if the cosine between tangents is smaller
MAX_TURN_RAD = 0.3  # rad: angle that the next step may turn by if the curve goes on to bend
FAR_OFF = 0.4  # correction over the step: a longer one may have met another curve
# steps of at most this arc-length may turn by more, as friction that reverses bends curves sharply
CORNER_ARC_LENGTH = 0.03
EVENT_REL_TOLERANCE = 1e-10  # error of an event over the step in which it is
MAX_JUMP_ARC_LENGTH = 1e-3  # a choice: an event in a jump is put at an end of no longer step
# an unknown may fall between two points, as a cubic, to this share of its smaller end
MIN_DIP_SHARE = 0.5
DIP_TEST_MIN_ARC_LENGTH = 0.02  # where it falls further, steps are halved down to this length


class Equations(Protocol):
    """Equations that a curve solves, and their tolerance.

    Where they are `rough` a Jacobian is used again after a Newton step that has reduced the
    residual to less than `JACOBIAN_REUSE_RATIO` of what it was.
    """

    tolerance: float
    rough: bool

    def residual(self, u: np.ndarray) -> np.ndarray:
        """F (m,) at u (m + 1,)."""
        ...

    def jacobian(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """F (m,) and dF/du (m, m + 1)."""
        ...

    def accepted(self, u: np.ndarray) -> None:
        """Note a solution of the curve; called for every one."""
        ...


Test = Callable[[np.ndarray, np.ndarray], float]  # (solution, tangent there) -> number, 0 at events


@dataclass(frozen=True)
class CurvePoint:
    """A solution on a curve.

    Attributes
    ----------
    u, tangent : ndarray (m + 1,)
        The solution, and the unit tangent of the curve there.
    residual : float
        Largest magnitude in F(u).
    events : tuple of str
        Names of the tests that are zero here; empty for a plain point.
    """

    u: np.ndarray
    tangent: np.ndarray
    residual: float
    events: tuple[str, ...] = ()


@dataclass
class Curve:
    """The solutions of a run along a curve, and why it ended.

    Attributes
    ----------
    points : list of CurvePoint
        In order; events stand among them, where they were located.
    end : str
        The reason that the caller's `stop` gave, ``steps`` (after as many as allowed), or
        ``not_converged``.
    """

    points: list[CurvePoint] = field(default_factory=list)
    end: str = "steps"

    def at(self, event: str) -> list[CurvePoint]:
        """The points of an event."""
        return [point for point in self.points if event in point.events]


@dataclass(frozen=True)
class Steps:
    """The first, least and largest arc-length of a step, and the number of steps."""

    first: float = 0.1
    least: float = 1e-5
    largest: float = 0.5
    count: int = 400


@cache
def _lapack(precision: str) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """LAPACK's routines that factorise and solve in a precision; looking them up takes time."""
    factorise, solve = get_lapack_funcs(("getrf", "getrs"), dtype=np.dtype(precision))
    return factorise, solve


class Bordered:
    """A Jacobian J (m, m + 1) with a row below it, factorised once and only if it is needed.

    It is factorised in the precision of J: rough equations have derivatives in single precision.
    """

    def __init__(self, J: np.ndarray, normal: np.ndarray) -> None:
        self._J, self._normal = J, normal

    @cached_property
    def _factors(self) -> tuple[np.ndarray, np.ndarray]:
        A = np.empty((len(self._normal),) * 2, self._J.dtype, order="F")
        A[:-1], A[-1] = self._J, self._normal
        lu, rows, lapack_status = _lapack(A.dtype.char)[0](A, overwrite_a=True)
        if lapack_status:
            raise ConvergenceError("singular_jacobian", "the balance is singular")
        return lu, rows

    def solve(self, F: np.ndarray, plane: float) -> np.ndarray:
        """Solve J x = F and normal . x = plane for x (m + 1,); ConvergenceError if singular."""
        lu, rows = self._factors
        b = np.append(F, plane).astype(lu.dtype)
        x, _ = _lapack(lu.dtype.char)[1](lu, rows, b)
        return np.asarray(x, float)

    @cached_property
    def tangent(self) -> np.ndarray:
        """Unit tangent t (m + 1,) of the curve, J t = 0, on the side of the normal."""
        t = self.solve(np.zeros(len(self._J)), 1.0)
        unit: np.ndarray = t / np.linalg.norm(t)
        return unit

    def towards(self, along: np.ndarray) -> np.ndarray:
        """The tangent, with the sign that has it point to the side of `along`."""
        return self.tangent if self.tangent @ along >= 0.0 else -self.tangent


def newton(
    equations: Equations, u: np.ndarray, normal: np.ndarray, offset: float | None = 0.0
) -> tuple[np.ndarray, float, int, Bordered]:
    """Solve the equations on the plane normal . u = offset, from `u` on.

    Without an offset the plane turns with the curve: steps are the shortest that solve the
    linearised equations (Moore & Penrose), and find the curve where the first plane misses it.

    Returns the solution (m + 1,), its residual, the number of Jacobians computed and the last of
    these, for rough equations of a point nearby. Raises ConvergenceError.
    """
    left_over, tolerance = np.inf, equations.tolerance
    before = [np.inf] * STALL_STEPS
    count, stale = 0, False
    for step in range(MAX_NEWTON_STEPS + 1):
        if stale:
            F = equations.residual(u)
        else:
            F, J = equations.jacobian(u)
            bordered = Bordered(J, normal)
        residual = float(np.abs(F).max())
        if not np.isfinite(residual) or not (stale or np.isfinite(J).all()):
            raise ConvergenceError("not_finite", "the forces of a periodic motion are not finite")
        if residual < tolerance and left_over < tolerance:
            return u, residual, count, bordered
        if residual > max(STALL_RATIO * before[step], tolerance):
            break
        before.append(residual)
        plane = 0.0 if offset is None else float(normal @ u - offset)
        change = bordered.solve(F, plane)
        if offset is None:
            normal = bordered.tangent
            change = change - (normal @ change) * normal
        last = float(np.abs(change).max())
        if not last <= MAX_NEWTON_STEP_LENGTH:
            break
        u, share = _searched(equations, u, change, F, plane)
        count += not stale
        left_over = last * (share if stale else last)
        stale = equations.rough and share < JACOBIAN_REUSE_RATIO
    raise ConvergenceError(
        "not_converged", f"the balance did not converge: {residual:.1e} after {step} Newton steps"
    )


def _searched(
    equations: Equations,
    u: np.ndarray,
    change: np.ndarray,
    F: np.ndarray,
    plane: float,
) -> tuple[np.ndarray, float]:
    """The unknowns after a Newton step, halved until it reduces the residual; the share of it left.

    Where contact points switch between sticking and sliding full steps can go round in circles.
    """
    before = float(np.hypot(np.linalg.norm(F), plane))
    share = 1.0
    while share > MIN_NEWTON_SHARE:
        trial: np.ndarray = u - share * change
        residual_norm = float(
            np.hypot(np.linalg.norm(equations.residual(trial)), (1.0 - share) * plane)
        )
        if (
            before < equations.tolerance
            or residual_norm < (1.0 - MIN_DECREASE_SHARE * share) * before
        ):
            break
        share *= 0.5
    return trial, residual_norm / before if before else 0.0


def follow(
    equations: Equations,
    u: np.ndarray,
    along: np.ndarray,
    steps: Steps,
    tests: Mapping[str, Test],
    stop: Callable[[np.ndarray], str],
    located: float = EVENT_REL_TOLERANCE,
    watched: int | None = None,
) -> Curve:
    """Follow the curve through a solution near `u`, to the side of `along` (m + 1,).

    Every change of sign of a test is located on the curve, to `located` times the step, and is a
    point of it. The curve ends at the first point for which `stop` returns a reason. A step must
    not pass over two zeros of the unknown with index `watched`: where the cubic through its ends
    and slopes falls below `MIN_DIP_SHARE` of the smaller end, the step is halved, down to
    `DIP_TEST_MIN_ARC_LENGTH`.

    Raises
    ------
    ConvergenceError
        Where there is no solution near `u`.
    """
    along = along / np.linalg.norm(along)
    u, residual, _, last = newton(equations, u, along, float(along @ u))
    equations.accepted(u)
    current = CurvePoint(u, last.tangent, residual)
    curve, h = Curve([current]), steps.first
    for _ in range(steps.count):
        next_found = next_point(equations, current, h, steps.least, tests, located, watched)
        if next_found is None:
            curve.end = "not_converged"
            return curve
        following, events, taken, iterations = next_found
        curve.points += [*events, following]
        equations.accepted(following.u)
        if reason := stop(following.u):
            curve.end = reason
            return curve
        h = grown(taken, iterations, steps, float(current.tangent @ following.tangent))
        current = following
    return curve


def grown(taken: float, iterations: int, steps: Steps, turn: float) -> float:
    """Arc-length of the next step.

    `taken` is that of the last one, which took so many Newton `iterations`; `turn` is the cosine
    between the tangents at its ends.
    """
    is_slow = iterations >= SHRINK_NEWTON_STEPS
    factor = 1.5 if iterations <= GROW_NEWTON_STEPS else 0.6 if is_slow else 1.0
    bent = float(np.arccos(np.clip(turn, -1.0, 1.0)))
    if bent > MAX_TURN_RAD / factor:
        factor = max(MAX_TURN_RAD / bent, 0.5)
    return min(taken * factor, steps.largest)


def next_point(
    equations: Equations,
    current: CurvePoint,
    h: float,
    min_step: float,
    tests: Mapping[str, Test],
    located: float = EVENT_REL_TOLERANCE,
    watched: int | None = None,
) -> tuple[CurvePoint, list[CurvePoint], float, int] | None:
    """The next point, the events before it, the arc-length and Newton steps; None if none is found.

    A step is halved where it may end on another curve: where the tangent turns, the correction is
    long, or a test changes its sign without a zero between.
    """
    while h >= min_step:
        try:
            following, iterations = _corrected(equations, current, h)
            distance_from_tangent = float(
                np.linalg.norm(following.u - current.u - h * current.tangent)
            )
            smooth = (
                following.tangent @ current.tangent >= MIN_TANGENT_COSINE
                and distance_from_tangent <= FAR_OFF * h
            )
            no_dip = (
                watched is None
                or h <= DIP_TEST_MIN_ARC_LENGTH
                or not _dips(current, following, watched, h)
            )
            if (smooth and no_dip) or (
                h <= CORNER_ARC_LENGTH and distance_from_tangent <= h and no_dip
            ):
                return (
                    following,
                    _events(equations, current, following, h, tests, located),
                    h,
                    iterations,
                )
        except ConvergenceError:
            pass
        h *= 0.5
    return None


def _dips(current: CurvePoint, following: CurvePoint, k: int, h: float) -> bool:
    """Whether unknown `k` may have two zeros more between two points than its signs there show."""
    y0, y1 = float(current.u[k]), float(following.u[k])
    s = np.linspace(0.0, 1.0, 17)
    slopes = h * float(current.tangent[k]), h * float(following.tangent[k])
    cubic = y0 * (1 - s) ** 2 * (1 + 2 * s) + y1 * s**2 * (3 - 2 * s)
    cubic += slopes[0] * s * (1 - s) ** 2 - slopes[1] * s**2 * (1 - s)
    if y0 * y1 > 0.0:
        return bool((cubic * np.sign(y0)).min() < MIN_DIP_SHARE * min(abs(y0), abs(y1)))
    return int((cubic[1:] * cubic[:-1] < 0.0).sum()) > 1


def _corrected(
    equations: Equations, current: CurvePoint, h: float, start: np.ndarray | None = None
) -> tuple[CurvePoint, int]:
    predicted = current.u + h * current.tangent if start is None else start
    offset = float(current.tangent @ predicted)
    u, residual, iterations, bordered = newton(equations, predicted, current.tangent, offset)
    return CurvePoint(u, bordered.tangent, residual), iterations


def _events(
    equations: Equations,
    current: CurvePoint,
    following: CurvePoint,
    h: float,
    tests: Mapping[str, Test],
    located: float,
) -> list[CurvePoint]:
    """Zeros of the tests between two points, in the order in which they are met.

    Raises ConvergenceError where one cannot be located.
    """
    event_points: list[tuple[float, CurvePoint]] = []
    solutions = {0.0: current, h: following}  # by arc length from `current`

    def at(s: float) -> CurvePoint:
        if s not in solutions:
            low, high = max(x for x in solutions if x < s), min(x for x in solutions if x > s)
            share = (s - low) / (high - low)
            start = solutions[low].u + share * (solutions[high].u - solutions[low].u)
            solutions[s] = _corrected(equations, current, s, start)[0]
        return solutions[s]

    for name, test in tests.items():
        before, after = test(current.u, current.tangent), test(following.u, following.tangent)
        if not before * after < 0:
            continue

        def test_at(s: float, test: Test = test) -> float:
            return test(at(s).u, at(s).tangent)

        try:
            s = float(brentq(test_at, 0.0, h, xtol=located * h, rtol=1e-12))
        except ValueError:  # the end of the step is on another curve than the way there
            raise ConvergenceError("not_converged", "a change of sign without a zero") from None
        except ConvergenceError:  # the balance jumps where a kink of a force passes a node of time
            if h > MAX_JUMP_ARC_LENGTH:
                raise
            s = min((0.0, h), key=lambda x: abs(test_at(x)))
        event_points.append((s, replace(at(s), events=(name,))))
    return [point for _, point in sorted(event_points, key=lambda item: item[0])]
