"""Mode shapes of two design points in common coordinates."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from squealstudy.engine.cache import load_prepared
from squealstudy.engine.plan import Plan
from squealstudy.kinds.complex_modes.columns import ShapeFile

KEPT = 8  # shapes of points kept at hand


class CommonShapes:
    """Shapes of two points of a plan as they can be compared by their MAC.

    Points of one structure have the same nominal real modes as coordinates. Each structure has its
    own, so that two structures are compared by what is seen at the places that correspond between
    them (PreparedModel.sensor_shapes), weighted by mass.

    Parameters
    ----------
    plan : Plan
    file : ShapeFile
    lams : list of ndarray (m,)
        Roots of the oscillating modes of each point; the others' shapes are left out.
    """

    def __init__(self, plan: Plan, file: ShapeFile, lams: list[np.ndarray]) -> None:
        self._keys = [task.structure for task in plan.tasks]
        self._file, self._counts = file, [len(lam) for lam in lams]
        self._seen = lru_cache(maxsize=KEPT)(self._observed)

    def raw(self, point: int) -> np.ndarray:
        """Unit shapes (m, k) of a point in the nominal modes of its own structure."""
        return self._file.read(point)[: self._counts[point]]

    def pair(self, a: int, b: int) -> tuple[np.ndarray, np.ndarray]:
        """Shapes (ma, k) and (mb, k) of two points."""
        if self._keys[a] == self._keys[b]:
            return self.raw(a), self.raw(b)
        return self._seen(a), self._seen(b)

    def _observed(self, point: int) -> np.ndarray:
        shapes = self.raw(point)
        if not len(shapes):
            return shapes
        sensors = load_prepared(self._keys[point]).sensor_shapes
        return shapes @ sensors.T.astype(shapes.dtype)
