"""Exact free motion, contact forces by the trapezoidal rule: the integrator of studies by default.

The coefficients of a step come from matrix exponentials.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from pydantic import Field

from squealstudy.kernels.newmark_layout import N_COEFFICIENT
from squealstudy.motion.integrator import FixedJacobian
from squealstudy.motion.integrators.newmark import average_acceleration

# a step of 20 us is then cut to 20 ns where slip ends, as friction may settle within 1 us
CORNER_HALVINGS = 10


class ExactFreeMotion(FixedJacobian):
    """Modes that a step resolves move exactly under forces that are linear in time.

    Modes beyond `exact_limit` move by average acceleration, since otherwise they would resonate
    with changes of the contact near omega h = pi.
    """

    name = "exponential"
    label = "exponential"
    description = (
        "resolved free modes exact, contact by the trapezoidal rule, iterated as Newmark's"
    )
    order = 2
    # work is summed by the trapezoidal rule, and levels of the coarse brake are right to 0.1 % at a
    # drift of 3.9e-3 (4 us), to 1.4 % at 2.2e-2
    drift_limit = 4e-3
    work_of_changes = 1.0

    corner_halvings: int = Field(
        default=CORNER_HALVINGS,
        ge=0,
        le=20,
        description="times that a step is halved where a contact point begins or ceases to stick, "
        "turns or opens, in models of up to 8 points; 0: never",
    )
    exact_limit: float = Field(
        default=2.0, ge=0, description="omega h beyond which a mode moves by average acceleration"
    )

    def step(self, w2: np.ndarray, c: np.ndarray, h: float) -> np.ndarray:
        """Coefficients (8, n)."""
        return self._mixed(w2, c, h, propagator_levels(w2, c, h, 0)[0])

    def steps(
        self, w2: np.ndarray, c: np.ndarray, h: float, levels: int | None = None
    ) -> np.ndarray:
        """Coefficients (levels + 1, 8, n), all from the shortest step's matrices by squaring."""
        levels = self.max_halvings if levels is None else levels
        exact = propagator_levels(w2, c, h, levels)
        return np.array([self._mixed(w2, c, h / 2**k, rows) for k, rows in enumerate(exact)])

    def _mixed(self, w2: np.ndarray, c: np.ndarray, h: float, exact: np.ndarray) -> np.ndarray:
        """Coefficients (8, n), from the propagators `exact` (10, n) where modes are slow."""
        table = average_acceleration(w2, c, h)
        slow = np.sqrt(np.maximum(w2, 0.0)) * h <= self.exact_limit
        both = np.concatenate([exact[:4], exact[4:6] - exact[6:8], exact[6:8]])
        table[:, slow] = both[:, slow]
        return table


def propagator_levels(w2: np.ndarray, c: np.ndarray, h: float, halvings: int) -> list[np.ndarray]:
    """`propagators` of steps h, h/2, ..., all from the shortest step's by squaring."""
    parts = 2**halvings
    X, rate = _chain(w2, c, h / parts)
    levels = []
    for level in range(halvings, -1, -1):
        levels.append(_answers(X, rate, h / parts, parts >> level))
        X = X @ X if level else X
    return levels[::-1]


def propagators(w2: np.ndarray, c: np.ndarray, h: float) -> np.ndarray:
    """Matrices of a step of each mode of q'' + c q' + w2 q = f, with f a polynomial in time.

    Parameters
    ----------
    w2, c : ndarray (n,)
        Stiffness (any sign) and damping: free, rigid, critically and over-damped modes alike.
    h : float
        Step, s.

    Returns
    -------
    ndarray (10, n)
        Rows newmark_layout.E_*, the matrix exponential of (q, v), then P1_*, P2_* and P3_*, the
        responses in q and v to f = 1, f = t/h and f = (t/h)^2 / 2: phi-functions times h.

    Notes
    -----
    All come from one exponential of a 5 x 5 matrix that holds the mode and a chain of integrators
    for its force (Saad 1992), with displacements scaled to velocities.
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
    """Rows of `propagators` over a step of `times` h, from its exponential X (n, 5, 5)."""
    rows = np.empty((N_COEFFICIENT, len(X)))
    rows[:4] = X[:, 0, 0], X[:, 0, 1] / rate, X[:, 1, 0] * rate, X[:, 1, 1]
    for k in range(3):
        unit = h / times**k
        rows[4 + 2 * k], rows[5 + 2 * k] = unit * X[:, 0, 2 + k] / rate, unit * X[:, 1, 2 + k]
    return rows
