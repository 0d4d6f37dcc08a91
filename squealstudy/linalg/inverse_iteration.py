"""A root of a small quadratic eigenproblem that larger ones have spoilt.

LAPACK's roots have errors of the size of round-off of the largest root. With the matrix Q(lambda)
itself each is as accurate as the entries of the matrices allow.
"""

from __future__ import annotations

import numpy as np

MAX_STEPS = 12  # of Newton's method for a root
CONVERGED = 4.0 * float(np.finfo(float).eps)  # relative step at which a root is found


def refined_root(
    M: np.ndarray, C: np.ndarray, K: np.ndarray, root: complex, x: np.ndarray
) -> tuple[complex, np.ndarray]:
    """A root [rad/s] near a given one, and its right vector (n,), from a given vector x (n,).

    Inverse iteration on Q(lambda) = lambda^2 M + lambda C + K, whose rows are scaled to one size,
    with Newton's step x^H x / (x^H Q^-1 Q' x) [Lancaster 1964]. Its imaginary part is zero or
    above. Where Q is singular the last root is returned.
    """
    is_real = root.imag == 0.0
    x = x.real if is_real else x
    shift = root.real if is_real else root
    with np.errstate(all="ignore"):
        for _ in range(MAX_STEPS):
            Q = shift * shift * M + shift * C + K
            size = np.abs(Q).max(axis=1)
            try:
                w = np.linalg.solve(Q / size[:, None], ((2.0 * shift * M + C) @ x) / size)
            except np.linalg.LinAlgError:
                break
            step = (x.conj() @ x) / (x.conj() @ w)
            if not (np.isfinite(step) and np.isfinite(w).all()):
                break
            shift, x = shift - step, w / np.linalg.norm(w)
            if abs(step) <= CONVERGED * abs(shift):
                break
    return (complex(shift), x) if shift.imag >= 0.0 else (complex(shift).conjugate(), x.conj())
