"""Families of matrices at design points."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from squealstudy.linalg.band_roots import BandRoots, pair_residuals
from squealstudy.linalg.companion import all_roots, regular
from squealstudy.linalg.sparse_qep import DENSE_LIMIT
from squealstudy.mechanics.failures import FAILURES
from squealstudy.mechanics.pairs import PointPairs
from squealstudy.mechanics.values import Values
from squealstudy.models.matrices.family import MatrixFamily
from squealstudy.models.model_point import ModelPoint
from squealstudy.modes.full_order.modes import FULL, family_matrices, family_roots
from squealstudy.modes.point import oscillating_first
from squealstudy.reduction.prepared import prepare_family
from squealstudy.root_pairs import angular_band

ResultT = TypeVar("ResultT")
# Hz: all modes are solved in two bands, so that round-off of the high ones does not spoil the low
LOW_BAND = (1e-300, 17317.0)


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
    family: MatrixFamily,
    values: Values,
    band_hz: tuple[float, float],
    single: bool,
    all_modes: bool = False,
) -> list[PointPairs | Exception]:
    """Complex modes of each design point in a band [Hz], or why it has none.

    With `all_modes` the band only serves matrices of more than DENSE_LIMIT coordinates, and
    singular M.
    """
    prepared = prepare_family(family, values.definition.defaults(), angular_band(band_hz))
    all_modes = all_modes and family.n <= DENSE_LIMIT

    def solve(point: ModelPoint) -> PointPairs:
        M, C, K = family_matrices(family, point.plain_values(), dense=all_modes)
        bands = _bands_of_all(M, C, K) if all_modes else []
        parts = [family_roots(prepared, (M, C, K), band) for band in bands or [band_hz]]
        roots = _joined(parts)
        lam, psi = roots.lam, roots.psi
        nothing, residual = np.zeros(len(lam)), pair_residuals(M, C, K, lam, psi)
        return PointPairs(lam, psi, residual, roots.error, nothing, np.zeros((0, len(lam))), FULL)

    return _each(values, solve, single)


def _bands_of_all(M: np.ndarray, C: np.ndarray, K: np.ndarray) -> list[tuple[float, float]]:
    """Bands [Hz] that hold all roots; none where M is singular, which has infinite ones."""
    if not regular(M):
        return []
    C, K = np.hsplit(np.linalg.solve(M, np.hstack([C, K])), 2)
    top = 2 * float(np.abs(all_roots(C, K)).max()) / (2 * np.pi)
    return [LOW_BAND, (LOW_BAND[1], top)] if top > LOW_BAND[1] else [LOW_BAND]


def _joined(parts: list[BandRoots]) -> BandRoots:
    """Roots of several bands as of one, oscillating ones first."""
    lam = np.concatenate([part.lam for part in parts])
    psi = np.hstack([part.psi for part in parts])
    order, error = oscillating_first(lam), np.concatenate([part.error for part in parts])
    return BandRoots(lam[order], psi[:, order], parts[-1].n_below, error[order])
