"""Curves of cycles: along added damping at one design, along a parameter through folds.

Events carry the names of bifurcation tools: H, the cycle shrinks to steady sliding (Hopf); F, the
parameter turns back (fold); NS, PD, a pair of multipliers or one at -1 leaves the unit circle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.cycles.continuation import Curve, CurvePoint, Steps, follow, newton
from squealstudy.cycles.equations import BranchEquations, CycleEquations, PeriodicMotion
from squealstudy.cycles.floquet import Floquet, floquet
from squealstudy.cycles.oscillator import Oscillator

HOPF, ZERO, TURN, NS, PD = "H", "C", "F", "NS", "PD"  # C: a cycle, on a curve of added damping
FAR, OTHER, RANGE, SHRUNK = "far", "other_resonance", "range", "hopf"  # why curves end
MOST_OTHERS = 2.0  # norm of all harmonics over that of the first


@dataclass(frozen=True)
class BranchPoint:
    """A cycle on a branch.

    Attributes
    ----------
    motion : PeriodicMotion
        Its `mu` is the value of the parameter.
    multipliers : Floquet
    residual : float
    event : str
        H, F, NS, PD or nothing.
    """

    motion: PeriodicMotion
    multipliers: Floquet
    residual: float
    event: str = ""


def linear_motion(phi: np.ndarray, lam: complex, scale: np.ndarray, size: float) -> PeriodicMotion:
    """The motion along a complex mode phi (n,) at a size a, with the damping that it needs."""
    phi = phi * size / np.linalg.norm(phi * scale)
    Q = np.vstack([np.zeros(len(phi)), phi.real, -phi.imag])
    return PeriodicMotion(Q, abs(lam.imag), 2.0 * lam.real)


def growth_curve(
    osc: Oscillator,
    lam: complex,
    phi: np.ndarray,
    size: float,
    harmonics: int,
    stop: Callable[[PeriodicMotion], bool],
    steps: Steps | None = None,
) -> tuple[CycleEquations, Curve]:
    """Added damping over amplitude, from a complex mode on; its zeros (event C) are cycles.

    Parameters
    ----------
    osc : Oscillator
    lam : complex
        Root of the linearised equation [rad/s], oscillating.
    phi : ndarray (n,) complex
        Its right vector.
    size : float
        a, at which the curve begins.
    harmonics : int
    stop : callable
        Whether a motion is far enough.

    Returns
    -------
    equations : CycleEquations
    curve : Curve
        Its end is ``far`` where `stop` said so, ``other`` where the first harmonic is no more than
        a part of the motion: another resonance took over.

    Raises
    ------
    ConvergenceError
        Where the mode cannot be continued.
    """
    equations = CycleEquations(osc, harmonics, abs(lam.imag))
    u = equations.pack(linear_motion(phi, lam, equations.scale, size))
    equations.accepted(u)
    along = np.zeros(len(u))
    along[-2] = 1.0
    tests = {ZERO: lambda u, _: float(u[-1])}
    wanted = steps or Steps()

    def ended(u: np.ndarray) -> str:
        if np.linalg.norm(u[osc.n : -3]) > MOST_OTHERS:
            return OTHER
        return FAR if stop(equations.motion(u)) else ""

    return equations, follow(equations, u, along, wanted, tests, ended)


def refined(equations: CycleEquations, motion: PeriodicMotion) -> tuple[PeriodicMotion, float]:
    """The cycle near a motion at its own mu, and the residual.

    Raises
    ------
    ConvergenceError
        Where there is none.
    """
    u = equations.pack(motion)
    equations.accepted(u)
    normal = np.zeros(len(u))
    normal[-1] = 1.0
    u, residual, _, _ = newton(equations, u, normal, float(u[-1]))
    return equations.motion(u), residual


def branch(
    oscillators: Callable[[float], Oscillator],
    start: PeriodicMotion,
    bounds: tuple[float, float],
    direction: float,
    least: float,
    steps: Steps | None = None,
) -> tuple[list[BranchPoint], str]:
    """Cycles along a parameter, from one of them on, to the end of the range or to a Hopf point.

    Parameters
    ----------
    oscillators : callable
        Oscillator of a value of the parameter.
    start : PeriodicMotion
        Its `mu` is the value.
    bounds : (low, high)
        Range of the parameter.
    direction : float
        1 towards higher values first, -1 towards lower ones.
    least : float
        Size a below which the cycle has shrunk to steady sliding.

    Returns
    -------
    points : list of BranchPoint
    end : str
        ``range``, ``hopf`` (it has shrunk to steady sliding), ``steps`` or ``not_converged``.

    Raises
    ------
    ConvergenceError
        Where there is no cycle near the start.
    """
    equations = BranchEquations(oscillators, start.harmonics, start.omega, bounds)
    u = equations.pack(start)
    equations.accepted(u)
    along = np.zeros(len(u))
    along[-1] = direction

    def ended(u: np.ndarray) -> str:
        if not 0.0 <= u[-1] <= 1.0:
            return RANGE
        return SHRUNK if u[-2] < np.log(least) else ""

    curve = follow(equations, u, along, steps or Steps(), {TURN: lambda _, t: float(t[-1])}, ended)
    points = [_judged(equations, point) for point in curve.points]
    if curve.end == SHRUNK:
        points[-1] = replace(points[-1], event=HOPF)
    return points, curve.end


def _judged(equations: CycleEquations, point: CurvePoint) -> BranchPoint:
    motion = equations.motion(point.u)
    multipliers = floquet(equations.oscillator(point.u), motion)
    return BranchPoint(motion, multipliers, point.residual, "".join(point.events))
