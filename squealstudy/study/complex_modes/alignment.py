"""Mode shapes of different structures in the coordinates of one of them."""

from __future__ import annotations

import numpy as np

from squealstudy.study.cache import is_prepared, load_prepared
from squealstudy.study.plan import Plan


class ShapeAlignment:
    """Maps shape coordinates of every structure of a plan to those of its first one.

    Each structure has its own nominal real modes, of arbitrary sign and, for doublets, rotation;
    a least-squares fit at the sensors expresses them in the first structure's modes. Structures
    of another mesh topology have no common sensors and stay as they are.
    """

    def __init__(self, plan: Plan) -> None:
        keys = [s.key for s in plan.structures if is_prepared(s.key)]
        self._first = keys[0] if keys else ""
        self._several = len(keys) > 1
        self._maps: dict[str, np.ndarray | None] = {}

    def apply(self, key: str, shapes: np.ndarray) -> np.ndarray:
        """Unit shapes (m, k) of structure `key` in the first structure's coordinates."""
        if not self._several or key == self._first or not len(shapes):
            return shapes
        if key not in self._maps:
            self._maps[key] = self._map(key)
        Q = self._maps[key]
        if Q is None:
            return shapes
        aligned = shapes @ Q.T
        size = np.linalg.norm(aligned, axis=1, keepdims=True)
        unit: np.ndarray = (aligned / np.maximum(size, 1e-30)).astype(np.complex64)
        return unit

    def _map(self, key: str) -> np.ndarray | None:
        reference = load_prepared(self._first).sensor_shapes
        own = load_prepared(key).sensor_shapes
        if len(reference) != len(own):
            return None
        Q: np.ndarray = np.linalg.lstsq(reference, own, rcond=None)[0]
        return Q
