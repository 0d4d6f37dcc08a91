"""Known working points: kept in the cache for later studies of the same model."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from squealstudy.engine.cache import prepared_path
from squealstudy.engine.files import write_arrays
from squealstudy.engine.keys import content_hash
from squealstudy.study.design import DesignPoint


@lru_cache(maxsize=4)
def _gaps(key: str) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    for file in sorted(_folder(key).glob("*.npz")):
        with np.load(file) as data:
            found.update(zip(data["keys"].tolist(), data["gaps"], strict=True))
    return found


def _folder(key: str) -> Path:
    return prepared_path(key) / "working_points"


def known_gap(key: str, design: DesignPoint) -> np.ndarray | None:
    """Gaps (nc,) of the design's working point, where a study has solved it before."""
    return _gaps(key).get(working_point_key(design)) if design.has_working_point else None


class NewGaps:
    """Working points found by one chunk, to be kept for later studies."""

    def __init__(self) -> None:
        self._found: dict[str, dict[str, np.ndarray]] = {}

    def add(self, key: str, design: DesignPoint, gap: np.ndarray) -> None:
        """Remember the gaps of a design's working point, where it has one."""
        if design.has_working_point:
            self._found.setdefault(key, {})[working_point_key(design)] = gap

    def save(self, name: str) -> None:
        """Write them to the cache, under the name of the chunk."""
        for key, gaps in self._found.items():
            arrays = {"keys": np.array(list(gaps)), "gaps": np.stack(list(gaps.values()))}
            write_arrays(_folder(key) / f"{name}.npz", arrays)
            _gaps(key).update(gaps)


def working_point_key(design: DesignPoint) -> str:
    """Hash of what a working point depends on beside its structure."""
    state = design.state()
    op = state.operating
    return content_hash(
        [
            [x if isinstance(x, str) else x.hex() for x in op.sliding_friction],
            float(op.pressure).hex(),
            op.law.kind,
            [x.hex() for x in op.law.parameters],
            sorted((c, j, float(s).hex()) for (c, j), s in state.frequency_scale.items() if s != 1),
        ]
    )
