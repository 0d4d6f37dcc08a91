"""What a sensitivity of a complex mode is: derivative, range of validity, finite change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.modes.sensitivity.finite_change import FiniteChange
from squealstudy.modes.sensitivity.mode_family import ModeFamily

QUARTER = 0.25  # second-order share of the first at which a derivative stops being valid
UNSEEN = 1e-9  # of |lambda|: second-order changes below are not seen
CONDITION_LIMIT = 100.0  # eigenvalue condition beyond which a derivative means nothing


@dataclass(frozen=True)
class Step:
    """A parameter with the finite change that its derivative is held against.

    Attributes
    ----------
    name : str
    value : float
        At the design point.
    reference : float
        The change that counts as 100 %.
    size : float
        The finite change, signed.
    component_hz : float
        Free-free frequency of the one component mode that the parameter changes, with the scale in
        force; NaN for every other parameter.
    """

    name: str
    value: float
    reference: float
    size: float
    component_hz: float = float("nan")


@dataclass(frozen=True)
class Sensitivity:
    """One mode's sensitivity to one parameter.

    Attributes
    ----------
    step : Step
    derivative : complex
        d lambda / d theta, 1/s per unit.
    validity : float
        Change of the parameter at which the second-order term, by the nearest modes, reaches a
        quarter of the first; at a square-root coalescence that is the distance to it.
    finite : FiniteChange or None
        None where the changed design has no solution.
    reason : str
        Why there is none.
    """

    step: Step
    derivative: complex
    validity: float
    finite: FiniteChange | None
    reason: str = ""

    @property
    def predicted(self) -> complex:
        """First-order change of lambda at the step, 1/s."""
        return self.derivative * self.step.size


@dataclass(frozen=True)
class ModeSensitivities:
    """A complex mode and its sensitivities.

    Attributes
    ----------
    family : ModeFamily
    biorthogonality : float
        Largest product with the left vector of another chosen mode; 0 is right.
    energies : ndarray (n_components + 1,)
        Elastic energy shares.
    sensitivities : tuple of Sensitivity
    """

    family: ModeFamily
    biorthogonality: float
    energies: np.ndarray
    sensitivities: tuple[Sensitivity, ...]

    @property
    def lam(self) -> complex:
        """The root, rad/s."""
        return complex(self.family.lam[0])

    def near_coalescence(self, sensitivity: Sensitivity) -> bool:
        """Whether a derivative means nothing: see CONDITION_LIMIT and `Sensitivity.validity`."""
        outside = sensitivity.validity < abs(sensitivity.step.size)
        return bool(outside or not self.family.condition < CONDITION_LIMIT)


def with_more(mode: ModeSensitivities, more: Sequence[Sensitivity]) -> ModeSensitivities:
    """The same mode with further sensitivities."""
    return replace(mode, sensitivities=(*mode.sensitivities, *more))


def slope_and_validity(
    family: ModeFamily, products: np.ndarray, size: float
) -> tuple[complex, float]:
    """Derivative of the first root, and the range in which it says more than the curvature.

    Second order, lambda''/2 = sum of b_1j b_j1 / (lambda_1 - lambda_j) over the neighbours with
    b_ij = -y_i^H Q_theta(lambda_j) x_j / (y_i^H Q'(lambda_i) x_i), of which `products` (k, k) are
    the first factors. A curvature that a change of `size` does not show is none: the range is
    infinite.
    """
    norm, lam = family.norm, family.lam
    slope = complex(-products[0, 0] / norm[0]) if norm[0] else complex(np.nan, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        coupling = products[0, 1:] * products[1:, 0] / (norm[0] * norm[1:])
        half = complex((coupling / (lam[0] - lam[1:])).sum())
    if abs(half) * size**2 <= UNSEEN * abs(lam[0]):
        return slope, float("inf")
    return slope, float(QUARTER * abs(slope) / abs(half)) if np.isfinite(half) else 0.0
