"""What tables say of a family's modes beside their roots: comparable shapes."""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.full_order.family_point import NO_WORKING_POINT
from squealstudy.analysis.point import PointModes
from squealstudy.analysis.reanalysis.point_roots import PointRoots
from squealstudy.reduction.prepared_family import PreparedFamily


class FamilyModes:
    """Reads modes given in the coordinates of a basis V (n, r), None for the full ones."""

    def __init__(self, prepared: PreparedFamily, V: np.ndarray | None) -> None:
        self._prepared, self._V = prepared, V

    def shapes(self, X: np.ndarray) -> np.ndarray:
        """Unit coordinates (m, k) complex64 of right vectors."""
        return self._prepared.shapes(X if self._V is None else self._V @ X)

    def read(self, found: PointRoots) -> PointModes:
        """The modes of a solved point, oscillating ones first; they have no energies."""
        order = np.argsort(found.lam.imag == 0, kind="stable")
        lam, X = found.lam[order], found.X[:, order]
        return PointModes(
            lam,
            lam.imag == 0,
            found.residual[order],
            np.zeros((0, len(lam))),
            self.shapes(X),
            NO_WORKING_POINT,
            found.error[order],
            found.method,
        )
