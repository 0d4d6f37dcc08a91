"""Steady sliding equilibrium: Newton in the gaps, for any pressure, friction and law.

A factorised Jacobian is used for as long as its steps converge fast (THEORY.md eq. (13), (14)).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import scipy.linalg as la

from squealstudy.errors import ConvergenceError, ModelError
from squealstudy.laws import ContactLaw
from squealstudy.laws.corners import balanced_at_a_corner
from squealstudy.laws.spring import NO_SPRINGS, at_a_corner, engaged, spring_error
from squealstudy.models.contact_points import ContactPoints
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.contact_space import ContactSpace
from squealstudy.reduction.gap_equations import GapEquations, GapJacobian

AtSteadySliding = TypeVar("AtSteadySliding")
MAX_ITERATIONS = 200
# start of Newton where a softening contact cannot bear the load: this share of the most it bears
GIVEN_WAY = 0.125
# largest closing in a step, in gap scales of the law: beyond it, Newton on an exponential runs away
MAX_STEP = 3.0
HIGHEST_START = 100.0  # highest pressure of the gaps that Newton starts from, in mean pressures
TOLERANCE = 1e-11  # relative imbalance of the gaps at which Newton ends
# estimated error of gaps over their imbalance; it is about 1 where k_c is near the contact tangents
AMPLIFIED = 10.0
# imbalance after a step over that before, above which the Jacobian is computed anew
MAX_IMBALANCE_SHARE_LEFT = 0.2
OPEN = 0.01  # a contact point with less pressure, over the mean, is open
# factors on the friction that are tried in turn where the model has no steady sliding
LESS_FRICTION = (0.5, 0.25, 0.125, 0.0)
# contact points at which laws from outside the package are tried: lowest, median, highest pressure
TRIED = (0.0, 0.5, 1.0)
CONTRADICTORY_LAW = "contradictory_law"  # status of a point where such a law contradicts itself
SPRING_AT_CORNER = (
    "a spring with a gap or of one side just touches in steady sliding, where its stiffness is all "
    "or nothing: expected a gap, or a load, that moves it from there"
)
CONTACT_AT_CORNER = (
    "a contact point just touches in steady sliding, where its law's stiffness jumps: expected a "
    "load, or a gap, that moves it from there"
)
PRESSES_OPEN = (
    "the softening contact gives way under the load: it is balanced beyond the gap at which its "
    "force turns round, where an open gap presses and a closed one pulls; expected less load, or "
    "contact that softens less (contact.cubic_stiffness nearer to 0)"
)


@dataclass(frozen=True)
class WorkingPoint:
    """Contact state at steady sliding.

    Attributes
    ----------
    gap : ndarray (nc,)
        Gaps, m, positive where open.
    contact_pressure : ndarray (nc,)
        Contact pressures, Pa.
    tangent : ndarray (nc,)
        Contact tangents -dp/dg, Pa/m.
    iterations : int
        Number of Newton iterations.
    residual : float
        Largest imbalance of a gap, over the largest gap movement under the load plus the largest
        gap.
    open_share : float
        Share of the area with a pressure below 1 % of the mean; 1 where the mean itself is below
        1 % of the pressure that the load would give closed contact.
    tangent_error : float
        Estimated relative error of the contact stiffness by the imbalance of the gaps.
    n_springs : int
        Number of springs; they are the last points (`ContactInterface.spring_points`).
    """

    gap: np.ndarray
    contact_pressure: np.ndarray
    tangent: np.ndarray
    iterations: int
    residual: float
    open_share: float
    tangent_error: float = 0.0
    n_springs: int = 0

    @property
    def touching(self) -> slice:
        """The points that are contact, not springs."""
        return slice(len(self.gap) - self.n_springs)

    def forces(self, contact: ContactPoints, operating: OperatingPoint) -> np.ndarray:
        """Forces (nc, 3) [N] of the contact points: normal, along T and along T_perp."""
        p, area = self.contact_pressure, contact.area
        point_factors = (contact.speed_factor, contact.own_friction)
        drag = -area * contact.frictional * operating.traction(p, *point_factors)
        return np.column_stack([area * p, drag, np.zeros_like(drag)])


def working_point(
    space: ContactSpace, point: OperatingPoint, start: np.ndarray | None = None
) -> WorkingPoint:
    """Solve g = g0 + N q(g) with q in static equilibrium under load, contact and friction.

    With K0 = K + k_c N^T A N the gaps obey

        g = g0 + H_Nf f + H_NN A (p + k_c (g - g0)) - mu H_NT A p,

    where H_NN = N K0^-1 N^T and so on, f are the loads, and mu(p) is the friction of each point at
    its sliding speed.

    Parameters
    ----------
    space : ContactSpace
    point : OperatingPoint
    start : ndarray (nc,) or None
        Gaps to start from, m; None for the gap of a uniform pressure.

    Raises
    ------
    ConvergenceError
        ``working_point`` where Newton does not converge, as contact is lost or friction is beyond
        its limit; where a spring or contact point just touches; where softening contact gave way.
    """
    law, A, touching = point.law, space.area, space.touching
    equations = GapEquations(space, [point])
    loaded = mean_pressure(space, point)
    estimate = max(loaded, _closing_pressure(space, point))
    if start is None:
        g = np.full(len(A), law.gap_at(estimate))
    else:  # gaps of a softer law may give absurd pressures in this one
        g = np.maximum(start, law.gap_at(HIGHEST_START * estimate))
    g[len(A) - len(space.spring_points) :] = _engaged_springs(space, point, start)
    (F,), (p,), (kappa,) = equations.imbalance(g[None])
    jacobian: GapJacobian | None = None
    for iteration in range(1, MAX_ITERATIONS + 1):
        try:
            jacobian = jacobian or GapJacobian(space, point, p, kappa)
        except la.LinAlgError:  # friction at its limit, or tangents that overflowed
            break
        step = jacobian.solve(-F)
        if not np.isfinite(step).all():
            break
        level = max(estimate, abs(float(A[touching] @ p[touching])) / float(A[touching].sum()))
        damping = _damping(law, level, g[touching], step[touching])
        before = np.abs(F).max()
        g = g + damping * step
        (F,), (p,), (kappa,) = equations.imbalance(g[None])
        residual = float(equations.relative(F[None], g[None])[0])
        size = np.abs(step[touching]).max() / law.gap_scale(level)
        if damping == 1.0 and size < TOLERANCE**0.5 and residual < TOLERANCE:
            g = g - jacobian.solve(F)  # an older Jacobian left F larger than round-off
            (F,), (p,), (kappa,) = equations.imbalance(g[None])
            residual = float(equations.relative(F[None], g[None])[0])
            state = working_point_result(
                A, g, p, kappa, iteration, residual, F, loaded, space.spring_points
            )
            return _checked(space, point, state)
        if damping < 1.0 or not np.abs(F).max() < MAX_IMBALANCE_SHARE_LEFT * before:
            jacobian = None
    pressure = float(point.brake_pressure) if space.C_Nf[:, 0].any() else None
    raise ConvergenceError("working_point", no_sliding_text(float(point.friction), pressure))


def no_sliding_text(friction: float, pressure: float | None) -> str:
    """Error message of Newton at a friction and brake pressure [Pa]; None where none acts."""
    pressed = "" if pressure is None else f", pressure {pressure:g} Pa"
    return (
        f"no steady sliding equilibrium found at friction {friction:g}{pressed}: "
        "does friction tip, lift or jam a part there, held too softly or too far from its contact?"
    )


def with_less_friction(
    find: Callable[[OperatingPoint], AtSteadySliding], operating: OperatingPoint
) -> AtSteadySliding:
    """Result of `find` at an operating point, or at less friction where that has none.

    Design points bring their own friction. The basis that they share must exist even where the
    model does not slide steadily at its own friction.

    Raises
    ------
    ConvergenceError
        The error at the operating point itself, where less friction does not help either.
    """
    try:
        return find(operating)
    except ConvergenceError:
        for share in LESS_FRICTION:
            try:
                return find(replace(operating, friction=share * operating.friction))
            except ConvergenceError:
                continue
        raise


def known_working_point(
    space: ContactSpace, point: OperatingPoint, gap: np.ndarray
) -> WorkingPoint | None:
    """The working point at earlier gaps (nc,) [m]; None where they do not balance this point."""
    equations = GapEquations(space, [point])
    g = np.array(gap, dtype=float)
    (F,), (p,), (kappa,) = equations.imbalance(g[None])
    residual = float(equations.relative(F[None], g[None])[0])
    if not residual < TOLERANCE:
        return None
    loaded = mean_pressure(space, point)
    state = working_point_result(
        space.area, g, p, kappa, 0, residual, F, loaded, space.spring_points
    )
    return _checked(space, point, state)


def expect_consistent_laws(
    contact: ContactPoints, operating: OperatingPoint, point: WorkingPoint
) -> None:
    """Try laws from outside the package at a few contact points of a working point.

    The slopes of a law may have been right where it was tried before, and be wrong at these
    pressures and speeds.

    Raises
    ------
    ConvergenceError
        ``contradictory_law``, with file, function and law.
    """
    law, curve = operating.law, operating.curve
    if law.definition.in_package and curve.definition.in_package:
        return
    order = np.argsort(point.contact_pressure[point.touching])
    chosen = order[[round(share * (len(order) - 1)) for share in TRIED]]
    try:
        if not law.definition.in_package:
            law.expect_consistent(point.gap[chosen].tolist())
        if not curve.definition.in_package:
            speeds = abs(operating.sliding_speed) * contact.speed_factor[chosen]
            for s, p in zip(speeds, point.contact_pressure[chosen], strict=True):
                curve.expect_consistent(operating.friction, float(s), [float(p)])
    except ModelError as error:
        raise ConvergenceError(CONTRADICTORY_LAW, str(error)) from error


def working_point_result(
    area: np.ndarray,
    g: np.ndarray,
    p: np.ndarray,
    kappa: np.ndarray,
    iterations: int,
    residual: float,
    F: np.ndarray,
    loaded: float = 0.0,
    springs: np.ndarray = NO_SPRINGS,
) -> WorkingPoint:
    """The contact state at gaps g (nc,) [m] whose remaining imbalance is F (nc,) [m].

    `loaded` is the mean pressure [Pa] that the load gives closed contact.
    """
    touching = slice(len(g) - len(springs))
    return WorkingPoint(
        gap=g,
        contact_pressure=p,
        tangent=kappa,
        iterations=iterations,
        residual=residual,
        open_share=open_share(area[touching], p[touching], loaded),
        tangent_error=_tangent_error(area, p, kappa, F, spring_error(g, F, springs)),
        n_springs=len(springs),
    )


def _tangent_error(
    area: np.ndarray, p: np.ndarray, kappa: np.ndarray, F: np.ndarray, of_springs: np.ndarray
) -> float:
    """Relative change of the contact stiffness where gaps err by AMPLIFIED F.

    A change of gap by p/kappa changes the tangent of an exponential law by its own size, and
    tangents of stiffer laws by less. Softening contact may have negative tangents: moduli count.
    `of_springs` (ns,) are changes of the springs' tangents by F [N/m].
    """
    pressed, size = np.abs(p) > 0, np.abs(kappa)
    total = max(float((area * size)[pressed].sum()), 1e-300)
    springs = len(of_springs)
    pressed[len(p) - springs :] = False
    weight = area[pressed] * size[pressed]
    with np.errstate(over="ignore"):  # next to no pressure: infinite error
        rel_change = AMPLIFIED * np.abs(F[pressed]) * size[pressed] / np.abs(p[pressed])
        return float((weight @ rel_change + AMPLIFIED * of_springs.sum()) / total)


def open_share(area: np.ndarray, p: np.ndarray, loaded: float = 0.0) -> float:
    """Share of the contact area (nc,) whose pressure (nc,) is below 1 % of the mean.

    1 where the mean itself is below 1 % of `loaded` [Pa], the pressure of closed contact.
    """
    mean = float(area @ p / area.sum())
    if abs(mean) < OPEN * loaded:
        return 1.0
    return float(area[p < OPEN * mean].sum() / area.sum())


def mean_pressure(space: ContactSpace, point: OperatingPoint) -> float:
    """Scale of the contact pressure, Pa: mean pressure of springs k_c in K0 under the loads."""
    gap = space.gaps(space.C_Nf @ np.array([point.brake_pressure, 1.0]))
    stiffness, touching = np.abs(space.k_c * gap), space.touching
    area = space.area[touching]
    return float(max(area @ stiffness[touching] / area.sum(), 1e-300))


def _engaged_springs(
    space: ContactSpace, point: OperatingPoint, start: np.ndarray | None
) -> np.ndarray:
    """Elongations of springs (ns,) [m] from which Newton starts, without `start` beyond their gaps.

    They start to the side to which the loads move them. Within its gap a spring has no stiffness,
    and a part that it should hold may be free.
    """
    first = len(space.area) - len(space.spring_points)
    if start is not None:
        return start[first:]
    opened = space.gap0 + space.gaps(space.C_Nf @ np.array([point.brake_pressure, 1.0]))
    return engaged(opened[first:], space.spring_points)


def _checked(space: ContactSpace, point: OperatingPoint, state: WorkingPoint) -> WorkingPoint:
    """The working point; ConvergenceError where it is at a corner or an open gap presses."""
    if (text := corner_text(space, point, state.gap)) is not None:
        raise ConvergenceError("working_point", text)
    touching = space.touching
    if presses_open(*(x[touching] for x in (state.gap, state.contact_pressure, state.tangent))):
        raise ConvergenceError("working_point", PRESSES_OPEN)
    return state


def corner_text(space: ContactSpace, point: OperatingPoint, gap: np.ndarray) -> str | None:
    """Error message of balanced gaps (nc,) [m] at which a tangent jumps; None where none does."""
    if len(space.spring_points) and at_a_corner(gap, space.spring_points):
        return SPRING_AT_CORNER
    size, touching = space.round_off_size(point.brake_pressure, gap), space.touching
    cornered = balanced_at_a_corner(
        lambda g: point.law.evaluate(g)[1], gap[touching], np.array(size), space.area[touching]
    )
    return CONTACT_AT_CORNER if cornered else None


def presses_open(gap: np.ndarray, pressure: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """Whether any of the points (.., nc) of a softening law is beyond a zero of its force: (..,).

    There an open gap presses, and a closed one pulls: a branch of the law that no contact has.
    """
    beyond: np.ndarray = ((tangent < 0.0) & (gap * pressure > 0.0)).any(axis=-1)
    return beyond


def _closing_pressure(space: ContactSpace, point: OperatingPoint) -> float:
    """Uniform pressure [Pa] that closes the gaps which the loads open on average, and gaps below 0.

    Stiff contact carries about this pressure, soft contact less. A softening contact that cannot
    bear the load has a k_c near 0, and so `mean_pressure` is near 0 too. Newton then starts at a
    share of the largest pressure that it bears, where it still holds.
    """
    opened = space.gaps(space.C_Nf @ np.array([point.brake_pressure, 1.0]))
    touching = space.touching
    area, preloaded = space.area[touching], np.maximum(-space.gap0[touching], 0.0)
    opening = abs(float(area @ opened[touching])) + float(area @ preloaded)
    closing = opening / max(abs(space.opened_by_unit_pressure), 1e-300)
    if not 1e-300 < closing < np.inf:  # an exponential law has no gap at pressure 0
        return 0.0
    ((borne,), _) = point.law.evaluate(np.array([point.law.gap_at(closing)]))
    pressure = closing if borne > 0.99 * closing else GIVEN_WAY * float(borne)
    return pressure if np.isfinite(pressure) else 0.0


def _damping(law: ContactLaw, level: float, g: np.ndarray, step: np.ndarray) -> float:
    """Share of a Newton step to take so that no point closes too far.

    Opening is not limited, nor closing down to the gap of the pressure `level` [Pa]: limits there
    would cost a hundred iterations where a stiff contact opens widely.
    """
    closing = float((np.minimum(g, law.gap_at(level)) - g - step).max() / law.gap_scale(level))
    return min(1.0, MAX_STEP / closing) if closing > 0 else 1.0
