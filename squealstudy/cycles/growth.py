"""Growth over amplitude of one mode family: the added damping that keeps each amplitude constant.

A model of many coordinates is followed on a basis that grows with the motion.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.continuation import Curve, Steps, follow, newton
from squealstudy.cycles.curve import CurveMotion, Path
from squealstudy.cycles.equations import CycleEquations, PeriodicMotion
from squealstudy.cycles.oscillator import WHOLE, Oscillator
from squealstudy.cycles.projection import SIZE, Projection
from squealstudy.linalg.dense_qep import dense_roots

ZERO = "C"  # event: a cycle, where no damping need be added
FAR, OTHER = "far", "other_resonance"  # why curves end
SHRUNK, STILL = "shrunk", "standstill"
SLOWEST = 0.05  # of the mode's frequency: below it motions are on their way to another equilibrium
BACK = 0.5  # of the size at which a curve began: where it comes back to that there is no more on it
MOST_OTHERS = 2.0  # norm of all harmonics over that of the first


def linear_modes(
    contact: ContactOscillator, highest: float = np.inf
) -> tuple[np.ndarray, np.ndarray]:
    """Roots (m,) with positive or no imaginary part [rad/s], and right vectors (n, m).

    All of a small model, up to `highest` [rad/s] of a large one.
    """
    osc = contact.oscillator
    zero = np.zeros((1, osc.n))
    C, K = osc.tangent(zero, zero)
    lam, psi = dense_roots(C[0], K[0], (0.0, np.inf if osc.n <= WHOLE else highest))
    order = [k for k in np.argsort(np.abs(lam), kind="stable") if lam[k].imag >= 0]
    return lam[order], psi[:, order]


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

    return equations, follow(equations, u, along, wanted, tests, ended, watched=-1)


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
        a part of the motion; ``shrunk`` where it came back to no amplitude, ``standstill`` to no
        frequency; ``basis`` where too many vectors would be needed; ``steps`` or ``not_converged``.

    Raises
    ------
    ConvergenceError
        Where the mode cannot be continued.
    """
    least = BACK * _first(start)

    def ended(u: np.ndarray, motion: PeriodicMotion) -> str:
        if np.linalg.norm(u[projection.small.n : -3]) > MOST_OTHERS:
            return OTHER
        if _first(motion) < least:
            return SHRUNK
        if motion.omega < SLOWEST * start.omega:
            return STILL
        return FAR if stop(motion) else ""

    tests = {ZERO: lambda u, _: float(u[-1])}
    path = Path(projection, start.harmonics, (SIZE, 1.0), ended, steps, tests, watched=-1)
    return path.from_motion(start)


def _first(motion: PeriodicMotion) -> float:
    """Norm of the first harmonic."""
    return float(np.linalg.norm(motion.Q[[1, motion.harmonics + 1]]))
