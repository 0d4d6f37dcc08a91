"""What a worker keeps between design points: prepared models and known working points."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from squealstudy.reduction.prepared import PreparedModel
from squealstudy.study.cache import load_gaps, load_prepared, save_gaps
from squealstudy.study.design import Design
from squealstudy.study.keys import content_hash


@lru_cache(maxsize=4)
def prepared_model(key: str) -> PreparedModel:
    """The prepared model of a key, read once a process."""
    return load_prepared(key)


@lru_cache(maxsize=4)
def _gaps(key: str) -> dict[str, np.ndarray]:
    return load_gaps(key)


def known_gap(key: str, design: Design) -> np.ndarray | None:
    """Gaps (nc,) of the design's working point, where a study has solved it before."""
    return _gaps(key).get(working_point_key(design)) if design.has_working_point else None


class NewGaps:
    """Working points found by one chunk, to be kept for later studies."""

    def __init__(self) -> None:
        self._found: dict[str, dict[str, np.ndarray]] = {}

    def add(self, key: str, design: Design, gap: np.ndarray) -> None:
        """Remember the gaps of a design's working point, where it has one."""
        if design.has_working_point:
            self._found.setdefault(key, {})[working_point_key(design)] = gap

    def save(self, name: str) -> None:
        """Write them to the cache, under the name of the chunk."""
        for key, gaps in self._found.items():
            save_gaps(key, name, gaps)
            _gaps(key).update(gaps)


def working_point_key(design: Design) -> str:
    """Hash of what a working point depends on beside its structure."""
    state = design.state()
    op = state.operating
    return content_hash(
        [
            float(op.mu_steady).hex(),
            float(op.pressure).hex(),
            op.law.kind,
            [x.hex() for x in op.law.parameters],
            sorted((c, j, float(s).hex()) for (c, j), s in state.frequency_scale.items() if s != 1),
        ]
    )
