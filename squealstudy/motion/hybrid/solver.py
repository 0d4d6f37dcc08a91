"""The fixed Jacobian of the hybrid Newmark scheme: factored once a size of step, condensed once."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.errors import ConvergenceError
from squealstudy.kernels import hybrid_layout as layout
from squealstudy.linalg.factor import symmetric_lu

BLOCK = 64  # right-hand sides a call of SuperLU
ROUND_OFF = 1e-12  # forces below this share of the contact forces at the start mean nothing


class StepSolver:
    """J = M + (h beta/2 + h^2/4) K of the sparse part, and its compliance at the contact points.

    Inertia dominates J (its condition is about (h omega_max / 2)^2), so that solves need no
    refinement. The modes are those of M and K, so that their damping changes J^-1 by
    phi diag(1/j - 1/j_s) phi^T, without Woodbury's identity.

    Attributes
    ----------
    level : hybrid_layout.Level
    fill : int
        Entries of the triangular factors.
    solves : int
        Forward/back solves done in the run.

    Raises
    ------
    ConvergenceError
        ``singular_jacobian``.
    """

    def __init__(self, M: sp.spmatrix, model: layout.Hybrid, h: float, forces: np.ndarray) -> None:
        K = sp.csr_matrix((model.K.data, model.K.indices, model.K.indptr), shape=M.shape)
        J = M + (0.5 * h * model.beta + 0.25 * h * h) * K
        try:
            self._lu = symmetric_lu(J)
        except RuntimeError as error:
            raise ConvergenceError("singular_jacobian", f"hybrid Jacobian: {error}") from error
        self.fill = int(self._lu.L.nnz + self._lu.U.nnz)
        self.solves = 0
        self.level = self._condense(model, h, forces)

    def solve(self, b: np.ndarray) -> np.ndarray:
        """J^-1 b (n,)."""
        self.solves += 1
        x: np.ndarray = self._lu.solve(b)
        return x

    def _condense(self, model: layout.Hybrid, h: float, forces: np.ndarray) -> layout.Level:
        n, n_rows = len(model.K.indptr) - 1, len(model.B.indptr) - 1
        nb = 3 * len(model.points)
        B = sp.csr_matrix((model.B.data, model.B.indices, model.B.indptr), shape=(n_rows, n))
        S = np.empty((n_rows, n_rows))
        X = np.empty((n_rows, n))
        for i in range(0, n_rows, BLOCK):
            rows = slice(i, min(i + BLOCK, n_rows))
            solved = self._lu.solve(B[rows].T.toarray())
            S[:, rows] = B @ solved
            X[rows] = solved.T
        stiff = 1.0 + 0.25 * h * h * model.omega2
        j, j_s = stiff + 0.5 * h * model.c, stiff + 0.5 * h * model.beta * model.omega2
        S += (model.B_modes * (1 / j - 1 / j_s)) @ model.B_modes.T
        G = 0.25 * h * (S + S.T)
        C, C_k = G[:nb, nb:], G[nb:, nb:]
        inverse = la.inv(np.diag(1 / model.d) + C_k) if len(model.d) else np.zeros((0, 0))
        condensed = G[:nb, :nb] - C @ inverse @ C.T
        floor2 = ROUND_OFF**2 * float(np.diag(condensed) @ forces**2)
        ordered = np.ascontiguousarray
        shapes = ordered(G[:, nb:])
        return layout.Level(
            h=h,
            G=ordered(condensed),
            G_shapes=shapes,
            X=X,
            shape_inverse=inverse,
            fill=self.fill,
            floor2=floor2,
        )
