"""Sampled surfaces: points with areas, normals and the rows that observe the displacement there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError


@dataclass(frozen=True)
class Surface:
    """Points on one component's boundary.

    Attributes
    ----------
    points : ndarray (n, 3)
        Coordinates, m.
    area : ndarray (n,)
        Area that each point stands for (quadrature weight), m2, positive.
    normal : ndarray (n, 3)
        Outward unit normals.
    shape : csr_matrix (n, n_nodes)
        Shape functions: values at the points from values at the nodes; rows sum to one.
    """

    points: np.ndarray
    area: np.ndarray
    normal: np.ndarray
    shape: sp.csr_matrix

    def __post_init__(self) -> None:
        n = len(self.points)
        if self.area.shape != (n,) or self.normal.shape != (n, 3) or self.shape.shape[0] != n:
            raise ModelError("surface: points, area, normal and shape differ in length")
        if n == 0 or not (self.area > 0).all():
            raise ModelError("surface: it needs at least one point, all areas positive")
        if not np.allclose(self.shape.sum(axis=1), 1.0, atol=1e-9):
            raise ModelError("surface: shape functions must sum to one at every point")

    def observe(self, direction: np.ndarray) -> sp.csr_matrix:
        """Rows (n, 3 n_nodes) giving the displacement along `direction` (n, 3) or (3,)."""
        d = np.broadcast_to(direction, self.points.shape)
        S = self.shape.tocoo()
        rows = np.repeat(S.row, 3)
        cols = (3 * S.col[:, None] + np.arange(3)).ravel()
        values = (S.data[:, None] * d[S.row]).ravel()
        return sp.coo_matrix((values, (rows, cols)), shape=(len(d), 3 * S.shape[1])).tocsr()
