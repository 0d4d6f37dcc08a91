"""Two steps, as commercial codes take them: symmetric real modes, then a small quadratic problem.

Real modes lack the static response to friction and damping forces, so that the error stalls near
1e-3 (THEORY.md eq. (45)): this rung is for comparison.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.linalg.companion import Eigenpairs, all_pairs
from squealstudy.linalg.real_modes import real_modes
from squealstudy.modes.answer import PointAnswer
from squealstudy.modes.problem import Point, Problem
from squealstudy.modes.reanalysis.estimate import Outcome, solve_alone
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.problem import SweptProblem
from squealstudy.modes.rung import Rung
from squealstudy.system.parametric import (
    DAMPING,
    MASS,
    STIFFNESS,
    ParametricSystem,
    Term,
    Weights,
)

FACTOR = 2.0  # cut-off of the real modes over the top of the band, as commercial codes advise
COST = 0.9  # time of a point over that of an exact point, roughly
SYMMETRIC = 1e-12  # relative asymmetry of round-off


class TwoStep(Rung):
    """Two steps for each point, with an estimate of the error of the projection."""

    name = "two_step"
    description = "real modes without friction, then a small quadratic eigenproblem"
    keeps_tolerance = False

    def solve(self, problem: Problem, points: Sequence[Point], box: Box) -> Iterator[PointAnswer]:
        """Pairs of each point, projected on real modes, one point after the other."""
        for i, theta in enumerate(problem.theta(points)):
            yield i, problem.modes(two_step_roots(problem.swept, theta, FACTOR))

    def relative_cost(self, points: int, varied: int) -> float:
        """Cost of a point over an exact one: mostly that of the real modes."""
        return COST


def two_step_roots(problem: SweptProblem, theta: np.ndarray, factor: float) -> Outcome:
    """Roots of a design point from real modes up to `factor` times the band.

    Parameters
    ----------
    problem : SweptProblem
    theta : ndarray (d,)
    factor : float
        Cut-off of the real modes over the top of the band.
    """

    def solve(weights: Weights) -> Eigenpairs:
        return two_step_pairs(problem.system, weights, factor * problem.band[1])

    return solve_alone(problem, theta, TwoStep.name, solve)


def two_step_pairs(system: ParametricSystem, weights: Weights, top: float) -> Eigenpairs:
    """All pairs of the projection on the real modes up to `top` rad/s, in full coordinates."""
    phi = symmetric_modes(system, weights, top)
    C, K, M = _projected(system, weights, phi)
    pairs = all_pairs(C, K)
    return Eigenpairs(pairs.lam, phi @ pairs.X, phi @ np.linalg.solve(M.T, pairs.Y))


def symmetric_modes(system: ParametricSystem, weights: Weights, top: float) -> np.ndarray:
    """Real modes (n, m) up to `top` rad/s of the symmetric mass and stiffness terms."""
    chosen = [i for i, t in enumerate(system.terms) if t.order != DAMPING and is_symmetric(t)]
    part = ParametricSystem(system.n, tuple(system.terms[i] for i in chosen))
    chosen_weights = tuple(weights[i] for i in chosen)
    if any(sp.issparse(t.right) for t in part.terms):
        M, _, K = part.sparse_matrices(chosen_weights)
        return real_modes(M.sparse, K.sparse, top / (2 * np.pi))[1]
    dense_M, _, dense_K = part.matrices(chosen_weights)
    unit = np.array_equal(dense_M, np.eye(system.n))
    limits = (-np.inf, top**2)
    _, phi = la.eigh(dense_K, None if unit else dense_M, subset_by_value=limits)
    modes: np.ndarray = phi
    return modes


def is_symmetric(term: Term) -> bool:
    """Whether a term is symmetric whatever its weights are."""
    if term.left is term.right and not term.dense:
        return True
    if term.left is not None or term.right is None:
        return False
    A = term.right
    return bool(abs(A - A.T).max() <= SYMMETRIC * abs(A).max())


def _projected(
    system: ParametricSystem, weights: Weights, phi: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Small M^-1 C, M^-1 K, M."""
    M, C, K = (
        phi.T @ part.apply(weights_of_order, np.ones(phi.shape[1]), phi).real
        for part, weights_of_order in (
            system.of_order(weights, order) for order in (MASS, DAMPING, STIFFNESS)
        )
    )
    return np.linalg.solve(M, C), np.linalg.solve(M, K), M


RUNG = TwoStep()
