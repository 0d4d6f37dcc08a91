"""A component: its own degrees of freedom, mass, elastic stiffness and where its nodes are."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError


@dataclass(frozen=True)
class Component:
    """One elastic (or rigid) body of an assembly.

    Attributes
    ----------
    name : str
        Used in parameter names and in the columns ``energy_<name>``.
    M, K : csr_matrix (n, n)
        Mass [kg], positive definite, and elastic stiffness [N/m], positive semi-definite.
    coordinates : ndarray (n_nodes, 3)
        Node coordinates, m; n = 3 n_nodes where there are any, empty for minimal models.
    surfaces : dict of name -> ndarray
        Node numbers of named surfaces, for plots and selections.
    correspondence : csr_matrix (s, n) or None
        Rows that observe the same places of the component whatever the values of the model's
        parameters, weighted by the square root of the mass that each stands for: mode shapes of
        two structures are compared there. None: the degrees of freedom themselves.

    Raises
    ------
    ModelError
        Wrong shapes, non-finite values, asymmetry, a diagonal that rules out definiteness.
    """

    name: str
    M: sp.csr_matrix
    K: sp.csr_matrix
    coordinates: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    surfaces: dict[str, np.ndarray] = field(default_factory=dict)
    correspondence: sp.csr_matrix | None = None

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise ModelError(f"component name '{self.name}' must be an identifier")
        for label, A in (("mass", self.M), ("stiffness", self.K)):
            check_symmetric(f"component '{self.name}': {label} matrix", A, self.n_dof)
        if (self.M.diagonal() <= 0).any():
            raise ModelError(f"component '{self.name}': mass matrix is not positive definite")
        if (self.K.diagonal() < 0).any():
            raise ModelError(f"component '{self.name}': stiffness is not positive semi-definite")
        if self.correspondence is not None and self.correspondence.shape[1] != self.n_dof:
            raise ModelError(
                f"component '{self.name}': its correspondence does not have {self.n_dof} columns"
            )
        if len(self.coordinates) and 3 * len(self.coordinates) != self.n_dof:
            raise ModelError(
                f"component '{self.name}': {len(self.coordinates)} nodes do not match "
                f"{self.n_dof} degrees of freedom"
            )

    @property
    def n_dof(self) -> int:
        """Number of degrees of freedom."""
        return int(self.M.shape[0])

    @property
    def seen(self) -> sp.csr_matrix:
        """The rows of `correspondence`, whether given or not."""
        if self.correspondence is not None:
            return self.correspondence
        return sp.diags(np.sqrt(self.M.diagonal())).tocsr()

    @property
    def mass(self) -> float:
        """Total mass [kg], from a unit translation along x (3-D components)."""
        t = np.zeros(self.n_dof)
        t[::3] = 1.0
        return float(t @ (self.M @ t))


def check_symmetric(what: str, A: sp.spmatrix, n: int) -> None:
    """Raise ModelError unless `A` is (n, n), finite and symmetric to round-off."""
    if A.shape != (n, n):
        raise ModelError(f"{what} has shape {A.shape}, expected {(n, n)}")
    if not np.isfinite(A.data).all():
        raise ModelError(f"{what} has values that are not finite")
    skew = abs(A - A.T)
    if skew.nnz and skew.max() > 1e-12 * max(abs(A).max(), 1e-300):
        raise ModelError(f"{what} is not symmetric")
