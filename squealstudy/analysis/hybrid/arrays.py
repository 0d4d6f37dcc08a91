"""The kernels' arrays of a hybrid model, one of its design points and an initial state."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from squealstudy.analysis.hybrid.system import HybridDesign, design_points
from squealstudy.kernels import hybrid_layout as layout
from squealstudy.reduction.hybrid import HybridModel


def hybrid_arrays(model: HybridModel, design: HybridDesign) -> layout.Hybrid:
    """Constants of a run; shapes that the design does not damp are left out."""
    points = design_points(model, design)
    d = np.zeros(model.shapes.shape[0]) if design.d is None else np.asarray(design.d, dtype=float)
    damped = np.flatnonzero(d)
    nc = len(points)
    B = sp.vstack([model.N, model.T, model.T_perp], format="csr")
    B = B[np.arange(3 * nc).reshape(3, nc).T.ravel()]
    B = sp.vstack([B, model.shapes[damped]], format="csr")
    return layout.Hybrid(
        _sparse(model.K),
        _sparse(B),
        np.ascontiguousarray(B @ model.phi),
        points,
        design.law_row(),
        model.omega**2,
        2.0 * design.zeta * model.omega,
        float(design.beta),
        d[damped],
    )


def initial_state(
    model: HybridModel, hybrid: layout.Hybrid, q0: np.ndarray, v0: np.ndarray
) -> layout.State:
    """State of a run before its first evaluation (hybrid_commit.start)."""
    vectors = np.zeros((layout.N_VECTORS, model.n))
    vectors[layout.Q], vectors[layout.V] = q0, v0
    modes = np.zeros((layout.N_MODES, len(model.omega)))
    amplitudes = model.phi.T @ (model.M @ np.stack([q0, v0], axis=1))
    modes[layout.ALPHA] = modes[layout.ALPHA_S] = amplitudes[:, 0]
    modes[layout.RATE] = modes[layout.RATE_S] = amplitudes[:, 1]
    return layout.State(
        vectors,
        modes,
        np.zeros((layout.N_ROWS, len(hybrid.B.indptr) - 1)),
        np.zeros((len(hybrid.points), layout.N_POINT)),
        np.zeros(4),
    )


def _sparse(A: sp.csr_matrix) -> layout.Sparse:
    A = A.tocsr()
    A.sort_indices()
    indices = A.indptr.astype(np.int32), A.indices.astype(np.int32)
    return layout.Sparse(*indices, A.data.astype(float))
