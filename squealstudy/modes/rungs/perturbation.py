"""First- and second-order perturbation of an anchor's modes: for small changes, away from lock-in.

In the state space of the companion form a change of weights acts on the last rows only, so that
only left vectors y and right vectors x of the quadratic problem enter.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import Eigenpairs
from squealstudy.modes.answer import PointAnswer
from squealstudy.modes.problem import Point, Problem
from squealstudy.modes.reanalysis.estimate import Outcome, next_term, solve_alone
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.problem import SweptProblem, in_band
from squealstudy.modes.rung import Rung
from squealstudy.system.parametric import (
    DAMPING,
    MASS,
    STIFFNESS,
    ParametricSystem,
    Weights,
)

ORDER = 2
SUM_BAND_FACTOR = 4.0  # second-order terms run through the modes of the band widened by this
COST = 0.6  # time of a point over that of an exact point, roughly
ANCHOR_BAND_FACTOR = 1.2  # factor on the band, within which modes of the anchor are perturbed
MIN_TESTED_REL_ERROR = 1e-12  # a root with a smaller relative error is used as it is
# error over the sum of the series of terms to come: the next term is itself an estimate, and errors
# were up to 1.9 times that sum
SERIES_SAFETY_FACTOR = 2.0
REAL = 1e-12  # a root with a smaller relative imaginary part is its own conjugate


class Perturbation(Rung):
    """Second-order perturbation from the middle of the box."""

    name = "perturbation"
    description = "second-order perturbation from the middle of a part of the design"
    keeps_tolerance = False
    shares_work = True

    def solve(self, problem: Problem, points: Sequence[Point], box: Box) -> Iterator[PointAnswer]:
        """Perturbed pairs of each point, from the exact ones of one anchor."""
        anchor = make_anchor(problem.swept, box.middle, SUM_BAND_FACTOR)
        for i, theta in enumerate(problem.theta(points)):
            yield i, problem.modes(perturbed_roots(problem.swept, anchor, theta, ORDER))

    def relative_cost(self, points: int, varied: int) -> float:
        """Cost of a point over an exact one: mostly that of the error estimate."""
        return COST


@dataclass(frozen=True)
class ExactPoint:
    """A design point whose modes are known.

    Attributes
    ----------
    theta : ndarray (d,)
        Its coordinates.
    weights : Weights
    pairs : Eigenpairs
        Its pairs with their conjugates.
    """

    theta: np.ndarray
    weights: Weights
    pairs: Eigenpairs


def make_anchor(problem: SweptProblem, theta: np.ndarray, reach: float) -> ExactPoint:
    """Solve a design point exactly.

    Its pairs are those with band[0] / reach <= |lam| <= reach band[1]; second-order terms are sums
    over these.
    """
    weights, pairs = problem.pairs(np.asarray(theta), reach)
    paired = pairs.lam.imag > REAL * np.abs(pairs.lam)
    lam, X, Y = pairs
    both = Eigenpairs(
        np.concatenate([lam, lam[paired].conj()]),
        np.hstack([X, X[:, paired].conj()]),
        np.hstack([Y, Y[:, paired].conj()]),
    )
    return ExactPoint(np.asarray(theta), weights, both)


def perturbed_roots(
    problem: SweptProblem, anchor: ExactPoint, theta: np.ndarray, order: int
) -> Outcome:
    """Roots of a design point by perturbation of order 1 or 2 from an anchor.

    Vectors are of first order in both cases: with them the estimate contains the next term of the
    expansion, and the coupling of neighbouring modes. At order 2 the error is twice the sum of all
    terms to come, as a geometric series with the ratio of the next term to the last one; infinite
    where terms do not fall.

    Raises
    ------
    ValueError
        An order that is neither 1 nor 2.
    """
    if order not in (1, 2):
        raise ValueError(f"order must be 1 or 2, got {order}")

    lam = anchor.pairs.lam
    followed = np.flatnonzero(in_band(lam, problem.band, ANCHOR_BAND_FACTOR))
    last: list[tuple[np.ndarray, np.ndarray]] = []  # roots, and their last terms

    def solve(weights: Weights) -> Eigenpairs:
        pairs, term = perturbed_pairs(problem.system, anchor, weights, order, followed)
        last.append((pairs.lam, term))
        return pairs

    outcome = solve_alone(problem, theta, Perturbation.name, solve, next_term)
    if order == 1 or isinstance(outcome, ConvergenceError) or not len(outcome.lam):
        return outcome
    ((roots, terms),) = last
    size = np.abs(terms[np.abs(roots[None, :] - outcome.lam[:, None]).argmin(axis=1)])
    error = np.full(len(size), np.inf)
    falls = outcome.error < size
    error[falls] = (
        SERIES_SAFETY_FACTOR * outcome.error[falls] / (1.0 - outcome.error[falls] / size[falls])
    )
    small = outcome.error <= MIN_TESTED_REL_ERROR * np.abs(outcome.lam)
    return outcome._replace(error=np.where(small, outcome.error, error))


def perturbed_pairs(
    system: ParametricSystem, anchor: ExactPoint, weights: Weights, order: int, indices: np.ndarray
) -> tuple[Eigenpairs, np.ndarray]:
    """Pairs of the anchor with `indices` (m,) at other weights, by a series in all of its pairs.

    The last term (m,) of each root's series is returned too. Terms of first and second order are

    lam1_i = V_ii,    lam2_i = sum_(k != i) V_ik V_ki / (lam_i - lam_k) - V_ii lam_i y_i^H dM x_i

    with V_ki = -y_k^H (dK + lam_i dC + lam_i^2 dM) x_i, but lam_k dC and lam_i lam_k dM in V_ik.
    """
    every = anchor.pairs
    lam, X, Y = every.take(indices)
    change = tuple(np.subtract(new, old) for new, old in zip(weights, anchor.weights, strict=True))
    masses = _of_order(system, change, MASS).apply(X)
    into = -every.Y.conj().T @ system.apply(change, lam, X)
    first = into[indices, np.arange(len(indices))]
    fixed = _of_order(system, change, STIFFNESS).adjoint(Y).conj().T @ every.X
    dampers = _of_order(system, change, DAMPING).adjoint(Y)
    dampers = dampers + _of_order(system, change, MASS).adjoint(Y) * lam.conj()
    back = -(fixed + (dampers.conj().T @ every.X) * every.lam)
    gap = lam[None, :] - every.lam[:, None]  # lam_i - lam_k in row k, column i
    other = np.where(gap == 0, 0.0, 1.0 / np.where(gap == 0, 1.0, gap))
    terms = [first]
    if order == 2:
        own_mass = np.einsum("ij,ij->j", Y.conj(), masses)
        terms.append(np.einsum("ki,ik,ki->i", into, back, other) - first * lam * own_mass)
    left_turn = (back * other.T).conj().T  # column i: shares of the left modes k in mode i
    perturbed = Eigenpairs(lam + sum(terms), X + every.X @ (into * other), Y + every.Y @ left_turn)
    return perturbed, terms[-1]


class _Change(NamedTuple):
    """The change of the stiffness, the damping or the mass."""

    system: ParametricSystem
    weights: Weights

    def apply(self, X: np.ndarray) -> np.ndarray:
        """Product of the changed matrix with X (n, m)."""
        return self.system.apply(self.weights, np.ones(X.shape[1]), X)

    def adjoint(self, Y: np.ndarray) -> np.ndarray:
        """Product of its transpose with Y (n, m)."""
        return self.system.apply_adjoint(self.weights, np.ones(Y.shape[1]), Y)


def _of_order(system: ParametricSystem, change: Weights, order: int) -> _Change:
    return _Change(*system.of_order(change, order))


RUNG = Perturbation()
