"""The properties of contact points that friction depends on."""

from __future__ import annotations

from typing import Protocol

import numpy as np


class ContactPoints(Protocol):
    """Contact points of a structure, whatever its coordinates are."""

    @property
    def area(self) -> np.ndarray:
        """Areas of the contact points (nc,), m2."""
        ...

    @property
    def frictional(self) -> np.ndarray:
        """Factor (nc,) on the friction coefficient, 0 without friction."""
        ...

    @property
    def speed_factor(self) -> np.ndarray:
        """Sliding speed of each point (nc,) over the imposed one; 0 where none is imposed."""
        ...

    @property
    def own_friction(self) -> np.ndarray:
        """Friction of single points in place of the study's (nc, k), see laws/own_friction.py."""
        ...
