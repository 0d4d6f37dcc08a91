"""A model as rungs need it: its system, its weights at a design point, its exact modes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
import scipy.linalg as la

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import Eigenpairs
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.root_pairs import LIGHT_DAMPING
from squealstudy.system.parametric import ParametricSystem, Weights


class Linearisation(NamedTuple):
    """Weights of a problem's terms, and their working point; None for a model without contact."""

    weights: Weights
    working_point: WorkingPoint | None


Linearised = Linearisation | ConvergenceError  # that of a design point, or why it has none


class SweptProblem(ABC):
    """A model over a box of design points, theta in [-1, 1]^d.

    Attributes
    ----------
    dimension : int
        Number d of parameters that vary.
    exact : str
        Name of the rung that `pairs` is: dense or full.
    band : (low, high)
        Bounds of |lambda|, rad/s.
    """

    dimension: int
    exact: ClassVar[str]
    band: tuple[float, float]

    @property
    @abstractmethod
    def system(self) -> ParametricSystem:
        """Terms of the full problem, n degrees of freedom."""

    def interpolation_error(self) -> float:
        """Largest error of a damping ratio by interpolation of the problem over the box."""
        return 0.0

    @abstractmethod
    def weights(self, theta: np.ndarray) -> Weights:
        """Weights at a design point (d,); ConvergenceError where it has none."""

    def samples(self, theta: np.ndarray, field: Any = None) -> list[Linearised]:
        """Weights at points (b, d), or the errors of points without any.

        `field` are starts that `local_field` made, or None.
        """
        linearised: list[Linearised] = []
        for row in theta:
            try:
                linearised.append(Linearisation(self.weights(row), None))
            except ConvergenceError as error:
                linearised.append(error)
        return linearised

    def local_field(self, box: Any, grid: Any) -> Any:
        """Starts of `samples` in a part of the box; None where there are none."""
        return None

    @abstractmethod
    def pairs(
        self, theta: np.ndarray, reach: float, below: bool = False
    ) -> tuple[Weights, Eigenpairs]:
        """Exact pairs of imaginary part >= 0 with band[0] / reach <= |lam| <= reach band[1].

        With `below` also those that vibrate below the band.
        """

    @abstractmethod
    def energy_root(self, X: np.ndarray) -> np.ndarray:
        """F X with F^T F = K0, the nominal symmetric stiffness, SPD."""

    @abstractmethod
    def from_energy(self, Z: np.ndarray) -> np.ndarray:
        """F^-1 Z, the inverse of `energy_root`, (n, m)."""

    @abstractmethod
    def flexibility(self, r: np.ndarray) -> np.ndarray:
        """K0^-1 r for complex loads (n, m)."""

    @abstractmethod
    def mass_product(self, X: np.ndarray) -> np.ndarray:
        """M0 X with a nominal symmetric mass."""


class DenseProblem(SweptProblem):
    """A problem of dense matrices, whose mass is the identity."""

    exact = "dense"

    @abstractmethod
    def nominal_stiffness(self) -> np.ndarray:
        """K0 (n, n)."""

    @cached_property
    def _factor(self) -> np.ndarray:
        """Upper F of K0 = F^T F."""
        factor: np.ndarray = la.cholesky(self.nominal_stiffness())
        return factor

    def energy_root(self, X: np.ndarray) -> np.ndarray:
        """F X with F^T F = K0, the symmetric stiffness at the middle of the box, (n, m)."""
        product: np.ndarray = self._factor @ X
        return product

    def from_energy(self, Z: np.ndarray) -> np.ndarray:
        """F^-1 Z, the inverse of `energy_root`, (n, m)."""
        solved: np.ndarray = la.solve_triangular(self._factor, Z)
        return solved

    def flexibility(self, r: np.ndarray) -> np.ndarray:
        """Static response K0^-1 r to complex loads r (n, m)."""
        solved: np.ndarray = la.cho_solve((self._factor, False), r)
        return solved

    def mass_product(self, X: np.ndarray) -> np.ndarray:
        """M0 X (n, m), which is X: the mass is the identity."""
        return X


def in_band(lam: np.ndarray, band: tuple[float, float], reach: float) -> np.ndarray:
    """Mask of roots of imaginary part >= 0 whose modulus is in the band widened by `reach`."""
    size = np.abs(lam)
    is_inside: np.ndarray = (lam.imag >= 0) & (size >= band[0] / reach) & (size <= band[1] * reach)
    return is_inside


def in_or_below(lam: np.ndarray, band: tuple[float, float], reach: float) -> np.ndarray:
    """Mask of the roots of `in_band`, and of vibrating ones below them."""
    is_kept: np.ndarray = in_band(lam, band, reach) | (
        (lam.imag > 0) & (np.abs(lam) < band[0] / reach)
    )
    return is_kept


def lightly_damped(lam: np.ndarray) -> np.ndarray:
    """Mask of roots that are lightly damped, |zeta| < LIGHT_DAMPING."""
    size = np.abs(lam)
    is_light: np.ndarray = np.abs(lam.real) < LIGHT_DAMPING * size
    return is_light
