"""Normal random fields over contact points."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from scipy.spatial.distance import cdist

from squealstudy.errors import ModelError

MOST_POINTS = 4000  # of one field: its eigenpairs take 8 s of a core and 0.5 GB


def random_field(
    points: np.ndarray, area: np.ndarray, length: float, seed: int | tuple[int, ...]
) -> np.ndarray:
    """A field (n,) of mean 0 and variance 1, correlated by exp(-(d / length)^2).

    It is the Karhunen-Loeve series with the area as weight, sum_k sqrt(lam_k) phi_k xi_k. The
    standard normal xi_k are those of independent numbers at the points seen in the eigenvectors,
    so that neither their signs nor those of one eigenvalue matter.

    Parameters
    ----------
    points : ndarray (n, 3)
        m.
    area : ndarray (n,)
        m2.
    length : float
        m.
    seed : int or tuple of int
        Not negative.

    Raises
    ------
    ModelError
        More than `MOST_POINTS` points.
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
