"""The kernels' arrays of a hybrid model, one of its design points and an initial state."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.kernels import hybrid_layout as layout
from squealstudy.kernels.laws import law_row
from squealstudy.motion.system import MotionPoint
from squealstudy.reduction.hybrid import HybridModel


def hybrid_arrays(model: HybridModel, design: MotionPoint) -> layout.Hybrid:
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
    for name, value, size in (("c", design.c, m), ("d", d, k)):
        if np.shape(value) != (size,):
            raise ModelError(f"hybrid design: '{name}' needs {size} values")
    values = np.concatenate([design.c, d, [design.beta, design.speed]])
    if not (np.isfinite(values).all() and (values >= 0).all()):
        raise ModelError("hybrid design: damping and speed must be finite, not negative")
    damped = np.flatnonzero(d)
    B = sp.vstack([model.N, model.T, model.T_perp], format="csr")
    B = B[np.arange(3 * nc).reshape(3, nc).T.ravel()]
    B = sp.vstack([B, model.shapes[damped]], format="csr")
    return layout.Hybrid(
        K=_sparse(model.K),
        B=_sparse(B),
        B_modes=np.ascontiguousarray(B @ model.phi),
        points=points,
        law=law_row(design.contact, design.friction, design.speed),
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
    model: HybridModel, hybrid: layout.Hybrid, q0: np.ndarray, v0: np.ndarray
) -> layout.State:
    """State of a run before its first evaluation (hybrid_state.start)."""
    vectors = np.zeros((layout.N_VECTORS, model.n))
    vectors[layout.Q], vectors[layout.V] = q0, v0
    modes = np.zeros((layout.N_MODES, len(model.omega)))
    amplitudes = model.phi.T @ (model.M @ np.stack([q0, v0], axis=1))
    modes[layout.ALPHA] = modes[layout.ALPHA_S] = amplitudes[:, 0]
    modes[layout.RATE] = modes[layout.RATE_S] = amplitudes[:, 1]
    return layout.State(
        vectors=vectors,
        modes=modes,
        rows=np.zeros((layout.N_ROWS, len(hybrid.B.indptr) - 1)),
        point=np.zeros((len(hybrid.points), layout.N_POINT)),
        work=np.zeros(4),
    )


def _sparse(A: sp.csr_matrix) -> layout.Sparse:
    A = A.tocsr()
    A.sort_indices()
    indices = A.indptr.astype(np.int32), A.indices.astype(np.int32)
    return layout.Sparse(*indices, A.data.astype(float))
