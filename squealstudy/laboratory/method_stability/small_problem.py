"""A few modes with dense damping and stiffness as the problem of the reanalysis ladder."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from squealstudy.linalg.companion import Eigenpairs, all_pairs
from squealstudy.modes.reanalysis.problem import Linearisation, Linearised, in_band
from squealstudy.system.parametric import (
    DAMPING,
    MASS,
    STIFFNESS,
    ParametricSystem,
    Term,
    Weights,
)

Matrices = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


class SmallProblem:
    """lambda^2 I + lambda C + K over one parameter; see reanalysis.problem.SweptProblem.

    Parameters
    ----------
    matrices : callable
        C and K (n, n) at theta (1,).
    nominal : ndarray (n, n)
        Symmetric positive definite stiffness.
    band : (low, high)
        Of |lambda|, rad/s.
    """

    dimension = 1
    exact = "dense"

    def __init__(
        self, matrices: Matrices, nominal: np.ndarray, band: tuple[float, float] = (0.0, np.inf)
    ) -> None:
        self._matrices, self._nominal, self.band = matrices, nominal, band
        terms = (Term(MASS), Term(DAMPING, dense=True), Term(STIFFNESS, dense=True))
        self.system = ParametricSystem(len(nominal), terms)

    def interpolation_error(self) -> float:
        """Nothing is interpolated."""
        return 0.0

    def weights(self, theta: np.ndarray) -> Weights:
        """One, C and K."""
        return (1.0, *self._matrices(np.asarray(theta)))

    def samples(self, theta: np.ndarray, field: Any = None) -> list[Linearised]:
        """Weights at theta (b, 1)."""
        return [Linearisation(self.weights(row), None) for row in theta]

    def local_field(self, box: Any, grid: Any) -> None:
        """Nothing: there are no working points."""
        return

    def pairs(self, theta: np.ndarray, reach: float) -> tuple[Weights, Eigenpairs]:
        """All pairs of imaginary part >= 0 in reach of the band."""
        weights = self.weights(theta)
        pairs = all_pairs(weights[1], weights[2])
        kept = in_band(pairs.lam, self.band, reach) & (pairs.lam.imag >= 0)
        return weights, pairs.take(kept)

    def energy_root(self, X: np.ndarray) -> np.ndarray:
        """F X, F^T F the nominal stiffness."""
        root: np.ndarray = np.linalg.cholesky(self._nominal).T @ X
        return root

    def from_energy(self, Z: np.ndarray) -> np.ndarray:
        """F^-1 Z."""
        return np.linalg.solve(np.linalg.cholesky(self._nominal).T, Z)

    def flexibility(self, r: np.ndarray) -> np.ndarray:
        """The nominal stiffness solved for r."""
        return np.linalg.solve(self._nominal, r)

    def mass_product(self, X: np.ndarray) -> np.ndarray:
        """X itself."""
        return X
