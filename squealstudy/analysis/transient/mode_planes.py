"""The planes of motion along complex modes, orthonormal in the energy: for shares of the energy.

A motion along a complex mode, 2 Re(a x exp(lambda t)), has its states (q, q') in the plane that the
real and imaginary parts of (x, lambda x) span. The energy |q'|^2 / 2 + |Omega q|^2 / 2 makes these
states a Euclidean space: the energy of a state's orthogonal projection on a plane lies between zero
and the energy of the state. Planes of different modes are not orthogonal to each other.
"""

from __future__ import annotations

import numpy as np

DEGENERATE = 1e-9  # second axis over the first, below which a plane is a line


def mode_planes(
    omega2: np.ndarray, lam: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Sensor rows of the planes of complex modes, and the scalar products of their axes.

    Parameters
    ----------
    omega2 : ndarray (n,)
        Diagonal stiffness of the energy, (rad/s)^2; the mass is the identity.
    lam : ndarray (m,) complex
        rad/s.
    right : ndarray (n, m) complex

    Returns
    -------
    rows : ndarray (m, 4, n)
        Of each plane two rows for velocities, then two for displacements: their products add up
        to `coordinates`.
    overlap : ndarray (2 m, 2 m)
        Scalar products of all axes; zeros for the missing second axis of a line.
    """
    omega = np.sqrt(np.maximum(omega2, 0.0))
    axes = [_axes(omega, root, x) for root, x in zip(lam, right.T, strict=True)]
    n = len(omega)
    rows = [np.vstack([u[n:].T, (omega[:, None] * u[:n]).T]) for u in axes]
    every = np.hstack([np.zeros((2 * n, 0)), *axes])
    return np.array(rows).reshape(len(axes), 4, n), every.T @ every


def _axes(omega: np.ndarray, lam: complex, x: np.ndarray) -> np.ndarray:
    """Orthonormal axes (2 n, 2) of one plane in the coordinates (Omega q, q')."""
    state = np.concatenate([omega * x, lam * x])
    u, s, _ = np.linalg.svd(np.column_stack([state.real, state.imag]), full_matrices=False)
    kept: np.ndarray = u * (s > DEGENERATE * s[0])
    return kept


def coordinates(displacement: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Coordinates (rows, 2) on a plane from the histories (rows, 4) of its `mode_planes` rows.

    Half the sum of their squares is the energy of the projection, J.
    """
    found: np.ndarray = velocity[:, :2] + displacement[:, 2:]
    return found
