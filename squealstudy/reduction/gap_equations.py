"""Equations F(g) = 0 for the gaps of steady sliding, and their Jacobian (THEORY.md (13), (14)).

There are more contact points than freedoms r of their nodes: dF/dg = I + S_N W, where W has r rows,
and a factorised r x r matrix solves with it (Woodbury 1950).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy.linalg as la

from squealstudy.laws.spring import evaluate_points
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.contact_space import ContactSpace

Changes = Mapping[int, float]  # column of U -> change of modal stiffness, (rad/s)^2


class GapEquations:
    """Imbalance of the gaps, at one operating point or at several at once.

    Changes of components enter each evaluation by Woodbury's identity; compliances stay the same.

    Parameters
    ----------
    space : ContactSpace
    operating : sequence of OperatingPoint (b)
    changes : sequence of mapping of column of U -> float, or None
        Changes of modal stiffness at each operating point, (rad/s)^2; None for no changes.
    """

    def __init__(
        self,
        space: ContactSpace,
        operating: Sequence[OperatingPoint],
        changes: Sequence[Changes] | None = None,
    ) -> None:
        self.space, self.operating = space, operating
        changes = changes or [{}] * len(operating)
        self._columns = sorted({j for c in changes for j, dk in c.items() if dk})
        self._cores = [self._core(c) for c in changes]
        self._load = np.array([[o.brake_pressure, 1.0] for o in operating])
        no_forces = np.zeros((len(operating), len(space.area)))
        self._size = np.abs(self._movement(no_forces, no_forces)).max(axis=1)

    def _core(self, changes: Changes) -> np.ndarray:
        if not (j := self._columns):
            return np.zeros((0, 0))
        D = np.diag([changes.get(column, 0.0) for column in j])
        return np.linalg.solve(np.eye(len(j)) + D @ self.space.C_UU[np.ix_(j, j)], D)

    def _movement(self, s: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Changes N K^-1 (N^T s - T^T t + loads) of the gaps of changed structures, (b, nc) [m]."""
        space, j = self.space, self._columns
        displacement = space.coordinates(s, t) + self._load @ space.C_Nf.T
        if j:
            shape_forces = (
                space.normal_components(s) @ space.C_NU[:, j]
                - space.sliding_components(t) @ space.C_TU[:, j]
            )
            shape_forces += self._load @ space.C_fU[:, j]
            pairs = zip(self._cores, shape_forces, strict=True)
            change_forces = np.array([core @ force for core, force in pairs])
            displacement -= change_forces @ space.C_NU[:, j].T
        return space.gaps(displacement)

    def imbalance(self, g: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """F(g) [m], pressure [Pa] and tangent -dp/dg [Pa/m] at gaps g [m], each (b, nc)."""
        space = self.space
        pairs = [
            evaluate_points(o.law, space.spring_points, row)
            for o, row in zip(self.operating, g, strict=True)
        ]
        p, kappa = (np.array(part) for part in zip(*pairs, strict=True))
        by_point = zip(self.operating, p, strict=True)
        point_factors = (space.speed_factor, space.own_friction)
        drag = np.array([o.traction(row, *point_factors) for o, row in by_point])
        s = space.area * (p + space.k_c * (g - space.gap0))
        F = g - space.gap0 - self._movement(s, space.area * space.frictional * drag)
        return F, p, kappa

    def relative(self, F: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Largest imbalance (b,), over the sum of the largest movement under load and gap."""
        size: np.ndarray = self._size + np.abs(g).max(axis=1) + 1e-300
        return np.abs(F).max(axis=1) / size


class GapJacobian:
    """dF/dg of the gap equations at a contact state, factorised.

    Parameters
    ----------
    space : ContactSpace
        Contact space with the component changes.
    point : OperatingPoint
    p, kappa : ndarray (nc,)
        Pressures [Pa] and tangents [Pa/m].

    Raises
    ------
    LinAlgError
        The Jacobian is singular.
    """

    def __init__(
        self, space: ContactSpace, point: OperatingPoint, p: np.ndarray, kappa: np.ndarray
    ) -> None:
        friction = point.friction_at(p, space.speed_factor, space.own_friction)
        drag_slope = space.frictional * friction.following(p)
        self._space = space
        self._normal = space.area * (kappa - space.k_c)
        self._sliding = space.area * drag_slope * kappa
        normal, sliding = space.by_point
        forces = self._normal[:, None] * normal - self._sliding[:, None] * sliding
        core = space.normal_components(forces.T).T  # the transpose of the r x r matrix
        core[np.diag_indices_from(core)] += 1.0
        factorise, self._solve = la.get_lapack_funcs(("getrf", "getrs"), (core,))
        self._lu, self._pivots, lapack_status = factorise(core.T, overwrite_a=True)
        if lapack_status:
            raise la.LinAlgError("dF/dg is singular")

    def solve(self, F: np.ndarray) -> np.ndarray:
        """(dF/dg)^-1 F of imbalances F (nc,) or (b, nc)."""
        displacement = self._space.coordinates(self._normal * F, self._sliding * F)
        x, _ = self._solve(self._lu, self._pivots, displacement.T)
        return F - self._space.gaps(x.T)
