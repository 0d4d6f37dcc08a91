"""Families of matrices at design points."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from squealstudy.linalg.band_roots import pair_residuals
from squealstudy.mechanics.failures import FAILURES
from squealstudy.mechanics.pairs import PointPairs
from squealstudy.mechanics.values import Values
from squealstudy.models.matrices.family import MatrixFamily
from squealstudy.models.model_point import ModelPoint
from squealstudy.modes.full_order.modes import FULL, family_matrices, family_roots
from squealstudy.reduction.prepared import prepare_family
from squealstudy.root_pairs import angular_band

ResultT = TypeVar("ResultT")


def _each(
    values: Values, solve: Callable[[ModelPoint], ResultT], single: bool
) -> list[ResultT | Exception]:
    """Results of `solve` at each design point, or its error; a `single` failure is raised."""
    results: list[ResultT | Exception] = []
    for number in range(values.count):
        try:
            results.append(solve(values.point(number)))
        except FAILURES as error:
            if single:
                raise
            results.append(error)
    return results


def matrices_of(
    family: MatrixFamily, values: Values, single: bool
) -> list[tuple[np.ndarray, ...] | Exception]:
    """M, C, K (n, n) of each design point, or why it has none."""

    def solve(point: ModelPoint) -> tuple[np.ndarray, ...]:
        point_matrices = family_matrices(family, point.plain_values())
        return tuple(np.asarray(A.toarray()) for A in point_matrices)

    return _each(values, solve, single)


def pairs_of(
    family: MatrixFamily, values: Values, band_hz: tuple[float, float], single: bool
) -> list[PointPairs | Exception]:
    """Complex modes of each design point in a band [Hz], or why it has none."""
    prepared = prepare_family(family, values.definition.defaults(), angular_band(band_hz))

    def solve(point: ModelPoint) -> PointPairs:
        M, C, K = family_matrices(family, point.plain_values())
        roots = family_roots(prepared, (M, C, K), band_hz)
        lam, psi = roots.lam, roots.psi
        nothing, residual = np.zeros(len(lam)), pair_residuals(M, C, K, lam, psi)
        return PointPairs(lam, psi, residual, roots.error, nothing, np.zeros((0, len(lam))), FULL)

    return _each(values, solve, single)
