"""The rigid motion that best fits displacements of points, for couplings and masses on sets.

It is the least-squares fit with weights of the points.
"""

from __future__ import annotations

import numpy as np

from squealstudy.errors import ModelError

ON_A_LINE = 1e-8  # points are on a line below this ratio of least to largest moment of inertia


def mean_motion(points: np.ndarray, weight: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Displacement at `point` (3,) of the rigid motion that best fits that of points (n, 3).

    `weight` (n,) weights the squares of the fit.

    Returns
    -------
    ndarray (3, n, 3)
        Component i of the displacement, by the displacement of point k along axis j, at [i, k, j].

    Raises
    ------
    ModelError
        The points lie on a line, about which a rigid motion could turn freely.
    """
    nearest, centre = _nearest(points, weight)
    at_point: np.ndarray = _motions((point - centre)[None])[0] @ nearest
    return at_point.reshape(3, -1, 3)


def mean_turn(points: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Rotation (3, n, 3) of the rigid motion that best fits displacements, as in `mean_motion`."""
    return _nearest(points, weight)[0][3:].reshape(3, -1, 3)


def _nearest(points: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Translation of the centre, then rotation (6, 3 n), by displacements; the centre (3,)."""
    weight = weight / weight.sum()
    centre = weight @ points
    G = _motions(points - centre)  # (n, 3, 6)
    moments = np.einsum("i,iab,iac->bc", weight, G, G)
    inertia = np.linalg.eigvalsh(moments[3:, 3:])
    if not inertia[0] > ON_A_LINE * inertia[-1]:
        raise ModelError("the points of the set lie on a line")
    nearest = np.linalg.solve(moments, np.einsum("i,iab->bia", weight, G).reshape(6, -1))
    return nearest, centre


def _motions(r: np.ndarray) -> np.ndarray:
    """Displacements (n, 3, 6) at r (n, 3) of unit translations and rotations about the origin."""
    G = np.zeros((len(r), 3, 6))
    G[:, :, :3] = np.eye(3)
    for axis in range(3):
        G[:, :, 3 + axis] = np.cross(np.eye(3)[axis], r)
    return G
