"""The prepared model of a single design point of a batch, which the cache does not hold."""

from __future__ import annotations

import numpy as np

from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.prepared import PreparedModel, prepare
from squealstudy.study.design import DesignPoint


def prepared_of(design: DesignPoint) -> PreparedModel:
    """Prepared model with all component modes; ConvergenceError without steady sliding."""
    unreduced = ReductionSettings(np.inf, np.inf, 0.0)
    return prepare(design.assembly(), design.operating_point(), unreduced)
