"""Arrays of the hybrid kernels: model, design point and state; the factor of the step.

The fixed Jacobian of the hybrid Newmark scheme is factored and condensed once for each step size.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.errors import ConvergenceError, ModelError
from squealstudy.faults import raise_if_memory
from squealstudy.kernels import hybrid_layout as layout
from squealstudy.kernels.laws import law_row
from squealstudy.kernels.newmark_layout import N_POINT_GAP
from squealstudy.linalg.factor import symmetric_lu
from squealstudy.motion.system import MotionPoint
from squealstudy.reduction.hybrid import HybridModel

RHS_PER_SOLVE = 64  # right-hand sides in each call of SuperLU
# forces below this share of the contact forces at the start are negligible
NEGLIGIBLE_FORCE_RATIO = 1e-12


def hybrid_arrays(model: HybridModel, design: MotionPoint) -> layout.HybridArrays:
    """Constants of a run; shapes that the design does not damp are left out.

    Damping has three parts::

        C = beta K + M phi (c - beta omega^2) phi^T M + shapes^T d shapes

    (THEORY.md eq. (81)): every mode in `phi` has exactly its rate c = 2 zeta omega, and all motion
    beyond them is damped by beta K, a ratio beta omega / 2. The modal representation has the same
    damping where its coordinates up to the same cutoff have c, those beyond it beta omega^2.

    Raises
    ------
    ModelError
        A base, or dampings, that do not fit the model, are not finite or negative.
    """
    points = np.ascontiguousarray(design.points(model).T)
    m, k, nc = len(model.omega), model.shapes.shape[0], len(points)
    d = np.zeros(k) if design.d is None else np.asarray(design.d, dtype=float)
    for name, array, size in (("c", design.c, m), ("d", d, k)):
        if np.shape(array) != (size,):
            raise ModelError(f"hybrid design: '{name}' needs {size} values")
    values = np.concatenate([design.c, d, [design.beta]])
    if not (np.isfinite(values).all() and (values >= 0).all()):
        raise ModelError("hybrid design: damping must be finite, not negative")
    if not np.isfinite(points).all():
        raise ModelError("hybrid design: 'speed' must be finite")
    if design.damping_between is not None:
        raise ModelError("hybrid design: damping is on real modes, 'damping_between' on none")
    damped = np.flatnonzero(d)
    B = sp.vstack([model.N, model.T, model.T_perp], format="csr")
    B = B[np.arange(3 * nc).reshape(3, nc).T.ravel()]
    B = sp.vstack([B, model.shapes[damped]], format="csr")
    return layout.HybridArrays(
        K=_sparse(model.K),
        B=_sparse(B),
        B_modes=np.ascontiguousarray(B @ model.phi),
        points=points,
        law=law_row(design.contact, design.friction),
        omega2=model.omega**2,
        c=np.asarray(design.c, dtype=float),
        beta=float(design.beta),
        d=d[damped],
    )


def uniform_damping(
    model: HybridModel, zeta: float, beyond: float | None = None
) -> tuple[np.ndarray, float]:
    """Rates `c` (m,) of modes up to the model's damping cutoff [1/s], and `beta` [s] beyond it.

    Parameters
    ----------
    model : HybridModel
    zeta : float
        Damping ratio of all modes up to the cutoff.
    beyond : float or None
        Ratio at the cutoff from where it rises in proportion to frequency; None for `zeta`. Finite
        elements squeal far above the band too (studies/benchmarks/hybrid.py --above).
    """
    start = zeta if beyond is None else beyond
    return 2.0 * zeta * model.omega, start / (np.pi * model.damping_cutoff)


def initial_state(
    model: HybridModel, hybrid: layout.HybridArrays, q0: np.ndarray, v0: np.ndarray
) -> layout.HybridState:
    """State of a run before its first evaluation (hybrid_state.start)."""
    vectors = np.zeros((layout.N_VECTORS, model.n))
    vectors[layout.Q], vectors[layout.V] = q0, v0
    modes = np.zeros((layout.N_MODES, len(model.omega)))
    amplitudes = model.phi.T @ (model.M @ np.stack([q0, v0], axis=1))
    modes[layout.ALPHA] = modes[layout.ALPHA_S] = amplitudes[:, 0]
    modes[layout.RATE] = modes[layout.RATE_S] = amplitudes[:, 1]
    return layout.HybridState(
        vectors=vectors,
        modes=modes,
        rows=np.zeros((layout.N_ROWS, len(hybrid.B.indptr) - 1)),
        point=np.zeros((len(hybrid.points), N_POINT_GAP)),
        work=np.zeros(4),
    )


def _sparse(A: sp.csr_matrix) -> layout.Sparse:
    A = A.tocsr()
    A.sort_indices()
    indices = A.indptr.astype(np.int32), A.indices.astype(np.int32)
    return layout.Sparse(*indices, A.data.astype(float))


class StepSolver:
    """J = M + (h beta/2 + h^2/4) K of the sparse part, and its compliance at the contact points.

    Inertia dominates J (its condition is about (h omega_max / 2)^2), so that solves need no
    refinement. The modes are those of M and K, so that their damping changes J^-1 by
    phi diag(1/j - 1/j_s) phi^T, without Woodbury's identity.

    Attributes
    ----------
    level : hybrid_layout.StepSize
        The condensed Jacobian of the contact points.
    solves : int
        Number of forward and back solves so far.

    Raises
    ------
    ConvergenceError
        Where J is singular (``singular_jacobian``).
    """

    def __init__(
        self, M: sp.spmatrix, model: layout.HybridArrays, h: float, forces: np.ndarray
    ) -> None:
        K = sp.csr_matrix((model.K.data, model.K.indices, model.K.indptr), shape=M.shape)
        J = M + (0.5 * h * model.beta + 0.25 * h * h) * K
        try:
            self._lu = symmetric_lu(J)
        except RuntimeError as error:
            raise_if_memory(error)
            raise ConvergenceError("singular_jacobian", f"hybrid Jacobian: {error}") from error
        self.solves = 0
        self.level = self._condense(model, h, forces)

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve J x = b for one right-hand side (n,)."""
        self.solves += 1
        x: np.ndarray = self._lu.solve(b)
        return x

    def _condense(
        self, model: layout.HybridArrays, h: float, forces: np.ndarray
    ) -> layout.StepSize:
        """What a step of size h needs: the compliance of the contact points and its parts."""
        n, n_rows = len(model.K.indptr) - 1, len(model.B.indptr) - 1
        nb = 3 * len(model.points)
        B = sp.csr_matrix((model.B.data, model.B.indices, model.B.indptr), shape=(n_rows, n))
        S = np.empty((n_rows, n_rows))
        X = np.empty((n_rows, n))
        for i in range(0, n_rows, RHS_PER_SOLVE):
            rows = slice(i, min(i + RHS_PER_SOLVE, n_rows))
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
        floor2 = NEGLIGIBLE_FORCE_RATIO**2 * float(np.diag(condensed) @ forces**2)
        ordered = np.ascontiguousarray
        shapes = ordered(G[:, nb:])
        return layout.StepSize(
            h=h,
            G=ordered(condensed),
            G_shapes=shapes,
            X=X,
            shape_inverse=inverse,
            fill=int(self._lu.L.nnz + self._lu.U.nnz),
            floor2=floor2,
        )
