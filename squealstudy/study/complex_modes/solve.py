"""One design point of any model: the only place where assemblies and matrix families part."""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.full_order.family_point import solve_family_point
from squealstudy.analysis.point import PointModes, solve_point
from squealstudy.reduction.prepared_family import PreparedFamily
from squealstudy.study.design import Design
from squealstudy.study.family_cache import Prepared


def solve_design(
    prepared: Prepared,
    design: Design,
    band_hz: tuple[float, float],
    known: np.ndarray | None = None,
) -> PointModes:
    """Complex modes of a design point in a band.

    `known` are gaps of its working point where a study has solved it before; a family of matrices
    has none.

    Raises
    ------
    ConvergenceError
        As `solve_family_point` and `solve_point`.
    """
    if isinstance(prepared, PreparedFamily):
        return solve_family_point(prepared, design.plain_values(), band_hz)
    return solve_point(prepared, design.state(), band_hz, known)
