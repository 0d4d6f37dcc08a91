"""A body that turns under places at rest: what its rotation adds, as seen from there.

With u(x, t) at places at rest the velocity of the matter there is e x x w + du/dt + w du/dtheta, at
the rate w about the axis e. To first order in w the kinetic energy adds w (A - A^T) to the damping,

    A_ij = integral rho N_i . dN_j/dtheta dV,   dN/dtheta = (e x x) . grad N, Cartesian components

and A is skew-symmetric where the surface of the body runs along the rotation: THEORY.md (3a).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError

# of a row's largest entry: symmetric part where the surface faces along the rotation, by about the
# sine of the angle; facets of a mesh of a ring stay below
MOST_SYMMETRIC = 0.3
NEGLIGIBLE_ROW = 1e-6  # entries of a row over the largest of all: nodes on the axis


@dataclass(frozen=True)
class Rotors:
    """The turning components and their axis.

    Attributes
    ----------
    names : tuple of str
        Components that turn.
    point : ndarray (3,)
        Of the axis, m.
    direction : ndarray (3,)
        Of unit length.
    radius : float or None
        Of the sliding speed, m: this over it is the rate of rotation. None where it is not known.
    unturned : str
        Why there are no gyroscopic terms, in words; empty where there are.
    """

    names: tuple[str, ...]
    point: np.ndarray = field(default_factory=lambda: np.zeros(3))
    direction: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    radius: float | None = None
    unturned: str = ""

    def around(self, points: np.ndarray) -> np.ndarray:
        """Velocity of places (..., 3) [m] at 1 rad/s, m/s."""
        return np.cross(self.direction, points - self.point)


def convective_elements(
    rotors: Rotors, N: np.ndarray, slopes: np.ndarray, points: np.ndarray, mass: np.ndarray
) -> np.ndarray:
    """Integrals (e, k, k) of rho N_a dN_b/dtheta of elements, kg at 1 rad/s.

    Parameters
    ----------
    rotors : Rotors
    N : ndarray (q, k)
        Functions at integration points.
    slopes : ndarray (e, q, k, 3)
        Their gradients, 1/m.
    points : ndarray (e, q, 3)
        The points, m.
    mass : ndarray (e, q)
        Density times weight, kg.
    """
    along = np.matmul(slopes, rotors.around(points)[..., None])[..., 0]  # dN/dtheta (e, q, k)
    elements: np.ndarray = np.matmul(N.T, mass[..., None] * along)
    return elements


def gyroscopic(convective: sp.csr_matrix, points: np.ndarray, name: str) -> sp.csr_matrix:
    """Gyroscopic matrix A - A^T (n, n) of 1 rad/s, kg.

    Parameters
    ----------
    convective : csr_matrix (n, n)
        A, the sum of `convective_elements` over nodes, or over degrees of freedom.
    points : ndarray (n, 3)
        Where these are, m, for messages.
    name : str
        Of the component.

    Raises
    ------
    ModelError
        A body that is not symmetric about the axis.
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
