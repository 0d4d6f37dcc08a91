"""What a step does to the free modes and to the forces beyond them: Newmark's, and exactly."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from squealstudy.kernels.integrator_layout import N_COEFFICIENT


def newmark_step(w2: np.ndarray, c: np.ndarray, h: float) -> np.ndarray:
    """Average acceleration of q'' + c q' + w2 q = f, its answer to f half to either end.

    Parameters
    ----------
    w2, c : ndarray (n,)
        Stiffness and damping.
    h : float
        Step, s.

    Returns
    -------
    ndarray (N_STEP, n)
        Rows of newmark_layout.Modal.steps.
    """
    hk, hc = 0.25 * h * h * w2, 0.5 * h * c
    D = 1.0 + hc + hk
    to_q, to_v = 0.25 * h * h / D, 0.5 * h / D
    rows = [(1.0 + hc - hk) / D, h / D, -h * w2 / D, (1.0 - hc - hk) / D, to_q, to_v, to_q, to_v]
    return np.array(rows)


def step_table(
    w2: np.ndarray, c: np.ndarray, h: float, halvings: int, limit: float | None
) -> np.ndarray:
    """Coefficients of steps h, h/2, ...: (halvings + 1, N_STEP, n).

    With a limit, modes with omega h up to it move exactly; those that the step does not resolve
    would resonate with changes of the contact near omega h = pi.
    """
    table = np.array([newmark_step(w2, c, h / 2**level) for level in range(halvings + 1)])
    if limit is not None:
        exact = propagator_levels(w2, c, h, halvings)
        for level, rows in enumerate(exact):
            slow = np.sqrt(np.maximum(w2, 0.0)) * h / 2**level <= limit
            both = np.concatenate([rows[:4], rows[4:6] - rows[6:8], rows[6:8]])
            table[level, :, slow] = both[:, slow].T
    return table


def propagator_levels(w2: np.ndarray, c: np.ndarray, h: float, halvings: int) -> list[np.ndarray]:
    """`propagators` of h, h/2, ..., all from the shortest step by squaring."""
    parts = 2**halvings
    X, rate = _chain(w2, c, h / parts)
    levels = []
    for level in range(halvings, -1, -1):
        levels.append(_answers(X, rate, h / parts, parts >> level))
        X = X @ X if level else X
    return levels[::-1]


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
    return _answers(*_chain(w2, c, h), h, 1)


def _chain(w2: np.ndarray, c: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Matrix exponentials (n, 5, 5) over h, and the factors (n,) that scale displacements."""
    rate = np.maximum(np.sqrt(np.abs(w2)), 1.0 / h)
    A = np.zeros((len(w2), 5, 5))
    A[:, 0, 1] = rate * h
    A[:, 1, 0] = -w2 / rate * h
    A[:, 1, 1] = -c * h
    A[:, 1, 2] = 1.0
    A[:, 2, 3] = A[:, 3, 4] = 1.0
    return (la.expm(A) if len(w2) else A), rate


def _answers(X: np.ndarray, rate: np.ndarray, h: float, times: int) -> np.ndarray:
    """Rows of `propagators` over `times` h, X (n, 5, 5) in units of h."""
    rows = np.empty((N_COEFFICIENT, len(X)))
    rows[:4] = X[:, 0, 0], X[:, 0, 1] / rate, X[:, 1, 0] * rate, X[:, 1, 1]
    for k in range(3):
        unit = h / times**k
        rows[4 + 2 * k], rows[5 + 2 * k] = unit * X[:, 0, 2 + k] / rate, unit * X[:, 1, 2 + k]
    return rows
