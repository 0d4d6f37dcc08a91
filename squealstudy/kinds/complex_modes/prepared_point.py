"""Prepared models of single design points of a batch, which no cache holds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.prepared import PreparedModel, prepare
from squealstudy.study.design import DesignPoint

KEPT = 16  # models that a process holds


def prepared_of(design: DesignPoint) -> PreparedModel:
    """The prepared model of a design point of a batch; ConvergenceError without steady sliding."""
    fixed = tuple(sorted(design.values.items()))
    return _prepared(_Asked(design, fixed))


@dataclass(frozen=True)
class _Asked:
    """A design point by its values alone."""

    design: DesignPoint
    values: tuple[tuple[str, float], ...]

    def __hash__(self) -> int:
        return hash(self.values)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, _Asked):
            return NotImplemented
        same = self.design.model is other.design.model
        return same and (self.values, self.design.options) == (other.values, other.design.options)


@lru_cache(maxsize=KEPT)
def _prepared(asked: _Asked) -> PreparedModel:
    whole = ReductionSettings(np.inf, np.inf, 0.0)
    return prepare(asked.design.assembly(), asked.design.operating_point(), whole)
