"""Contact laws as immutable parameter sets; those of all points at once.

Kernels have the same arithmetic for one point (`kernels.contact_laws`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.kernels import law_codes as codes

LAW_CODES = {
    "exponential": codes.EXPONENTIAL,
    "unilateral": codes.UNILATERAL,
    "power": codes.POWER,
    "bilateral": codes.BILATERAL,
}


@dataclass(frozen=True)
class ContactLaw:
    """Penalised contact law (THEORY.md eq. (4), (5)).

    Parameters
    ----------
    kind : str
        ``exponential`` (p0, lam), ``unilateral`` (stiffness), ``power`` (stiffness, exponent) or
        ``bilateral`` (stiffness).
    p0 : float
        Pressure at zero gap, Pa (exponential).
    lam : float
        Exponent lambda, 1/m (exponential).
    stiffness : float
        Pa/m, or Pa/m^exponent for the power law.
    exponent : float
        At least 1 (power).

    Raises
    ------
    ModelError
        Unknown kind, or a parameter of that kind that is not positive and finite.
    """

    kind: str = "exponential"
    p0: float = 1e5
    lam: float = 5e5
    stiffness: float = 5e11
    exponent: float = 1.5

    def __post_init__(self) -> None:
        if self.kind not in LAW_CODES:
            raise ModelError(f"contact law '{self.kind}' is none of {', '.join(LAW_CODES)}")
        a, b = self.parameters
        if not (np.isfinite([a, b]).all() and a > 0 and b > 0):
            raise ModelError(f"{self.kind} contact law needs positive parameters, got {a}, {b}")
        if self.kind == "power" and self.exponent < 1:
            raise ModelError(f"power law exponent must be at least 1, got {self.exponent}")

    @property
    def code(self) -> int:
        """Integer code for the kernels."""
        return LAW_CODES[self.kind]

    @property
    def parameters(self) -> tuple[float, float]:
        """The two parameters (a, b) of the kernels."""
        if self.kind == "exponential":
            return float(self.p0), float(self.lam)
        return float(self.stiffness), float(self.exponent) if self.kind == "power" else 1.0

    def evaluate(self, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pressure p(g) [Pa] and tangent -dp/dg [Pa/m] at gaps g (n,) [m]."""
        g = np.asarray(g, dtype=float)
        a, b = self.parameters
        if self.kind == "exponential":
            p = a * np.exp(np.minimum(-b * g, codes.MAX_EXPONENT))
            return p, b * p
        if self.kind == "bilateral":
            return -a * g, np.full_like(g, a)
        is_open = g >= 0.0
        depth = np.where(is_open, 0.0, -g)  # NaN stays NaN
        if self.kind == "unilateral":
            return a * depth, np.where(is_open, 0.0, a)
        p = a * depth**b
        return p, b * p / np.where(is_open, 1.0, depth)

    def gap_at(self, p: float) -> float:
        """The gap [m] at which the pressure is p > 0 [Pa]: where a static solution starts."""
        a, b = self.parameters
        if self.kind == "exponential":
            return float(-np.log(p / a) / b)
        return float(-((p / a) ** (1 / b)))

    def gap_scale(self, p: float) -> float:
        """Change of gap [m] over which the law at pressure p changes by its own size."""
        a, b = self.parameters
        return 1 / b if self.kind == "exponential" else max((p / a) ** (1 / b), 1e-300)
