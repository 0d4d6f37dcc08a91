"""Interfaces as observation matrices and point weights, never only as assembled matrices.

Stiffness, pressure, friction and law so stay parameters (THEORY.md eq. (1), (2)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.laws import ContactLaw


@dataclass(frozen=True)
class ContactInterface:
    """Contact points with friction; degrees of freedom are those of the whole assembly.

    Attributes
    ----------
    N : csr_matrix (n_points, n_dof)
        Gap g = gap0 + N q, positive when open.
    T : csr_matrix (n_points, n_dof)
        Relative displacement of the sliding body under the other, along the sliding direction.
    T_perp : csr_matrix (n_points, n_dof)
        The same across the sliding direction (both in the contact plane).
    area : ndarray (n_points,)
        m2, positive.
    gap0 : ndarray (n_points,)
        Initial gap, m.
    radius : ndarray (n_points,)
        Arm of the friction force about the axis of rotation, m.
    law : ContactLaw
        Default law.
    frictional : ndarray (n_points,)
        Factor on the friction coefficient: 1, or 0 for contact without friction.
    """

    N: sp.csr_matrix
    T: sp.csr_matrix
    T_perp: sp.csr_matrix
    area: np.ndarray
    gap0: np.ndarray
    radius: np.ndarray
    law: ContactLaw
    frictional: np.ndarray

    def __post_init__(self) -> None:
        n = self.n_points
        for name in ("area", "gap0", "radius", "frictional"):
            value = getattr(self, name)
            if value.shape != (n,) or not np.isfinite(value).all():
                raise ModelError(f"contact interface: '{name}' needs {n} finite values")
        for name in ("N", "T", "T_perp"):
            if getattr(self, name).shape != self.N.shape:
                raise ModelError(f"contact interface: '{name}' differs in shape from N")
            if not np.isfinite(getattr(self, name).data).all():
                raise ModelError(f"contact interface: '{name}' has values that are not finite")
        if not (self.area > 0).all():
            raise ModelError("contact interface: every area must be positive")

    @property
    def n_points(self) -> int:
        """Number of contact points."""
        return int(self.N.shape[0])


@dataclass(frozen=True)
class SpringInterface:
    """Linear springs, tied layers and points to ground: force = -B^T diag(stiffness) B q.

    Attributes
    ----------
    name : str
        For messages and tables.
    B : csr_matrix (n_springs, n_dof)
        Elongations from the assembly's degrees of freedom.
    stiffness : ndarray (n_springs,)
        N/m (stiffness per area times area for layers), not negative.
    in_static : bool
        False for a spring that is there in vibration only: the piston, whose hydraulic force pair
        it would absorb in the static solve.
    """

    name: str
    B: sp.csr_matrix
    stiffness: np.ndarray
    in_static: bool = True

    def __post_init__(self) -> None:
        if self.stiffness.shape != (self.B.shape[0],):
            raise ModelError(f"interface '{self.name}': one stiffness a row of B is needed")
        if not (np.isfinite(self.stiffness).all() and (self.stiffness >= 0).all()):
            raise ModelError(f"interface '{self.name}': stiffness must be finite, not negative")

    def matrix(self) -> sp.csr_matrix:
        """Assembled stiffness (n_dof, n_dof), N/m."""
        return (self.B.T @ sp.diags(self.stiffness) @ self.B).tocsr()
