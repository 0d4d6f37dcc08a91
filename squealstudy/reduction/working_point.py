"""Steady sliding equilibrium: Newton in the gaps, for any pressure, friction and law.

A factor serves for as many steps as it brings nearer fast. Over a box of design points gaps are
polynomials of the box coordinates (pressure in its logarithm, where a gap of the exponential law is
nearly linear); a few simplified Newton steps with the Jacobian of the nearest anchor take them to
the tolerance (THEORY.md eq. (13), (14)).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from squealstudy.errors import ConvergenceError, ModelError
from squealstudy.laws import ContactLaw
from squealstudy.models.assembly import ContactPoints
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.contact_space import ContactSpace
from squealstudy.reduction.gap_equations import Changes, GapEquations, GapJacobian

MAX_ITERATIONS = 200
GIVEN_WAY = 0.125  # of the most that a softening spring bears: where Newton starts under more
MAX_STEP = 3.0  # closing, in gap scales of the law: beyond it, Newton on an exponential runs away
HIGHEST_START = 100.0  # pressure at the start, in mean pressures
TOLERANCE = 1e-11
AMPLIFIED = 10.0  # error of gaps over their imbalance: about 1 where K0 has a contact like theirs
POLISHED = 1e-10  # relative gap imbalance; studies promise 1e-8
MOST_STEPS = 25
NEARER = 0.2  # of an imbalance, after a step with an older Jacobian: more, and it is made anew
OPEN = 0.01  # of the mean pressure, below which a contact point is open
TRIED = (0.0, 0.5, 1.0)  # contact points by their pressure, at which laws from outside are tried
CONTRADICTORY_LAW = "contradictory_law"  # status of a point where such a law contradicts itself
Cardinals = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class WorkingPoint:
    """Contact state at steady sliding.

    Attributes
    ----------
    gap : ndarray (nc,)
        m, positive when open.
    contact_pressure : ndarray (nc,)
        Pa.
    tangent : ndarray (nc,)
        -dp/dg, Pa/m.
    iterations : int
        Newton iterations used.
    residual : float
        Largest imbalance of a gap, relative to the largest gap movement under the load.
    open_share : float
        Share of the area with pressure below 1 % of the mean; all of it where the whole contact
        carries less than 1 % of what the load presses on closed contact.
    tangent_error : float
        How far the imbalance of the gaps may have moved the contact stiffness, relative.
    """

    gap: np.ndarray
    contact_pressure: np.ndarray
    tangent: np.ndarray
    iterations: int
    residual: float
    open_share: float
    tangent_error: float = 0.0

    def forces(self, contact: ContactPoints, operating: OperatingPoint) -> np.ndarray:
        """Normal and friction forces (nc, 3) [N] of the contact points, along and across."""
        p, area = self.contact_pressure, contact.area
        drag = -area * contact.frictional * operating.traction(p, contact.speed_factor)
        return np.column_stack([area * p, drag, np.zeros_like(drag)])


def working_point(
    space: ContactSpace, point: OperatingPoint, start: np.ndarray | None = None
) -> WorkingPoint:
    """Solve g = g0 + N q(g) with q in static equilibrium under load, contact and friction.

    With K0 = K + k_c N^T A N the gaps obey

        g = g0 + H_Nf f + H_NN A (p + k_c (g - g0)) - mu H_NT A p,

    mu(p) being the friction of each point at its sliding speed.

    Parameters
    ----------
    space : ContactSpace
    point : OperatingPoint
    start : ndarray (nc,) or None
        Gaps to start from; without, the gap of a uniform pressure.

    Raises
    ------
    ConvergenceError
        ``working_point`` where Newton does not converge: no equilibrium (contact lost), or a
        friction beyond which the steady state does not exist.
    """
    law, A = point.law, space.area
    equations = GapEquations(space, [point])
    loaded = _mean_pressure(space, point)
    estimate = max(loaded, _closing_pressure(space, point))
    if start is None:
        g = np.full(len(A), law.gap_at(estimate))
    else:  # gaps of a softer law may mean absurd pressures in this one
        g = np.maximum(start, law.gap_at(HIGHEST_START * estimate))
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
        level = max(estimate, float(np.abs(A @ p) / A.sum()))
        damping = _damping(law, level, g, step)
        before = np.abs(F).max()
        g = g + damping * step
        (F,), (p,), (kappa,) = equations.imbalance(g[None])
        residual = float(equations.relative(F[None], g[None])[0])
        size = np.abs(step).max() / law.gap_scale(level)
        if damping == 1.0 and size < TOLERANCE**0.5 and residual < TOLERANCE:
            g = g - jacobian.solve(F)  # which an older Jacobian left larger than round-off
            (F,), (p,), (kappa,) = equations.imbalance(g[None])
            residual = float(equations.relative(F[None], g[None])[0])
            return working_point_result(A, g, p, kappa, iteration, residual, F, loaded)
        if damping < 1.0 or not np.abs(F).max() < NEARER * before:
            jacobian = None
    raise ConvergenceError(
        "working_point", no_sliding_text(float(point.friction), float(point.brake_pressure))
    )


def no_sliding_text(friction: float, pressure: float) -> str:
    """The failure of Newton at a friction and a brake pressure [Pa]."""
    return (
        f"no steady sliding equilibrium found at friction {friction:g}, pressure {pressure:g} Pa: "
        "does friction tip, lift or jam a part there, held too softly or too far from its contact?"
    )


def known_working_point(
    space: ContactSpace, point: OperatingPoint, gap: np.ndarray
) -> WorkingPoint | None:
    """The working point at gaps solved earlier, or None where they do not balance this point."""
    equations = GapEquations(space, [point])
    g = np.array(gap, dtype=float)
    (F,), (p,), (kappa,) = equations.imbalance(g[None])
    residual = float(equations.relative(F[None], g[None])[0])
    if not residual < TOLERANCE:
        return None
    loaded = _mean_pressure(space, point)
    return working_point_result(space.area, g, p, kappa, 0, residual, F, loaded)


def expect_consistent_laws(
    contact: ContactPoints, operating: OperatingPoint, point: WorkingPoint
) -> None:
    """Try laws from outside the package at a few contact points of a working point.

    Slopes may fit at the pressures and speeds where a law was tried before, and not at these.

    Raises
    ------
    ConvergenceError
        ``contradictory_law``, with file, function and law.
    """
    law, curve = operating.law, operating.curve
    if law.definition.in_package and curve.definition.in_package:
        return
    order = np.argsort(point.contact_pressure)
    places = order[[round(share * (len(order) - 1)) for share in TRIED]]
    try:
        if not law.definition.in_package:
            law.expect_consistent(point.gap[places].tolist())
        if not curve.definition.in_package:
            speeds = abs(operating.sliding_speed) * contact.speed_factor[places]
            for s, p in zip(speeds, point.contact_pressure[places], strict=True):
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
) -> WorkingPoint:
    """The contact state at solved gaps that are out of balance by F (nc,) [m].

    `loaded` is the mean pressure [Pa] that the load gives closed contact.
    """
    return WorkingPoint(
        gap=g,
        contact_pressure=p,
        tangent=kappa,
        iterations=iterations,
        residual=residual,
        open_share=open_share(area, p, loaded),
        tangent_error=_tangent_error(area, p, kappa, F),
    )


def _tangent_error(area: np.ndarray, p: np.ndarray, kappa: np.ndarray, F: np.ndarray) -> float:
    """Relative change of the contact stiffness by gaps that err by AMPLIFIED F.

    Over a gap of p/kappa the tangent changes by its own size (of an exponential law; of stiffer
    ones by less). Contact that has given way has a tangent of the other sign: its size counts.
    """
    pressed, size = np.abs(p) > 0, np.abs(kappa)
    weight = area[pressed] * size[pressed]
    with np.errstate(over="ignore"):  # next to no pressure: infinitely wrong
        moved = AMPLIFIED * np.abs(F[pressed]) * size[pressed] / np.abs(p[pressed])
        return float(weight @ moved / max(weight.sum(), 1e-300))


def open_share(area: np.ndarray, p: np.ndarray, loaded: float = 0.0) -> float:
    """Share of the contact area (nc,) whose pressure (nc,) is below 1 % of the mean.

    All of it where the mean itself is below 1 % of `loaded` [Pa], the pressure of closed contact.
    """
    mean = float(area @ p / area.sum())
    if abs(mean) < OPEN * loaded:
        return 1.0
    return float(area[p < OPEN * mean].sum() / area.sum())


def _mean_pressure(space: ContactSpace, point: OperatingPoint) -> float:
    """Scale of the contact pressure, Pa: the rigid balance of the load over all points."""
    gap = space.gaps(space.C_Nf @ np.array([point.brake_pressure, 1.0]))
    stiffness = np.abs(space.k_c * gap)
    return float(max(space.area @ stiffness / space.area.sum(), 1e-300))


def _closing_pressure(space: ContactSpace, point: OperatingPoint) -> float:
    """Uniform pressure that takes back the mean opening under the load and closed gaps, Pa.

    What stiff contact carries, and more than soft contact does. A spring that gives way under the
    whole load has next to no k_c, and `_mean_pressure` is nothing then: a share of what it bears,
    for Newton is to come from where it holds.
    """
    opened = space.gaps(space.C_Nf @ np.array([point.brake_pressure, 1.0]))
    opening = abs(float(space.area @ opened)) + float(space.area @ np.maximum(-space.gap0, 0.0))
    closing = opening / max(abs(space.opened_by_unit_pressure), 1e-300)
    if not 1e-300 < closing < np.inf:  # of nothing an exponential law has no gap
        return 0.0
    ((borne,), _) = point.law.evaluate(np.array([point.law.gap_at(closing)]))
    held = closing if borne > 0.99 * closing else GIVEN_WAY * float(borne)
    return held if np.isfinite(held) else 0.0


def _damping(law: ContactLaw, level: float, g: np.ndarray, step: np.ndarray) -> float:
    """Share of a Newton step to go, so that no point closes too far.

    Opening is harmless, and so is closing up to the gap of the pressure `level`: limiting those too
    takes a hundred iterations where a stiff contact opens widely.
    """
    closing = float((np.minimum(g, law.gap_at(level)) - g - step).max() / law.gap_scale(level))
    return min(1.0, MAX_STEP / closing) if closing > 0 else 1.0


@dataclass(frozen=True)
class NewtonAnchor:
    """A design point theta (d,) and the Jacobian of its gap equations."""

    theta: np.ndarray
    jacobian: GapJacobian


def anchor_at(
    theta: np.ndarray, space: ContactSpace, operating: OperatingPoint, point: WorkingPoint
) -> NewtonAnchor:
    """An anchor at a working point; `space` is that of its component changes."""
    jacobian = GapJacobian(space, operating, point.contact_pressure, point.tangent)
    return NewtonAnchor(theta, jacobian)


@dataclass(frozen=True)
class WorkingPointField:
    """Gaps of working points interpolated over a box of design points.

    Attributes
    ----------
    space : ContactSpace
        Without component changes.
    node_gaps : ndarray (q, nc)
    cardinals : callable
        theta (b, d) -> (b, q).
    anchors : tuple of NewtonAnchor
    """

    space: ContactSpace
    node_gaps: np.ndarray
    cardinals: Cardinals
    anchors: tuple[NewtonAnchor, ...]

    def gaps(self, theta: np.ndarray) -> np.ndarray:
        """Interpolated gaps (b, nc) at theta (b, d), not polished."""
        found: np.ndarray = self.cardinals(theta) @ self.node_gaps
        return found

    def solve(
        self,
        theta: np.ndarray,
        operating: Sequence[OperatingPoint],
        changes: Sequence[Changes],
    ) -> list[WorkingPoint | None]:
        """Polished working points at theta (b, d); None where the residual stays too large."""
        found: list[WorkingPoint | None] = [None] * len(theta)
        places = np.array([anchor.theta for anchor in self.anchors])
        nearest = ((theta[:, None] - places[None]) ** 2).sum(axis=2).argmin(axis=1)
        start = self.gaps(theta)
        for number in np.unique(nearest):
            rows = [int(i) for i in np.flatnonzero(nearest == number)]
            batch = GapEquations(
                self.space, [operating[i] for i in rows], [changes[i] for i in rows]
            )
            solved = _polish(batch, start[rows], self.anchors[number].jacobian)
            for i, point in zip(rows, solved, strict=True):
                found[i] = point
        return found


def _polish(
    equations: GapEquations, g: np.ndarray, jacobian: GapJacobian
) -> list[WorkingPoint | None]:
    """Simplified Newton from gaps g (b, nc)."""
    with np.errstate(over="ignore", invalid="ignore"):
        F, p, kappa = equations.imbalance(g)
        residual = equations.relative(F, g)
        steps = 0
        while steps < MOST_STEPS and (open_ := ~(residual < POLISHED)).any():
            steps += 1
            g = np.where(open_[:, None], g - jacobian.solve(F), g)
            F, p, kappa = equations.imbalance(g)
            residual = equations.relative(F, g)
    space = equations.space
    loaded = [_mean_pressure(space, point) for point in equations.operating]
    return [
        working_point_result(
            space.area, g[i], p[i], kappa[i], steps, float(residual[i]), F[i], loaded[i]
        )
        if residual[i] < POLISHED
        else None
        for i in range(len(g))
    ]
