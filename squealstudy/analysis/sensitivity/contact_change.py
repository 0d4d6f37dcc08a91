"""First-order change of the contact points' weights in the linearised system.

K has N^T k_n N - T^T (mu k_n) N, C has T_perp^T (mu A p/|w0|) T_perp + T^T (dmu/ds A p) T: each
term is fixed rows times weights, one a contact point, and only the weights depend on the design.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.analysis.sensitivity.law_change import FrictionChange, tangent_slope
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.working_point import WorkingPoint


@dataclass(frozen=True)
class ContactChange:
    """Derivatives (nc,) of the four weights by one parameter.

    Attributes
    ----------
    normal : ndarray
        Of k_n, N/m.
    coupling : ndarray
        Of mu k_n, N/m.
    across : ndarray
        Of the friction damping mu A p / |w0| across sliding, N s/m.
    along : ndarray
        Of dmu/ds A p along sliding, N s/m.
    """

    normal: np.ndarray
    coupling: np.ndarray
    across: np.ndarray
    along: np.ndarray


@dataclass(frozen=True)
class ContactWeights:
    """The contact points at a working point, to be differentiated."""

    operating: OperatingPoint
    point: WorkingPoint
    area: np.ndarray
    frictional: np.ndarray

    def change(
        self,
        gap: np.ndarray,
        law: tuple[np.ndarray, np.ndarray] | None = None,
        friction: FrictionChange | None = None,
        area: np.ndarray | None = None,
    ) -> ContactChange:
        """Total derivative of the weights.

        Parameters
        ----------
        gap : ndarray (nc,)
            Derivative of the gaps: the motion of the working point.
        law : (dp, dkappa) or None
            Derivatives of pressure and tangent at fixed gaps.
        friction : FrictionChange or None
        area : ndarray (nc,) or None
            Derivative of the points' areas.
        """
        w, operating = self.point, self.operating
        friction = friction or FrictionChange()
        dp, dkappa = law or (np.zeros_like(gap), np.zeros_like(gap))
        dp = dp - w.tangent * gap
        dkappa = dkappa + tangent_slope(operating.law, w.gap) * gap
        dA = np.zeros_like(gap) if area is None else area
        normal_force, d_force = self.area * w.pressure, self.area * dp + dA * w.pressure
        k_n, d_k_n = self.area * w.tangent, self.area * dkappa + dA * w.tangent
        mu, v = operating.mu_steady, operating.sliding_speed
        d_drag = (friction.mu - mu * friction.speed / v) * normal_force + mu * d_force
        falling = friction.slope * normal_force + operating.friction_slope * d_force
        return ContactChange(
            d_k_n,
            self.frictional * (friction.mu * k_n + mu * d_k_n),
            self.frictional * d_drag / v,
            self.frictional * falling,
        )
