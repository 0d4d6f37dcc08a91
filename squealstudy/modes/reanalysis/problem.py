"""What the ladder needs of a model: its system, its weights at a design point, its exact modes."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import Eigenpairs
from squealstudy.modes.full_order.pairs import LIGHT
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.parametric import ParametricSystem, Weights


class Linearisation(NamedTuple):
    """Weights of a problem's terms, and the working point that they are about; None: no contact."""

    weights: Weights
    working_point: WorkingPoint | None


Linearised = Linearisation | ConvergenceError  # of a design point, or why it has none


class SweptProblem(Protocol):
    """A model over a box of design points, theta in [-1, 1]^d."""

    @property
    def system(self) -> ParametricSystem:
        """Terms of the full problem, n degrees of freedom."""
        ...

    @property
    def dimension(self) -> int:
        """Number d of parameters that vary."""
        ...

    @property
    def exact(self) -> str:
        """Name of the rung that `pairs` is: dense or full."""
        ...

    @property
    def band(self) -> tuple[float, float]:
        """Bounds of |lambda|, rad/s."""
        ...

    def interpolation_error(self) -> float:
        """Largest error of a damping ratio by what the problem interpolates over the box."""
        ...

    def weights(self, theta: np.ndarray) -> Weights:
        """Weights at a design point; ConvergenceError where it has no working point."""
        ...

    def samples(self, theta: np.ndarray, field: Any = None) -> list[Linearised]:
        """Weights at points (b, d), from starts that `local_field` made; reasons of failure."""
        ...

    def local_field(self, box: Any, grid: Any) -> Any:
        """Starts of `samples` in a part of the box; None where there are none."""
        ...

    def pairs(self, theta: np.ndarray, reach: float) -> tuple[Weights, Eigenpairs]:
        """Exact pairs of imaginary part >= 0 with band[0] / reach <= |lam| <= reach band[1]."""
        ...

    def energy_root(self, X: np.ndarray) -> np.ndarray:
        """F X with F^T F = K0, the nominal symmetric stiffness, SPD."""
        ...

    def from_energy(self, Z: np.ndarray) -> np.ndarray:
        """F^-1 Z."""
        ...

    def flexibility(self, r: np.ndarray) -> np.ndarray:
        """K0^-1 r for complex loads (n, m)."""
        ...

    def mass_product(self, X: np.ndarray) -> np.ndarray:
        """M0 X with a nominal symmetric mass."""
        ...


def in_band(lam: np.ndarray, band: tuple[float, float], reach: float) -> np.ndarray:
    """Roots of imaginary part >= 0 whose modulus lies in the band widened by `reach`."""
    size = np.abs(lam)
    kept: np.ndarray = (lam.imag >= 0) & (size >= band[0] / reach) & (size <= band[1] * reach)
    return kept


def light(lam: np.ndarray) -> np.ndarray:
    """Which roots are lightly damped, |zeta| < 5 %."""
    size = np.abs(lam)
    kept: np.ndarray = np.abs(lam.real) < LIGHT * size
    return kept
