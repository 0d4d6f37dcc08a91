"""Coefficients of the exponential integrators."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from squealstudy.kernels.integrator_layout import N_COEFFICIENT


def propagators(w2: np.ndarray, c: np.ndarray, h: float) -> np.ndarray:
    """What a step does to each mode of q'' + c q' + w2 q = f, with f a polynomial in time.

    Parameters
    ----------
    w2, c : ndarray (n,)
        Stiffness (any sign) and damping: free, rigid, critically and over-damped modes alike.
    h : float
        Step, s.

    Returns
    -------
    ndarray (10, n)
        Rows integrator_layout.E_*, P*: the matrix exponential of (q, v), then the answers in q
        and v to f = 1, f = t/h and f = (t/h)^2 / 2: phi-functions of the mode times h.

    Notes
    -----
    All come from one exponential of a 5 x 5 matrix that holds the mode and the integrator chain
    of its force (Saad 1992), with displacements scaled to velocities.
    """
    rate = np.maximum(np.sqrt(np.abs(w2)), 1.0 / h)
    A = np.zeros((len(w2), 5, 5))
    A[:, 0, 1] = rate * h
    A[:, 1, 0] = -w2 / rate * h
    A[:, 1, 1] = -c * h
    A[:, 1, 2] = 1.0
    A[:, 2, 3] = A[:, 3, 4] = 1.0
    X = la.expm(A) if len(w2) else A
    rows = np.empty((N_COEFFICIENT, len(w2)))
    rows[:4] = X[:, 0, 0], X[:, 0, 1] / rate, X[:, 1, 0] * rate, X[:, 1, 1]
    for k in range(3):
        rows[4 + 2 * k], rows[5 + 2 * k] = h * X[:, 0, 2 + k] / rate, h * X[:, 1, 2 + k]
    return rows


def with_limit(
    rows: np.ndarray, w2: np.ndarray, c: np.ndarray, h: float, limit: float
) -> np.ndarray:
    """`rows` of `propagators` with average acceleration for modes whose omega h exceeds a limit.

    Newmark's step with forces f_0, f_1 beyond the mode has q_1 = q_0 + h (v_0 + v_1) / 2 and
    v_1 = v_0 + h (a_0 + a_1) / 2, whose answer to a force is half to either end.
    """
    D = 1.0 + 0.5 * h * c + 0.25 * h * h * w2
    base_q, base_v = 1.0 - 0.25 * h * h * w2 + 0.5 * h * c, 1.0 - 0.5 * h * c - 0.25 * h * h * w2
    newmark = np.array(
        [
            base_q / D,
            h / D,
            -h * w2 / D,
            base_v / D,
            0.5 * h * h / D,
            h / D,
            0.25 * h * h / D,
            0.5 * h / D,
            np.zeros_like(w2),
            np.zeros_like(w2),
        ]
    )
    return np.where(np.sqrt(np.abs(w2)) * h > limit, newmark, rows)
