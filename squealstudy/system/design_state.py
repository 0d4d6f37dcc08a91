"""One design point as the mechanics sees it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.models.operating import OperatingPoint

ModeKey = tuple[str, int]  # component, free-free mode numbered from 1


@dataclass(frozen=True)
class DesignState:
    """Operating point, changes of component modes, and modal damping of the assembly.

    Attributes
    ----------
    operating : OperatingPoint
    frequency_scale : mapping of (component, mode) -> float
        Factor on the free-free frequency.
    mode_damping : mapping of (component, mode) -> float
        Damping ratio of the component mode at its scaled frequency.
    damping_ratio : float
        Damping ratio of every real mode of the assembly at its working point.
    assembly_damping : mapping of int -> float
        Damping ratios of single real modes of the assembly, numbered from 1 as they ascend in
        frequency at the working point without friction; each replaces `damping_ratio`.
    stiffness_damping : float
        Rayleigh's beta, s: C has beta times the symmetric stiffness of the working point.
    """

    operating: OperatingPoint
    frequency_scale: Mapping[ModeKey, float] = field(default_factory=dict)
    mode_damping: Mapping[ModeKey, float] = field(default_factory=dict)
    damping_ratio: float = 0.0
    assembly_damping: Mapping[int, float] = field(default_factory=dict)
    stiffness_damping: float = 0.0

    def stiffness_changes(self, omega: Mapping[ModeKey, float]) -> dict[ModeKey, float]:
        """Change of the modal stiffness (scale^2 - 1) omega^2 of each scaled mode, (rad/s)^2."""
        return {
            key: (scale**2 - 1.0) * omega[key] ** 2 for key, scale in self.frequency_scale.items()
        }

    def modal_dampers(self, omega: Mapping[ModeKey, float]) -> dict[ModeKey, float]:
        """Damping 2 zeta omega of each damped component mode at its scaled frequency, rad/s."""
        return {
            key: 2.0 * zeta * self.frequency_scale.get(key, 1.0) * omega[key]
            for key, zeta in self.mode_damping.items()
        }

    def assembly_damping_ratios(self, n: int) -> np.ndarray:
        """Damping ratio of each of the `n` real modes of the assembly (n,).

        Raises
        ------
        ParameterError
            A damped mode beyond the `n`.
        """
        zeta = np.full(n, self.damping_ratio)
        for mode, value in self.assembly_damping.items():
            if not 1 <= mode <= n:
                raise ParameterError(
                    f"modes[{mode}].damping_ratio", f"the assembly has modes 1 to {n} here"
                )
            zeta[mode - 1] = value
        return zeta
