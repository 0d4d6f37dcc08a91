"""Normal random fields over contact points."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from scipy.spatial.distance import cdist

from squealstudy.errors import ModelError

MOST_POINTS = 4000  # most points of a field: its eigenpairs take 8 s of a core and 0.5 GB


def random_field(
    points: np.ndarray, area: np.ndarray, length: float, seed: int | tuple[int, ...]
) -> np.ndarray:
    """A field (n,) of mean 0 and variance 1, correlated by exp(-(d / length)^2).

    It is the Karhunen-Loeve series sum_k sqrt(lam_k) phi_k xi_k with the area as weight. The
    coefficients xi are a vector of independent standard normal numbers, one at each point,
    projected on the eigenvectors. So the field depends neither on the signs of eigenvectors nor on
    their choice for equal eigenvalues.

    Parameters
    ----------
    points : ndarray (n, 3)
        Contact points, m.
    area : ndarray (n,)
        Their areas, m2.
    length : float
        Correlation length, m.
    seed : int or tuple of int
        Not negative.

    Raises
    ------
    ModelError
        There are more than `MOST_POINTS` points.
    """
    if len(points) > MOST_POINTS:
        raise ModelError(
            f"expected at most {MOST_POINTS} contact points of a random field, got {len(points)}: "
            "fewer points a side of a facet"
        )
    root = np.sqrt(area / area.sum())
    correlation = np.exp(-((cdist(points, points) / length) ** 2))
    lam, vectors = la.eigh(root[:, None] * correlation * root)
    xi = vectors.T @ np.random.default_rng(seed).standard_normal(len(points))
    field: np.ndarray = vectors @ (np.sqrt(np.maximum(lam, 0.0)) * xi) / root
    return field
