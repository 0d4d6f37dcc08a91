"""The prepared model of a single design point of a batch, which no cache holds."""

from __future__ import annotations

import numpy as np

from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.prepared import PreparedModel, prepare
from squealstudy.study.design import DesignPoint


def prepared_of(design: DesignPoint) -> PreparedModel:
    """All modes of its components; ConvergenceError without steady sliding."""
    unreduced = ReductionSettings(np.inf, np.inf, 0.0)
    return prepare(design.assembly(), design.operating_point(), unreduced)
