"""Case that maps how accurate the windows rung is close to an exceptional point (lock-in).

Hulten's mass has the friction mu_c (1 - d) or mu_c (1 + d); at mu_c two roots coalesce. A patch
interpolates both roots as one block of a matrix, which is smooth at mu_c although the roots are
not. The condition of the roots, however, diverges. The squared frequencies are near a and differ by
2 b sqrt(2 d). Round-off eps of the matrices changes them by a eps / sqrt(2 d), and at mu_c itself
by a sqrt(eps):

    |d lam| / |lam| = eps / (2 sqrt(2 d)),  sqrt(eps) / 2 at most.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from functools import lru_cache

import numpy as np

from squealstudy.errors import ConvergenceError
from squealstudy.laboratory.method_stability.coalescence import (
    OMEGA_1,
    OMEGA_2,
    SmallProblem,
    distance,
    flutter_matrices,
)
from squealstudy.laboratory.method_stability.contract import (
    CONVERGED,
    RECOVERED,
    WRONG,
    CaseResult,
    Knob,
    StabilityCase,
    failed,
)
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.sweep_basis import SweepBasis, build_sweep_basis
from squealstudy.modes.rungs.windows import RUNG, Windows
from squealstudy.system.parametric import Weights

CRITICAL_FRICTION = (OMEGA_1**2 - OMEGA_2**2) / (2 * OMEGA_1 * OMEGA_2)
BAND = (1.0, 1e4)  # rad/s
BOX_SHARE = 0.9  # half-width of the box over the distance to mu_c
N_NEIGHBOUR_POINTS = 40  # design points beside the two that are judged, so that patches pay
ROUND_OFFS = 4.0  # round-offs in a root: of the matrices, the basis and the small eigenproblem
# largest error over its estimate (THEORY.md eq. (39)) that is accepted, and over the tolerance
ESTIMATE_SAFETY_FACTOR = 2.0
BASIS_SHARE = 3.0  # tolerance over the tolerance of the basis, as in studies

KNOBS = (
    Knob("distance", "of friction to coalescence, relative to mu_c", 1e-3, low=1e-16, high=0.5),
    Knob("tolerance", "relative error of a root that is allowed", 1e-6, low=1e-13, high=0.1),
    Knob("damping_ratio", "of both modes at their mean frequency", 0.0, low=0.0, high=0.04),
)


def measure(knobs: Mapping[str, float]) -> CaseResult:
    """Solve both design points by windows at one setting of the knobs.

    `measured` is the largest error estimate over the tolerance, `error` the largest relative error
    of a root. The outcome is `recovered` if windows left a design point to another rung.
    """
    tolerance, away = knobs["tolerance"], knobs["distance"]
    problem, basis = problem_and_basis(knobs["damping_ratio"], tolerance)
    theta = np.concatenate([[-away, away], np.linspace(-BOX_SHARE, BOX_SHARE, N_NEIGHBOUR_POINTS)])[
        :, None
    ]
    outcomes = Windows(problem, basis, tolerance).solve(
        Box(-np.ones(1), np.ones(1)), theta / BOX_SHARE
    )
    both = {row: outcome for row, outcome in outcomes if row < 2}
    solved = {row: point for row, point in both.items() if not isinstance(point, ConvergenceError)}
    predicted = predict(away) / (ESTIMATE_SAFETY_FACTOR * tolerance)
    if len(solved) < len(both):
        return failed("working point", predicted=predicted, cost=len(theta))
    error = max(
        distance(point.lam, problem.exact_roots(theta[i] / BOX_SHARE))
        for i, point in solved.items()
    )
    estimate = max(
        float((point.error / np.abs(point.lam)).max(initial=0.0)) for point in solved.values()
    )
    rungs = sorted({point.method for point in solved.values()} - {RUNG.name})
    flagged = not (estimate <= tolerance and all(point.complete for point in solved.values()))
    outcome = (
        WRONG if error > ESTIMATE_SAFETY_FACTOR * tolerance else RECOVERED if rungs else CONVERGED
    )
    explanation = ", ".join(rungs) if rungs else f"estimate {estimate:.1e}" if flagged else ""
    return CaseResult(
        outcome=outcome,
        predicted=predicted,
        measured=estimate / tolerance,
        error=error,
        cost=len(theta),
        by=explanation,
        flagged=flagged,
    )


class FrictionProblem(SmallProblem):
    """Hulten's mass over friction about mu_c; the box is theta in [-1, 1]."""

    def __init__(self, damping_ratio: float) -> None:
        super().__init__(*flutter_matrices(damping_ratio), BAND)

    def weights(self, theta: np.ndarray) -> Weights:
        """Weights of mass, damping, springs and coupling: 1, 1, 1 and the friction coefficient."""
        return super().weights(CRITICAL_FRICTION * (1.0 + BOX_SHARE * np.asarray(theta)))

    def exact_roots(self, theta: np.ndarray) -> np.ndarray:
        """The two roots of imaginary part >= 0, rad/s, as the reference.

        The distance of the roots is computed in fractions, as round-off would spoil it.
        """
        C, K, coupling = self._parts
        mu = Fraction(self.weights(theta)[3])
        pairs = zip(K.ravel(), coupling.ravel(), strict=True)
        k11, k12, k21, k22 = (Fraction(float(k)) + mu * Fraction(float(f)) for k, f in pairs)
        split = np.sqrt(complex(((k11 - k22) / 2) ** 2 + k12 * k21))
        nu = float((k11 + k22) / 2) + np.array([split, -split])
        roots: np.ndarray = -C[0, 0] / 2 + 1j * np.sqrt(nu - C[0, 0] ** 2 / 4)
        return roots


@lru_cache(maxsize=8)
def problem_and_basis(damping_ratio: float, tolerance: float) -> tuple[FrictionProblem, SweepBasis]:
    """Hulten's mass over a box about mu_c, and its basis."""
    problem = FrictionProblem(damping_ratio)
    return problem, build_sweep_basis(problem, tolerance / BASIS_SHARE)


def predict(away: float) -> float:
    """Relative error of a root from round-off at a relative distance to coalescence."""
    eps = ROUND_OFFS * float(np.finfo(float).eps)
    return min(eps / (2 * np.sqrt(2 * away)), np.sqrt(eps) / 2)


WINDOWS_RUNG = StabilityCase(
    name="windows",
    title="reanalysis by windows beside a lock-in",
    boundary="4 round-offs over twice the root of (2 distance) = 2 tolerances",
    settings=KNOBS,
    measure=measure,
)
