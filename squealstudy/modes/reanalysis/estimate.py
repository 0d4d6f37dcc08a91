"""Roots of a design point by a smaller model, with their distance to those of the next larger."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import Eigenpairs
from squealstudy.modes.reanalysis.problem import Linearisation, SweptProblem, in_band
from squealstudy.system.parametric import Columns, Weights

# largest share of inertia that is used: with it a response is ten times the static one
MOST_INERTIA = 0.9
SIGNED_FACTOR = 1.2  # factor on first-order errors in an estimate
CANCELLING_SHARE = 0.1  # factor on the error without cancelling that is added
EIGENVALUE_REL_ROUND_OFF = 1e-13  # round-off of a dense eigenvalue over its modulus


class _Residuals(NamedTuple):
    """Residuals of pairs, and the parts of the shifts of roots by them.

    Attributes
    ----------
    lam : ndarray (m,) complex
        Roots, rad/s.
    rx, ry : ndarray (n, m) complex
        Residuals Q x and Q^H y.
    response : ndarray (n, m) complex
        Static response K0^-1 r_x.
    first : ndarray (m,) complex
        y^H r_x, which is zero where the small model is an exact projection.
    slope : ndarray (m,) complex
        y^H Q'(lam) x; infinite where it vanishes.
    """

    lam: np.ndarray
    rx: np.ndarray
    ry: np.ndarray
    response: np.ndarray
    first: np.ndarray
    slope: np.ndarray

    @classmethod
    def of(cls, problem: SweptProblem, weights: Weights, pairs: Eigenpairs) -> _Residuals:
        """Residuals of some pairs in the full problem."""
        system, weights = problem.system.gathered(weights)
        lam = pairs.lam
        X, Y = Columns(pairs.X), Columns(pairs.Y)
        rx = system.apply(weights, lam, X)
        ry = system.apply_adjoint(weights, lam, Y)
        slope = system.slopes(weights, lam, X, Y)
        first = np.einsum("ij,ij->j", pairs.Y.conj(), rx)
        response = problem.flexibility(rx)
        return cls(lam, rx, ry, response, first, np.where(slope == 0, np.inf, slope))

    def signed(self, problem: SweptProblem) -> np.ndarray:
        """First-order error (m,) complex of each root, rad/s."""
        second = np.einsum("ij,ij->j", self.ry.conj(), self.response)
        second = second / (1.0 - _inertia_share(problem, self.lam, self.response, self.rx))
        signed: np.ndarray = (self.first - second) / self.slope
        return signed

    def without_cancelling(self, problem: SweptProblem) -> np.ndarray:
        """Size (m,) of the error from energies of both static responses, which cannot cancel."""
        product = np.ones(len(self.lam))
        for r, response in ((self.rx, self.response), (self.ry, problem.flexibility(self.ry))):
            energy = np.abs(np.einsum("ij,ij->j", r.conj(), response))
            product *= energy / (1.0 - _inertia_share(problem, self.lam, response, r))
        size: np.ndarray = (np.abs(self.first) + np.sqrt(product)) / np.abs(self.slope)
        return size

    def through_each_other(self, pairs: Eigenpairs) -> np.ndarray:
        """Error (m,) by coupling with the other pairs; zero for an exact projection."""
        through = np.abs(self.ry.conj().T @ pairs.X) * np.abs(pairs.Y.conj().T @ self.rx).T
        gap = np.abs(self.lam[:, None] - self.lam)
        np.fill_diagonal(gap, np.inf)
        slope = np.abs(self.slope)
        parts = through / (np.maximum(gap, 1e-300) * slope)
        size: np.ndarray = parts.sum(axis=1) / slope
        return size


def two_sided_error(problem: SweptProblem, weights: Weights, pairs: Eigenpairs) -> np.ndarray:
    """Signed first-order error lam - lam_exact of each root (m,) complex, rad/s.

        (y^H r_x  -  r_y^H K0^-1 r_x / (1 - q)) / (y^H Q'(lam) x),   r_x = Q x, r_y = Q^H y

    in the full problem (THEORY.md eq. (39)). The first part vanishes where the small model is an
    exact projection. The second is by motion that its basis lacks, in which q is the share of
    inertia.
    """
    return _Residuals.of(problem, weights, pairs).signed(problem)


def next_term(problem: SweptProblem, weights: Weights, pairs: Eigenpairs) -> np.ndarray:
    """Size (m,) of the next term of an expansion of roots whose pairs are no projection, rad/s."""
    of_pairs = _Residuals.of(problem, weights, pairs)
    size: np.ndarray = np.abs(of_pairs.signed(problem)) + of_pairs.through_each_other(pairs)
    return size


def two_sided_estimate(problem: SweptProblem, weights: Weights, pairs: Eigenpairs) -> np.ndarray:
    """Estimated errors (m,) of roots, rad/s, which the true ones hardly ever exceed.

    They are larger than the size of `two_sided_error`, parts of which may cancel by chance. For
    true errors over estimates see THEORY.md, section 7.
    """
    of_pairs = _Residuals.of(problem, weights, pairs)
    size: np.ndarray = SIGNED_FACTOR * np.abs(of_pairs.signed(problem))
    size += CANCELLING_SHARE * of_pairs.without_cancelling(problem)
    return size


def _inertia_share(
    problem: SweptProblem, lam: np.ndarray, response: np.ndarray, load: np.ndarray
) -> np.ndarray:
    """Inertia at |lam| over stiffness (m,) in static responses (n, m) to loads, at most .9.

    If the response is one mode beyond the basis the ratio q is (|lam| / omega)^2, and its dynamic
    response is 1 / (1 - q) times the static one.
    """
    inertia = np.einsum("ij,ij->j", response.conj(), problem.mass_product(response)).real
    stiffness = np.einsum("ij,ij->j", response.conj(), load).real
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.abs(lam) ** 2 * inertia / stiffness
    clipped: np.ndarray = np.clip(np.nan_to_num(share), 0.0, MOST_INERTIA)
    return clipped


def bounded(error: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Sizes |error| (m,) of estimates, rad/s, but round-off at least."""
    size: np.ndarray = np.maximum(np.abs(error), EIGENVALUE_REL_ROUND_OFF * np.abs(lam))
    return size


def residuals(
    problem: SweptProblem, weights: Weights, pairs: Eigenpairs
) -> tuple[np.ndarray, np.ndarray]:
    """Backward errors (m,) of pairs, and bounds (m,) of the shifts of roots by them, rad/s.

    The first are |Q x| / (2 |lam|^2 |M x|), the second |y|^T |Q x| by entries, where y is scaled to
    y^H Q'(lam) x = 1. Near a coalescence round-off shifts a root by much more than the backward
    error; beside a stiff spring, where residuals are large, by much less.
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
        Roots, rad/s, ascending in modulus.
    X : ndarray (n or r, m) complex
        Right vectors, in full coordinates where `full`, else in those of the sweep basis.
    error : ndarray (m,)
        Estimated error of lam, rad/s.
    residual : ndarray (m,)
        Backward error of each pair.
    method : str
        Name of the rung that computed them.
    full : bool
        Whether X is in full coordinates.
    complete : bool
        Whether no other root can be in the band, by the estimates.
    """

    at: Linearisation
    lam: np.ndarray
    X: np.ndarray
    error: np.ndarray
    residual: np.ndarray
    method: str
    full: bool = True
    complete: bool = True


Estimate = Callable[[SweptProblem, Weights, Eigenpairs], np.ndarray]
Outcome = EstimatedRoots | ConvergenceError  # roots of a design point, or why it has none


def solve_alone(
    problem: SweptProblem,
    theta: np.ndarray,
    method: str,
    solve: Callable[[Weights], Eigenpairs],
    estimate: Estimate = two_sided_estimate,
) -> Outcome:
    """Roots of a design point (d,) by `solve`, which returns pairs in full coordinates.

    `estimate` returns their errors (m,) against the full problem.
    """
    linearisation = problem.samples(np.asarray(theta)[None])[0]
    if isinstance(linearisation, ConvergenceError):
        return linearisation
    pairs = inside(solve(linearisation.weights), problem.band)
    error = bounded(estimate(problem, linearisation.weights, pairs), pairs.lam)
    residual, _ = residuals(problem, linearisation.weights, pairs)
    return EstimatedRoots(
        at=linearisation, lam=pairs.lam, X=pairs.X, error=error, residual=residual, method=method
    )


def inside(pairs: Eigenpairs, band: tuple[float, float]) -> Eigenpairs:
    """The pairs with a root in the band, ascending in modulus."""
    pairs = pairs.take(in_band(pairs.lam, band, 1.0))
    return pairs.take(np.argsort(np.abs(pairs.lam), kind="stable"))
