"""Change of an assembly by a structural parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from squealstudy.laws.own_friction import has_own
from squealstudy.laws.spring import evaluate_springs
from squealstudy.linalg.sparse_qep import LowRankSum
from squealstudy.models.assembly import ContactInterface
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.working_point import WorkingPoint


@dataclass(frozen=True)
class AssemblyChange:
    """Derivatives of an assembly by one structural parameter.

    Attributes
    ----------
    mass : csr_matrix (n_dof, n_dof)
        Derivative of the mass.
    stiffness, static_stiffness : LowRankSum (n_dof, n_dof)
        Derivatives of the stiffness of components with their changed modes, and of springs;
        `static_stiffness` is that at rest.
    dampers : LowRankSum (n_dof, n_dof)
        Derivative of the damping of component modes.
    damping : csr_matrix (n_dof, n_dof)
        Derivative of the components' own damping and gyroscopic terms.
    load : ndarray (n_dof,)
        Derivative of nodal forces by a unit pressure, N/Pa.
    constant_load : ndarray (n_dof,)
        Derivative of constant nodal forces, N.
    area : ndarray (nc,)
        Derivative of the areas of the contact points, m2.
    frictional : ndarray (nc,)
        Derivative of their factors on the friction coefficient.
    opening : ndarray (nc,)
        Derivative of the gaps without load, m.
    ends : (first, second, step)
        Springs that are not linear (ContactInterface.spring_points) at both ends, and the step of
        the parameter between them.
    own : (first, second)
        Points' own friction (ContactInterface.own_friction) at both ends.
    """

    mass: sp.csr_matrix
    stiffness: LowRankSum
    static_stiffness: LowRankSum
    dampers: LowRankSum
    damping: sp.csr_matrix
    load: np.ndarray
    constant_load: np.ndarray
    area: np.ndarray
    frictional: np.ndarray
    opening: np.ndarray
    ends: tuple[np.ndarray, np.ndarray, float]
    own: tuple[np.ndarray, np.ndarray]

    def friction_at(
        self, operating: OperatingPoint, contact: ContactInterface, point: WorkingPoint
    ) -> np.ndarray:
        """Derivatives (3, nc) of mu, dmu/ds and dmu/dp at a working point, by own friction only."""
        p = point.contact_pressure
        if not has_own(self.own[0]):
            return np.zeros((3, len(p)))
        ends = [np.array(operating.friction_at(p, contact.speed_factor, x)) for x in self.own]
        change: np.ndarray = (ends[0] - ends[1]) / self.ends[2]
        return change

    def springs_at(self, gap: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (nc,) of pressure and tangent at gaps (nc,), zero except at springs."""
        first, second, step = self.ends
        slopes = np.zeros((2, len(gap)))
        if len(first):
            e = gap[len(gap) - len(first) :]
            ends = [np.array(evaluate_springs(e, springs)) for springs in (first, second)]
            slopes[:, len(gap) - len(first) :] = (ends[0] - ends[1]) / step
        return slopes[0], slopes[1]
