"""How the working point moves: implicit differentiation of its equations.

The gaps obey F(g; theta) = 0 (reduction.working_point), so dF/dg dg = -dF/dtheta. The right side is
the static response N K0^-1 of forces out of balance at fixed gaps: K_s u = f + N^T A p - mu T^T A p
with u the static displacement and K_s the stiffness without contact.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.linalg as la

from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.contact_space import ContactSpace
from squealstudy.reduction.working_point import WorkingPoint


class WorkingPointMotion:
    """Derivatives of the gaps at one working point, from one factorisation of dF/dg.

    Parameters
    ----------
    space : ContactSpace
        Unchanged, of the prepared structure.
    stiffness_changes : mapping of column of U -> float
        Changes of component modes' modal stiffness in force, (rad/s)^2.
    operating : OperatingPoint
    point : WorkingPoint
    """

    def __init__(
        self,
        space: ContactSpace,
        stiffness_changes: Mapping[int, float],
        operating: OperatingPoint,
        point: WorkingPoint,
    ) -> None:
        self._space, self._operating = space, operating
        self._changes = {j: dk for j, dk in stiffness_changes.items() if dk}
        self._now = space.changed(self._changes)
        following = operating.friction_at(point.pressure).following(point.pressure)
        self._grip = following * space.frictional
        self.point = point
        A = space.area
        J = self._now.H_NN * (A * (point.tangent - space.k_c))
        J -= self._now.H_NT * (A * self._grip * point.tangent)
        J[np.diag_indices_from(J)] += 1.0
        self._lu = la.lu_factor(J, overwrite_a=True, check_finite=False)
        self._normal = A * (point.pressure + space.k_c * (point.gap - space.gap0))
        self._sliding = A * space.frictional * operating.traction(point.pressure)

    def solve(self, imbalance: np.ndarray) -> np.ndarray:
        """Motion dg (nc,) from dF/dtheta (nc,) at fixed gaps."""
        moved: np.ndarray = la.lu_solve(self._lu, -imbalance, check_finite=False)
        return moved

    def by_friction(self, mu: float | np.ndarray) -> np.ndarray:
        """Motion by a change of the friction coefficient, a number or (nc,)."""
        if not np.any(mu):
            return np.zeros(len(self.point.gap))
        drag = self._space.area * self._space.frictional * self.point.pressure
        return self.solve(self._now.H_NT @ (drag * mu))

    def by_pressure(self) -> np.ndarray:
        """Motion by the brake pressure, m/Pa."""
        return self.solve(-self._now.H_Nf[:, 0])

    def by_law(self, dp: np.ndarray) -> np.ndarray:
        """Motion by a change dp (nc,) of the pressure at fixed gaps."""
        force = self._space.area * dp
        return self.solve(self._now.H_NT @ (self._grip * force) - self._now.H_NN @ force)

    def by_mode_stiffness(self, column: int) -> np.ndarray:
        """Motion by a component mode's modal stiffness, m s^2: column of U of the space."""
        h_N, h_T, h_f = self._shape_compliances(column)
        loads = np.array([self._operating.pressure, 1.0])
        displacement = h_f @ loads + h_N @ self._normal - h_T @ self._sliding
        return self.solve(h_N * displacement)

    def _shape_compliances(self, column: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """N, T and load compliances to the shape U of one mode, with the changes in force."""
        s = self._space
        parts = (s.H_NU, s.H_TU, s.H_fU)
        own = [np.asarray(H[:, column]) for H in parts]
        if not self._changes:
            return own[0], own[1], own[2]
        j = np.fromiter(self._changes.keys(), dtype=int)
        d = np.fromiter(self._changes.values(), dtype=float)
        core = np.eye(len(j)) + d[:, None] * s.H_UU[np.ix_(j, j)]
        share = la.solve(core, d * s.H_UU[j, column])
        changed = [h - H[:, j] @ share for h, H in zip(own, parts, strict=True)]
        return changed[0], changed[1], changed[2]
