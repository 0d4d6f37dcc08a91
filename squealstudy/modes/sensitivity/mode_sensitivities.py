"""Sensitivity of a complex mode: derivative, range of validity, finite change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.errors import SquealstudyError
from squealstudy.linalg.quadratic_pencil import QuadraticPencil, nearest_roots
from squealstudy.modes.sensitivity.mode_family import OFFSET, ModeNeighbourhood

QUARTER = 0.25  # a derivative is valid while the second-order term is below this share
UNSEEN = 1e-9  # a second-order change below this share of |lambda| is round-off
CONDITION_LIMIT = 100.0  # derivatives of roots with a larger condition are meaningless
CANDIDATES = 8  # roots near the old one among which the mode is sought


@dataclass(frozen=True)
class Step:
    """A parameter, and the finite change that its derivative is compared with.

    Attributes
    ----------
    name : str
        Name of the parameter.
    value : float
        Value at the design point.
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
        The parameter and its finite change.
    derivative : complex
        d lambda / d theta, 1/s per unit.
    validity : float
        Change of the parameter at which the second-order term, by the nearest modes, reaches a
        quarter of the first-order one; near a square-root coalescence the distance to it.
    finite : FiniteChange or None
        The change of the root by the finite step; None where it was not asked for, or where the
        changed design has no solution.
    reason : str
        Why the finite change is missing; empty where it is there, or was not asked for.
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
    family : ModeNeighbourhood
        The mode and its neighbours.
    biorthogonality : float
        Largest product with the left vector of another chosen mode; 0 if exact.
    energies : ndarray (n_components + 1,)
        Share of each component, then of the interfaces, in the elastic energy.
    sensitivities : tuple of Sensitivity
        One for each parameter.
    """

    family: ModeNeighbourhood
    biorthogonality: float
    energies: np.ndarray
    sensitivities: tuple[Sensitivity, ...]

    @property
    def lam(self) -> complex:
        """Root of the mode whose sensitivities these are, rad/s."""
        return complex(self.family.lam[0])

    def near_coalescence(self, sensitivity: Sensitivity) -> bool:
        """Whether a derivative does not hold over the finite step, or means nothing at all.

        It does not hold where the step exceeds `Sensitivity.validity`. It means nothing where the
        condition of the root exceeds CONDITION_LIMIT.
        """
        outside = sensitivity.validity < abs(sensitivity.step.size)
        return bool(outside or not self.family.condition < CONDITION_LIMIT)


def with_more(mode: ModeSensitivities, more: Sequence[Sensitivity]) -> ModeSensitivities:
    """A copy of the mode with further sensitivities."""
    return replace(mode, sensitivities=(*mode.sensitivities, *more))


def change_products(
    family: ModeNeighbourhood, KX: np.ndarray, CX: np.ndarray, MX: np.ndarray
) -> np.ndarray:
    """Products (k, k) y_i^H (K + lambda_j C + lambda_1 lambda_j M) x_j with a change of matrices.

    The change is given by its products (n, k) with the right vectors X. These are the products of
    the companion form, linear in lambda: the mass stands with both roots (THEORY.md eq. (59)). The
    first column is y_i^H Q_theta(lambda_1) x_1.
    """
    lam = family.lam
    products: np.ndarray = family.Y.conj().T @ (KX + lam * CX + lam[0] * lam * MX)
    return products


def slope_and_validity(
    family: ModeNeighbourhood, products: np.ndarray, size: float, mass: complex = 0.0
) -> tuple[complex, float]:
    """Derivative of the first root, and the range in which it is valid (`Sensitivity.validity`).

    Parameters
    ----------
    family : ModeNeighbourhood
    products : ndarray (k, k)
        `change_products`.
    size : float
        A change of the parameter: if its second-order effect is round-off the range is infinite.
    mass : complex
        y_1^H M_theta x_1.

    Second order (THEORY.md eq. (59)): lambda''/2 = sum of b_1j b_j1 / (lambda_1 - lambda_j) over
    the neighbours, less lambda' lambda_1 y_1^H M_theta x_1 / n_1, with b_ij = -products_ij / n_i
    and n_i = y_i^H Q'(lambda_i) x_i.
    """
    norm, lam = family.norm, family.lam
    slope = complex(-products[0, 0] / norm[0]) if norm[0] else complex(np.nan, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        coupling = products[0, 1:] * products[1:, 0] / (norm[0] * norm[1:])
        half = complex((coupling / (lam[0] - lam[1:])).sum() - slope * lam[0] * mass / norm[0])
    if abs(half) * size**2 <= UNSEEN * abs(lam[0]):
        return slope, float("inf")
    return slope, float(QUARTER * abs(slope) / abs(half)) if np.isfinite(half) else 0.0


@dataclass(frozen=True)
class FiniteChange:
    """Change of a root [rad/s], and its match: 1 for the mode itself, 0 for a different one.

    `match` is |y^H ((lambda + lambda') M + C) x'| / |y^H Q'(lambda) x|, with the pencil and the
    left vector y of the unchanged mode, and x' of unit mass norm.
    """

    change: complex
    match: float


def followed_root(
    base: QuadraticPencil, family: ModeNeighbourhood, changed: QuadraticPencil
) -> FiniteChange:
    """The family's first mode in a changed pencil.

    Raises
    ------
    ConvergenceError
        Where ARPACK does not converge.
    """
    lam, y = family.lam[0], family.Y[:, 0]
    sigma = lam * (1.0 + OFFSET)
    factor = changed.factor(sigma)
    roots, X = nearest_roots(changed, factor, sigma, CANDIDATES, family.X[:, 0])
    X = X / np.sqrt(np.einsum("ij,ij->j", X.conj(), base.M @ X).real)
    overlaps = (lam + roots) * (y.conj() @ (base.M @ X)) + y.conj() @ (base.C @ X)
    match = np.abs(overlaps) / max(float(np.abs(family.norm[0])), 1e-300)
    best = int(np.argmax(match))
    return FiniteChange(complex(roots[best] - lam), float(match[best]))


def followed_roots(
    base: QuadraticPencil,
    families: Sequence[ModeNeighbourhood],
    changed: Callable[[], QuadraticPencil] | None,
) -> tuple[list[FiniteChange | None], str]:
    """Changes of the first mode of every family in a changed design, and why there are none.

    The reason is empty where all are found, or where `changed`, which returns the pencil of the
    changed design, is None and no mode is followed. One failure leaves all modes without a change.
    """
    if not families:
        return [], ""
    if changed is None:
        return [None] * len(families), ""
    try:
        pencil = changed()
        return [followed_root(base, family, pencil) for family in families], ""
    except SquealstudyError as error:
        return [None] * len(families), str(error)


def figures(lam: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Growth rate [1/s], frequency |lambda|/2 pi [Hz] and damping ratio of roots (n,) [rad/s]."""
    size = np.abs(lam)
    return lam.real, size / (2 * np.pi), -lam.real / np.where(size > 0, size, 1.0)


def figure_slopes(lam: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First-order changes of `figures` with a change `slope` (n,) of the roots, by the chain rule.

    d|lambda| = Re(conj(lambda) d lambda) / |lambda|,
    d zeta = -(Re d lambda + zeta d|lambda|) / |lambda|.
    """
    size = np.where(np.abs(lam) > 0, np.abs(lam), 1.0)
    d_size = (lam.conj() * slope).real / size
    zeta = -lam.real / size
    return slope.real, d_size / (2 * np.pi), -(slope.real + zeta * d_size) / size
