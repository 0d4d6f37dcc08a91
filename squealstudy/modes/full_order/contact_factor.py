"""Solves with the stiffness of any working point by one factor of a symmetric stiffness.

K_h = K_elastic + K_springs + k_c N^T A N is factored once. A working point has the stiffness
K = K_h + N^T d N + T^T w N, with changes d of the contact stiffness and friction w. The change is
of low rank: N = S_N Z_N has r independent rows Z_N. So K needs no factor of its own (Woodbury
1950):

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

# backward error up to which solves are not refined; for a brake it is about 1e-14
MAX_UNREFINED_BACKWARD_ERROR = 1e-12


@dataclass(frozen=True)
class HeldStiffness:
    """The factored stiffness K_h of an assembly, and its compliances between contact rows.

    Attributes
    ----------
    normal : ndarray (nc,)
        Contact stiffness k_c A that K_h holds, N/m.
    factor : RefinedFactor (n_dof, n_dof)
        Factor of K_h.
    rows : ContactRows
        Independent rows Z_N (r, n_dof) and Z_T (t, n_dof) of the contact.
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
        """K_h of an assembly with contact stiffness per area k_c [Pa/m].

        Raises
        ------
        ConvergenceError
            Where it is singular.
        """
        K = assembly.K_el + assembly.K_springs() + assembly.K_contact(k_c)
        factor, rows = factorise(K, definite=True), ContactRows.of(assembly.contact)
        compliances = contact_compliances(rows, factor.lean(), assembly.n_dof)
        return HeldStiffness(k_c * assembly.contact.area, factor, rows, *compliances)

    @staticmethod
    def pays(assembly: Assembly) -> bool:
        """Whether K_h costs less to factor than a stiffness with friction.

        That holds where CHOLMOD is installed and chosen for a matrix of this size.
        """
        return automatic_backend(assembly.n_dof, definite=True) == "cholmod"


class ContactFactor(RefinedFactor):
    """Solves with a stiffness that differs from K_h in contact and friction alone.

    Parameters
    ----------
    stiffness : HeldStiffness
        The factored K_h.
    A : sparse (n, n)
        The stiffness to solve with.
    normal, coupling : ndarray (nc,)
        Contact stiffness and friction of A (`ContactWeights`), N/m.

    Raises
    ------
    ConvergenceError
        With the reason ``singular``, where A is singular.
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
        """See `RefinedFactor.lean`; the residuals of roots show where a solve was too inexact."""
        return self.solve_once if self.plain_error <= MAX_UNREFINED_BACKWARD_ERROR else self.solve
