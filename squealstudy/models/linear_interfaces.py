"""Linear interfaces of an assembly: springs, layers, dampers and stress stiffness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.matrix_checks import check_size, check_symmetric


@dataclass(frozen=True)
class SpringInterface:
    """Linear springs, tied layers and points to ground: force = -B^T diag(stiffness) B q.

    Attributes
    ----------
    name : str
        Name for messages and tables.
    B : csr_matrix (n_springs, n_dof)
        Elongations from the assembly's degrees of freedom.
    stiffness : ndarray (n_springs,)
        Stiffness, N/m (per area times area for layers), or N m for rotations; not negative.
    in_static : bool
        False for a spring that acts in vibration only, such as that of a piston, which would absorb
        the hydraulic force pair in the static solution.
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
        check_size(f"interface '{self.name}': stiffness", self.stiffness)

    def matrix(self) -> sp.csr_matrix:
        """Assembled stiffness (n_dof, n_dof), N/m."""
        return (self.B.T @ sp.diags(self.stiffness) @ self.B).tocsr()

    @property
    def n_dof(self) -> int:
        """Number of degrees of freedom of the assembly."""
        return int(self.B.shape[1])

    def energy(self, u: np.ndarray) -> float:
        """u^H K u [J] of displacements u (n_dof,) [m], twice the elastic energy."""
        relative_motion = self.B @ u
        return float(self.stiffness @ (relative_motion.real**2 + relative_motion.imag**2))


@dataclass(frozen=True)
class DamperInterface:
    """Linear dampers: force = -B^T diag(damping) B q'.

    Attributes
    ----------
    name : str
        Name for messages and tables.
    B : csr_matrix (n_dampers, n_dof)
        Elongations from the assembly's degrees of freedom.
    damping : ndarray (n_dampers,)
        Damping, N s/m, or N m s for rotations; not negative.
    """

    name: str
    B: sp.csr_matrix
    damping: np.ndarray

    def __post_init__(self) -> None:
        if self.damping.shape != (self.B.shape[0],):
            raise ModelError(f"interface '{self.name}': one damping a row of B is needed")
        if not (np.isfinite(self.damping).all() and (self.damping >= 0).all()):
            raise ModelError(f"interface '{self.name}': damping must be finite, not negative")
        check_size(f"interface '{self.name}': damping", self.damping)

    def matrix(self) -> sp.csr_matrix:
        """Assembled damping (n_dof, n_dof), N s/m."""
        return (self.B.T @ sp.diags(self.damping) @ self.B).tocsr()

    @property
    def n_dof(self) -> int:
        """Number of degrees of freedom of the assembly."""
        return int(self.B.shape[1])

    def loss(self, u: np.ndarray) -> float:
        """u^H C u of displacements u (n_dof,)."""
        relative_motion = self.B @ u
        return float(self.damping @ (relative_motion.real**2 + relative_motion.imag**2))


@dataclass(frozen=True)
class StressStiffness:
    """Stiffness that the stresses of a loaded state add in vibration about it.

    Attributes
    ----------
    K : csr_matrix (n_dof, n_dof)
        Stress stiffness, symmetric, not definite, N/m.
    name : str
    in_static : bool
        As in SpringInterface. False for stress stiffness, as steady sliding itself is computed for
        small displacements.
    """

    K: sp.csr_matrix
    name: str = "stress_stiffening"
    in_static: bool = False

    def __post_init__(self) -> None:
        check_symmetric(f"interface '{self.name}': stiffness", self.K, self.n_dof)

    @property
    def n_dof(self) -> int:
        """Number of degrees of freedom of the assembly."""
        return int(self.K.shape[0])

    def matrix(self) -> sp.csr_matrix:
        """Assembled stiffness (n_dof, n_dof), N/m."""
        return self.K

    def energy(self, u: np.ndarray) -> float:
        """u^H K u [J] of displacements u (n_dof,) [m], twice the elastic energy."""
        return float(np.vdot(u, self.K @ u).real)
