"""One design point as the mechanics sees it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

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
    """

    operating: OperatingPoint
    frequency_scale: Mapping[ModeKey, float] = field(default_factory=dict)
    mode_damping: Mapping[ModeKey, float] = field(default_factory=dict)
    damping_ratio: float = 0.0

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
