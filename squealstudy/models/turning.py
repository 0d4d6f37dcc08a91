"""Gyroscopic terms of a body that turns, with displacements described at places at rest.

With displacements u(x, t) at places at rest, the matter there has the velocity
w e x x + du/dt + w du/dtheta, where w is the rate of rotation about the axis e. To first order in
w, the kinetic energy adds w (A - A^T) to the damping,

    A_ij = integral rho N_i . dN_j/dtheta dV,   dN/dtheta = (e x x) . grad N, Cartesian components

and A is skew-symmetric where the surface of the body runs along the rotation: THEORY.md (3a).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError

# largest symmetric part of a row of A over its skew part. A surface that faces along the rotation
# has about the sine of the angle; facets of a meshed ring stay below
MOST_SYMMETRIC = 0.3
NEGLIGIBLE_ROW = 1e-6  # a smaller excess over the largest skew entry is round-off


@dataclass(frozen=True)
class Rotors:
    """The turning components and their axis.

    Attributes
    ----------
    names : tuple of str
        Names of the components that turn.
    point : ndarray (3,)
        A point on the axis, m.
    direction : ndarray (3,)
        Unit vector along the axis.
    radius : float or None
        Radius of the imposed sliding speed, m: speed over radius is the rate of rotation. None
        where it is not given.
    unturned : str
        Why there are no gyroscopic terms, in words; empty where there are.
    """

    names: tuple[str, ...]
    point: np.ndarray = field(default_factory=lambda: np.zeros(3))
    direction: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    radius: float | None = None
    unturned: str = ""

    def around(self, points: np.ndarray) -> np.ndarray:
        """Velocity (..., 3) [m/s] of points (..., 3) [m] at 1 rad/s."""
        return np.cross(self.direction, points - self.point)


def convective_elements(
    rotors: Rotors, N: np.ndarray, slopes: np.ndarray, points: np.ndarray, mass: np.ndarray
) -> np.ndarray:
    """Integrals (e, k, k) of rho N_a dN_b/dtheta of elements, kg at 1 rad/s.

    Parameters
    ----------
    rotors : Rotors
    N : ndarray (q, k)
        Shape functions at the integration points.
    slopes : ndarray (e, q, k, 3)
        Gradients of the shape functions, 1/m.
    points : ndarray (e, q, 3)
        Coordinates of the integration points, m.
    mass : ndarray (e, q)
        Density times integration weight, kg.
    """
    along = np.matmul(slopes, rotors.around(points)[..., None])[..., 0]  # dN/dtheta (e, q, k)
    elements: np.ndarray = np.matmul(N.T, mass[..., None] * along)
    return elements


def gyroscopic(convective: sp.csr_matrix, points: np.ndarray, name: str) -> sp.csr_matrix:
    """Gyroscopic matrix A - A^T (n, n) [kg] at 1 rad/s.

    Parameters
    ----------
    convective : csr_matrix (n, n)
        A, the sum of `convective_elements` over nodes, or over degrees of freedom.
    points : ndarray (n, 3)
        Coordinates of these nodes or degrees of freedom, m, for messages.
    name : str
        Name of the component.

    Raises
    ------
    ModelError
        The body is not symmetric about the axis.
    """
    skew = (convective - convective.T).tocsr()
    symmetric = abs(convective + convective.T).max(axis=1).toarray().ravel()
    size = abs(skew).max(axis=1).toarray().ravel()
    excess = symmetric - MOST_SYMMETRIC * size
    worst = int(np.argmax(excess))
    if excess[worst] > NEGLIGIBLE_ROW * size.max():
        where = ", ".join(f"{1e3 * x:.4g}" for x in points[worst])
        raise ModelError(
            f"{name} is not symmetric about its axis of rotation: near ({where}) mm a face of it, "
            "or of another density, stands across the rotation"
        )
    return skew
