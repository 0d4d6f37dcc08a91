"""Roots by the companion form of a quadratic eigenproblem, compared with roots in closed form.

`dense_roots` gets uncoupled modes in coordinates that a random rotation turns. LAPACK's roots are
exact for matrices that differ by round-off of the largest entry. Relative to the smallest root that
is eps times the ratio of stiffnesses, whatever the algorithm. Damping far beyond critical spreads
the roots further.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.linalg as la

from squealstudy.laboratory.method_stability.coalescence import SmallProblem, distance
from squealstudy.laboratory.method_stability.contract import (
    CaseResult,
    Knob,
    StabilityCase,
    alarm,
    judged,
)
from squealstudy.linalg.companion import Eigenpairs
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.modes.reanalysis.estimate import bounded, residuals

N_MODES = 8
LOWEST_OMEGA = 1e3  # rad/s
MAX_REL_ERROR = 1e-6  # a root with a larger relative error is wrong
ESTIMATE_SAFETY_FACTOR = 10.0  # factor on the estimate

KNOBS = (
    Knob("stiffness_ratio", "largest over smallest stiffness", 1e3, low=1.0, high=1e20),
    Knob("damping_ratio", "of the stiffest mode; the others have 1 %", 0.01, low=0.0, high=1e8),
)


def measure(knobs: Mapping[str, float]) -> CaseResult:
    """`measured` is the largest relative error of a root over MAX_REL_ERROR.

    The estimate is that of design points that are solved exactly: how far residuals may have moved
    the roots.
    """
    C, K, exact = turned_modes(knobs["stiffness_ratio"], knobs["damping_ratio"])
    lam, psi = dense_roots(C, K, (0.0, np.inf))
    error = distance(lam, exact[exact.imag >= 0])
    limit = predicted_error(C, K, exact)
    with np.errstate(over="ignore", invalid="ignore"):
        estimate = ESTIMATE_SAFETY_FACTOR * estimated(C, K, lam, psi)
    return judged(
        error > MAX_REL_ERROR,
        alarm("estimate", estimate, MAX_REL_ERROR),
        predicted=limit / MAX_REL_ERROR,
        measured=error / MAX_REL_ERROR,
        error=error,
        cost=len(lam),
    )


def turned_modes(ratio: float, damping: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """C and K (n, n) of uncoupled modes in turned coordinates, and all their roots (2n,)."""
    omega = LOWEST_OMEGA * np.sqrt(np.geomspace(1.0, ratio, N_MODES))
    zeta = np.full(N_MODES, 0.01)
    zeta[-1] = damping
    turn = la.qr(np.random.default_rng(4).normal(size=(N_MODES, N_MODES)))[0]
    C = (turn * (2 * zeta * omega)) @ turn.T
    K = (turn * omega**2) @ turn.T
    root = np.sqrt((zeta**2 - 1).astype(complex))
    far = -omega * (zeta + root)  # the larger of two real roots; the other without cancellation
    return (C + C.T) / 2, (K + K.T) / 2, np.concatenate([far, omega**2 / far])


def predicted_error(C: np.ndarray, K: np.ndarray, exact: np.ndarray) -> float:
    """Largest relative change of a root by round-off, for modes that do not couple.

    d lam = -(dK + lam dC) / (2 lam + c), where 2 lam + c is the distance to the mode's other root;
    LAPACK's own part is round-off of the companion matrix, of size |C| + |K| / s + s, in any of
    its blocks: an upper bound, as balancing does better.
    """
    tiny, n = np.finfo(float).eps, len(exact) // 2
    gap = np.tile(np.abs(exact[:n] - exact[n:]), 2)
    size_c, size_k, size = np.linalg.norm(C, 2), np.linalg.norm(K, 2), np.abs(exact)
    scale = np.sqrt(np.linalg.norm(K) / np.sqrt(n))
    companion = size_c + size_k / scale + scale
    change = tiny * (companion * scale + size * companion + size**2)
    root_shift = change / np.maximum(gap, np.sqrt(change))  # a double root moves by the square root
    return float((np.maximum(root_shift, tiny * companion) / size).max())


def estimated(C: np.ndarray, K: np.ndarray, lam: np.ndarray, psi: np.ndarray) -> float:
    """Largest estimated relative error of a root; left vectors of symmetric matrices are psi*."""
    slope = np.einsum("ij,ij->j", psi, 2 * lam * psi + C @ psi)
    Y = psi.conj() / np.where(slope == 0, 1e-300, slope.conj())
    problem = SmallProblem(C, K, np.zeros_like(K))
    _, root_shift = residuals(problem, problem.weights(np.zeros(1)), Eigenpairs(lam, psi, Y))
    return float((bounded(root_shift, lam) / np.maximum(np.abs(lam), 1e-300)).max())


LINEARISATION = StabilityCase(
    name="linearisation",
    title="companion form of eight uncoupled modes",
    boundary="round-off of the largest matrix entry moves the smallest root by 1e-6",
    settings=KNOBS,
    measure=measure,
)
