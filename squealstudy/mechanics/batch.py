"""Complex modes of a batch of point masses on springs and contact, all design points at once.

Coordinates are displacements times the square root of each mass, as in `System.linear` and in
single points of the batch.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.mechanics.stacked_rows import OK
from squealstudy.mechanics.values import Values
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.stacked.modes import (
    MOST_COORDINATES,
    POINTS_PER_BLOCK,
    StackedSystem,
    stacked_system,
)
from squealstudy.stacked.roots import StackedRoots


class BatchModes(NamedTuple):
    """Modes of m design points; rows with fewer than k modes are filled up with NaN.

    Attributes
    ----------
    counts : ndarray (m,) of int
        Number of modes of each design point.
    lam, residual, error : ndarray (m, k)
        Roots [rad/s], their normwise backward errors (no unit) and estimated errors [rad/s].
    right : ndarray (m, n, k) complex
        Right vectors.
    energies : ndarray (m, parts, k)
        Shares of elastic energy, 0 to 1.
    status, message : ndarray (m,) of str
        ``ok``, or why there are no modes.
    """

    counts: np.ndarray
    lam: np.ndarray
    residual: np.ndarray
    error: np.ndarray
    right: np.ndarray
    energies: np.ndarray
    status: np.ndarray
    message: np.ndarray


def is_small_batch(values: Values) -> bool:
    """Whether values are a batch of a model that is small enough for arrays of all points."""
    definition = values.definition
    if values.length is None or definition.meshed or isinstance(definition, FamilyDefinition):
        return False
    try:
        assembly = values.point(0).assembly()
    except FAILURES:  # solving point by point reports them
        return False
    plain = all(c.correspondence is None for c in assembly.components)
    return plain and assembly.n_dof <= MOST_COORDINATES


def is_point_mass_batch(values: Values) -> bool:
    """Whether a small batch is of point masses alone: their coordinates are unambiguous."""
    return is_small_batch(values) and all(
        not c.K.count_nonzero() and not (c.M - sp.diags(c.M.diagonal())).count_nonzero()
        for c in values.point(0).assembly().components
    )


def batch_modes(values: Values, band_hz: tuple[float, float]) -> BatchModes:
    """Complex modes of a batch in a band, solved in blocks of POINTS_PER_BLOCK design points."""
    parts = [
        _batch_block(values, slice(start, min(start + POINTS_PER_BLOCK, values.count)), band_hz)
        for start in range(0, values.count, POINTS_PER_BLOCK)
    ]
    width = max(part.lam.shape[1] for part in parts)
    return BatchModes(
        *(_joined(list(field_parts), width) for field_parts in zip(*parts, strict=True))
    )


def _joined(arrays: list[np.ndarray], width: int) -> np.ndarray:
    """Arrays one after the other, their last axis filled up with NaN where it counts modes."""
    if arrays[0].ndim == 1:
        return np.concatenate(arrays)
    shape = (sum(map(len, arrays)), *arrays[0].shape[1:-1], width)
    joined_array = np.full(shape, np.nan, dtype=arrays[0].dtype)
    start = 0
    for array in arrays:
        joined_array[start : start + len(array), ..., : array.shape[-1]] = array
        start += len(array)
    return joined_array


def _batch_block(values: Values, rows: slice, band_hz: tuple[float, float]) -> BatchModes:
    """Modes of some rows of a batch; where solving them together fails, row by row."""
    count = rows.stop - rows.start
    columns = {k: x[rows] if isinstance(x, np.ndarray) else x for k, x in values.columns.items()}
    try:
        system = stacked_system(values.definition, values.options, columns, count)
        return _batch_modes(system, system.roots(band_hz))
    except FAILURES as error:
        if count == 1:
            return _failed(values, *reason(error))
        single_rows = (slice(i, i + 1) for i in range(rows.start, rows.stop))
        parts = [_batch_block(values, row, band_hz) for row in single_rows]
        width = max(part.lam.shape[1] for part in parts)
        return BatchModes(
            *(_joined(list(field_parts), width) for field_parts in zip(*parts, strict=True))
        )


def _batch_modes(system: StackedSystem, roots: StackedRoots) -> BatchModes:
    """Modes of solved rows, NaN beyond the number of roots of each."""
    is_root = roots.held

    def only_roots(values: np.ndarray) -> np.ndarray:
        mask = is_root if values.ndim == 2 else is_root[:, None, :]
        return np.where(mask, values, np.nan)

    ok = (OK, "")
    outcomes = [system.failures.get(i, ok) for i in range(len(is_root))]
    return BatchModes(
        counts=roots.count,
        lam=only_roots(roots.lam),
        residual=only_roots(roots.residual),
        error=only_roots(roots.error),
        right=only_roots(roots.psi),
        energies=only_roots(system.energies(roots.psi)),
        status=np.array([status for status, _ in outcomes], object),
        message=np.array([message for _, message in outcomes], object),
    )


def _failed(values: Values, status: str, message: str) -> BatchModes:
    """A row without modes, for a design point that failed."""
    n = values.point(0).assembly().n_dof
    parts = len(values.definition.energy_parts)
    return BatchModes(
        counts=np.zeros(1, dtype=int),
        lam=np.zeros((1, 0), dtype=complex),
        residual=np.zeros((1, 0)),
        error=np.zeros((1, 0)),
        right=np.zeros((1, n, 0), dtype=complex),
        energies=np.zeros((1, parts, 0)),
        status=np.array([status], object),
        message=np.array([message], object),
    )
