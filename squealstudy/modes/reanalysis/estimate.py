"""Roots of a design point by a smaller model, with their distance to those of the next larger."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import Eigenpairs
from squealstudy.modes.reanalysis.problem import Linearisation, SweptProblem, in_band
from squealstudy.system.parametric import Columns, Weights

EIGENVALUE_REL_ROUND_OFF = 1e-13  # relative: round-off of a dense eigenvalue


def two_sided_error(problem: SweptProblem, weights: Weights, pairs: Eigenpairs) -> np.ndarray:
    """Signed first-order error lam - lam_exact of each root (m,) complex, rad/s.

        (y^H r_x  -  r_y^H K0^-1 r_x) / (y^H Q'(lam) x),   r_x = Q x, r_y = Q^H y

    in the full problem (THEORY.md eq. (39)). The first part vanishes where the small model is an
    exact projection, the second is what its basis lacks.
    """
    system, weights = problem.system.gathered(weights)
    lam = pairs.lam
    X, Y = Columns(pairs.X), Columns(pairs.Y)
    rx = system.apply(weights, lam, X)
    ry = system.apply_adjoint(weights, lam, Y)
    slope = system.slopes(weights, lam, X, Y)
    first = np.einsum("ij,ij->j", pairs.Y.conj(), rx)
    second = np.einsum("ij,ij->j", ry.conj(), problem.flexibility(rx))
    signed: np.ndarray = (first - second) / np.where(slope == 0, np.inf, slope)
    return signed


def bounded(error: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Estimates |error| (m,), rad/s, not below round-off."""
    size: np.ndarray = np.maximum(np.abs(error), EIGENVALUE_REL_ROUND_OFF * np.abs(lam))
    return size


def residuals(
    problem: SweptProblem, weights: Weights, pairs: Eigenpairs
) -> tuple[np.ndarray, np.ndarray]:
    """Backward errors (m,) of pairs, and how far they may have moved the roots (m,), rad/s.

    The first are |Q x| / (2 |lam|^2 |M x|), the second |y|^T |Q x| by entry with y^H Q'(lam) x = 1:
    near a coalescence round-off alone moves a root by far more than its share, beside a stiff
    spring by far less than its size there.
    """
    residual = problem.system.apply(weights, pairs.lam, pairs.X)
    r = np.linalg.norm(residual, axis=0)
    inertia = np.abs(pairs.lam) ** 2 * np.linalg.norm(problem.mass_product(pairs.X), axis=0)
    root_shift: np.ndarray = np.einsum("ij,ij->j", np.abs(pairs.Y), np.abs(residual))
    return r / np.maximum(2.0 * inertia, 1e-300), root_shift


class EstimatedRoots(NamedTuple):
    """Roots of a design point inside the band with the errors that a rung estimates of them.

    Attributes
    ----------
    at : Linearisation
    lam : ndarray (m,) complex
        rad/s, ascending in modulus.
    X : ndarray (n or r, m) complex
        Right vectors, in full coordinates where `full`, else in those of the sweep basis.
    error : ndarray (m,)
        Estimated error of lam, rad/s.
    residual : ndarray (m,)
        Backward error of each pair.
    method : str
        Name of the rung that found them.
    full : bool
    complete : bool
        No other root may lie in the band, as far as the estimates tell.
    """

    at: Linearisation
    lam: np.ndarray
    X: np.ndarray
    error: np.ndarray
    residual: np.ndarray
    method: str
    full: bool = True
    complete: bool = True


Outcome = EstimatedRoots | ConvergenceError  # of a design point: roots, or why it has none


def solve_alone(
    problem: SweptProblem, theta: np.ndarray, method: str, solve: Callable[[Weights], Eigenpairs]
) -> Outcome:
    """Roots of a design point (d,) by `solve`: from its weights to pairs in full coordinates.

    Errors are estimated against the full problem.
    """
    at = problem.samples(np.asarray(theta)[None])[0]
    if isinstance(at, ConvergenceError):
        return at
    pairs = inside(solve(at.weights), problem.band)
    error = bounded(two_sided_error(problem, at.weights, pairs), pairs.lam)
    residual, _ = residuals(problem, at.weights, pairs)
    return EstimatedRoots(
        at=at, lam=pairs.lam, X=pairs.X, error=error, residual=residual, method=method
    )


def inside(pairs: Eigenpairs, band: tuple[float, float]) -> Eigenpairs:
    """The pairs with a root in the band, ascending in modulus."""
    pairs = pairs.take(in_band(pairs.lam, band, 1.0))
    return pairs.take(np.argsort(np.abs(pairs.lam), kind="stable"))
