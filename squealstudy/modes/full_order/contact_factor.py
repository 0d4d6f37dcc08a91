"""Solves with the stiffness of any working point by one factor of a symmetric one.

With K_h = K_elastic + K_springs + k_c N^T A N factored once, contact and friction of a design point
are of low rank, r of the contact's independent rows N = S_N Z_N, and its stiffness
K = K_h + N^T d N + T^T w N needs no factor of its own (Woodbury 1950):

    K^-1 b = K_h^-1 (b - (N^T d + T^T w) S_N y)
    (1 + Z_N K_h^-1 (N^T d + T^T w) S_N) y = Z_N K_h^-1 b
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.factor import SINGULAR, RefinedFactor, automatic_backend, factorise
from squealstudy.models.assembly import Assembly
from squealstudy.reduction.contact_space import ContactRows, contact_compliances

# backward error up to which solves are not refined: of a brake it is some 1e-14
MAX_UNREFINED_BACKWARD_ERROR = 1e-12


@dataclass(frozen=True)
class HeldStiffness:
    """K_h of an assembly, factored, and its compliances between contact rows.

    Attributes
    ----------
    normal : ndarray (nc,)
        Contact stiffness k_c A in it, N/m.
    factor : RefinedFactor (n_dof, n_dof)
    rows : ContactRows
    C_NN, C_TN : ndarray (r, r), (t, r)
        Z_N K_h^-1 Z_N^T and Z_T K_h^-1 Z_N^T, m/N.
    """

    normal: np.ndarray
    factor: RefinedFactor = field(repr=False)
    rows: ContactRows = field(repr=False)
    C_NN: np.ndarray = field(repr=False)
    C_TN: np.ndarray = field(repr=False)

    @staticmethod
    def of(assembly: Assembly, k_c: float | np.ndarray) -> HeldStiffness:
        """Factor of an assembly with contact stiffness per area k_c [Pa/m]; ConvergenceError."""
        K = assembly.K_el + assembly.K_springs() + assembly.K_contact(k_c)
        factor, rows = factorise(K, definite=True), ContactRows.of(assembly.contact)
        compliances = contact_compliances(rows, factor.lean(), assembly.n_dof)
        return HeldStiffness(k_c * assembly.contact.area, factor, rows, *compliances)

    @staticmethod
    def pays(assembly: Assembly) -> bool:
        """Whether the factor of a symmetric matrix is the cheaper one, at this size and here."""
        return automatic_backend(assembly.n_dof, definite=True) == "cholmod"


class ContactFactor(RefinedFactor):
    """Solves with a stiffness that differs from the held one in contact and friction alone.

    Parameters
    ----------
    stiffness : HeldStiffness
    A : sparse (n, n)
        The stiffness.
    normal, coupling : ndarray (nc,)
        Its contact stiffness and its friction (`ContactWeights`), N/m.

    Raises
    ------
    ConvergenceError
        ``singular``.
    """

    def __init__(
        self, stiffness: HeldStiffness, A: sp.spmatrix, normal: np.ndarray, coupling: np.ndarray
    ) -> None:
        self.A, self._given = A.tocsr(), (stiffness, A, normal, coupling)
        rows = stiffness.rows
        self._held = stiffness
        self._pressed = (rows.S_N.T @ sp.diags(normal - stiffness.normal) @ rows.S_N).tocsr()
        self._rubbed = (rows.S_T.T @ sp.diags(coupling) @ rows.S_N).tocsr()
        core = (self._pressed.T @ stiffness.C_NN.T).T + (self._rubbed.T @ stiffness.C_TN).T
        core[np.diag_indices_from(core)] += 1.0
        factorised, self._solve = la.get_lapack_funcs(("getrf", "getrs"), (core,))
        self._lu, self._pivots, lapack_status = factorised(core)
        if lapack_status:
            raise ConvergenceError(SINGULAR, "a stiffness matrix is singular")

    def __reduce__(self) -> tuple[type[ContactFactor], tuple[object, ...]]:
        """See `RefinedFactor`."""
        return type(self), self._given

    def solve_once(self, b: np.ndarray) -> np.ndarray:
        """See `RefinedFactor.solve_once`."""
        stiffness, rows = self._held.factor, self._held.rows
        x = stiffness.solve_once(b)
        y, _ = self._solve(self._lu, self._pivots, rows.Z @ x[rows.normal])
        forces = np.zeros(b.shape)
        forces[rows.normal] = rows.Z.T @ (self._pressed @ y)
        forces[rows.sliding] += self._rubbed @ y
        solution: np.ndarray = x - stiffness.solve_once(forces)
        return solution

    def lean(self) -> Callable[[np.ndarray], np.ndarray]:
        """See `RefinedFactor.lean`; roots that this spoils are seen by their residuals."""
        return self.solve_once if self.plain_error <= MAX_UNREFINED_BACKWARD_ERROR else self.solve
