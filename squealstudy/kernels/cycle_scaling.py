"""Equations of a curve of periodic motions from their balance: scaled, with size and phase."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.jit import fast_entry_kernel, fast_kernel


@fast_kernel
def _scale(
    u: np.ndarray,
    R: np.ndarray,
    scale: np.ndarray,
    in_first: np.ndarray,
    phase: np.ndarray,
    reference: np.ndarray,
    F: np.ndarray,
) -> None:
    """The equations F (m + 2,): R (m,) over size and scale, norm and phase."""
    m, a = len(R), np.exp(u[-2])
    norm, turned = 0.0, 0.0
    for i in range(m):
        F[i] = R[i] / (a * scale[i])
        norm += in_first[i] * u[i] * u[i]
        turned += phase[i] * (u[i] - reference[i])
    F[m], F[m + 1] = 0.5 * (norm - 1.0), turned


@fast_entry_kernel
def scaled_residual(
    u: np.ndarray,
    R: np.ndarray,
    scale: np.ndarray,
    in_first: np.ndarray,
    phase: np.ndarray,
    reference: np.ndarray,
) -> np.ndarray:
    """The equations F (m + 2,) of a curve.

    Parameters
    ----------
    u : ndarray (m + 3,)
        Scaled coordinates over the size, frequency, logarithm of the size, mu.
    R : ndarray (m,)
        Imbalance of the coordinates.
    scale : ndarray (m,)
    in_first : ndarray (m,)
        1 of coordinates of the first harmonic, 0 of others.
    phase, reference : ndarray (m,)
        Unit direction in which a motion turns, and the motion whose phase it has.
    """
    F = np.empty(len(R) + 2)
    _scale(u, R, scale, in_first, phase, reference, F)
    return F


@fast_entry_kernel
def scaled_jacobian(
    u: np.ndarray,
    R: np.ndarray,
    by_z: np.ndarray,
    by_omega: np.ndarray,
    by_mu: np.ndarray,
    omega_0: float,
    scale: np.ndarray,
    in_first: np.ndarray,
    phase: np.ndarray,
    reference: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """`scaled_residual` and its derivatives (m + 2, m + 3), in the precision of `by_z` (m, m).

    `by_omega` and `by_mu` (m,) are derivatives of R by frequency [rad/s] and mu.
    """
    m, a = len(R), np.exp(u[-2])
    F, J = np.empty(m + 2), np.zeros((m + 2, m + 3), by_z.dtype)
    _scale(u, R, scale, in_first, phase, reference, F)
    for i in range(m):
        along = 0.0
        for k in range(m):
            J[i, k] = by_z[i, k] / (scale[i] * scale[k])
            along += J[i, k] * u[k]
        J[i, m] = by_omega[i] * omega_0 / (a * scale[i])
        J[i, m + 1] = along - F[i]
        J[i, m + 2] = by_mu[i] / (a * scale[i])
        J[m, i], J[m + 1, i] = in_first[i] * u[i], phase[i]
    return F, J
