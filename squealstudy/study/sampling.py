"""Design points of a study: every combination, side by side, or spread over the ranges."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.sweeps import SOBOL_INDICES, beyond_range_text

GRIDS = ("grid", "boundary")  # a boundary design begins as a grid


def count_points(study: ResolvedStudy) -> int:
    """Number of design points, without making them; of a boundary design those it begins with."""
    design = study.definition.design
    if design.samples is not None:
        groups = len(study.sweeps) + 2 if design.type == SOBOL_INDICES else 1
        return design.samples * groups
    lengths = [len(sweep.values) for sweep in study.sweeps]
    return math.prod(lengths) if design.type in GRIDS else max(lengths, default=1)


def grid_shape(study: ResolvedStudy) -> tuple[int, ...] | None:
    """Number of values of each sweep, the first varying fastest; None where there is no grid."""
    if study.definition.design.type != "grid":
        return None
    return tuple(len(sweep.values) for sweep in study.sweeps)


def design_points(study: ResolvedStudy) -> np.ndarray:
    """Swept values (n_points, n_sweeps) of the design points, sweeps in the order of the file.

    In a grid the first sweep varies fastest: its lines are contiguous. The points of a random
    design are decided by its seed. A boundary design begins with its coarse grid.

    Raises
    ------
    StudyFileError
        Where a distribution gives a value that its parameter cannot take.
    """
    kind = study.definition.design.type
    count, repeats = count_points(study), 1
    if kind not in (*GRIDS, "zip"):
        return _random_points(study)
    points = np.empty((count, len(study.sweeps)), order="F")
    for k, sweep in enumerate(study.sweeps):
        values = np.array(sweep.values)
        if kind in GRIDS:
            values = np.tile(np.repeat(values, repeats), count // (repeats * len(values)))
            repeats *= len(sweep.values)
        points[:, k] = values
    return points


def _random_points(study: ResolvedStudy) -> np.ndarray:
    unit = _unit_points(study)
    points = np.empty(unit.shape, order="F")
    for k, u in enumerate(unit.T):
        points[:, k] = _sampled(study, k, u)
    return points


def _unit_points(study: ResolvedStudy) -> np.ndarray:
    """Points in the unit cube (n_points, n_sweeps)."""
    from scipy.stats import qmc

    design, d = study.definition.design, len(study.sweeps)
    n = design.samples or 1
    rng = np.random.default_rng(design.seed)
    if design.type == "latin_hypercube":
        return np.asarray(qmc.LatinHypercube(d, seed=rng).random(n))
    bits = (n - 1).bit_length()
    if (
        design.type == SOBOL_INDICES
    ):  # one sequence of twice the dimension: its halves are independent
        both = np.asarray(qmc.Sobol(2 * d, scramble=True, seed=rng).random_base2(bits))
        from squealstudy.tables.sobol import saltelli_rows  # imports pandas, which is slow

        return saltelli_rows(both[:, :d], both[:, d:])
    # a power of two is drawn, and its beginning taken: the sequence is the same
    sobol = qmc.Sobol(d, scramble=True, seed=rng)
    return np.asarray(sobol.random_base2(bits))[:n]


def _sampled(study: ResolvedStudy, number: int, u: np.ndarray) -> np.ndarray:
    """Values (n,) of one sweep from numbers (n,) in [0, 1); StudyFileError."""
    sweep = study.sweeps[number]
    if sweep.distribution is None:
        raise ValueError(f"sweep '{sweep.name}' has no distribution")
    values = sweep.distribution.quantiles(u)
    for extreme in (values.min(), values.max()):
        try:
            sweep.parameter.check(float(extreme))
        except ParameterError as e:
            message = f"{sweep.name}: {beyond_range_text(sweep.distribution, e.message)}"
            raise study.error(("sweep", number, "distribution"), message) from None
    return values


def distinct_rows(columns: Sequence[np.ndarray], count: int) -> np.ndarray:
    """Number (count,) int32 of each point's row of values; equal rows have one number.

    Rows are numbered by first appearance. `columns` are arrays (count,); without any all rows are
    equal.
    """
    index = np.zeros(count, dtype=np.int64)
    for column in columns:
        _, column_rows = np.unique(column, return_inverse=True)
        _, index = np.unique(
            index * (int(column_rows.max()) + 1) + column_rows, return_inverse=True
        )
    _, first, index = np.unique(index, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int32)
    rank[np.argsort(first)] = np.arange(len(first))
    row_numbers: np.ndarray = rank[index]
    return row_numbers


def farthest_points(X: np.ndarray, count: int) -> list[int]:
    """Indices of `count` of the points X (n, d): the upper corner, then those farthest from all."""
    if not X.shape[1]:
        return list(range(min(count, len(X))))
    span = np.ptp(X, axis=0)
    X = (X - X.min(axis=0)) / np.where(span > 0, span, 1.0)
    chosen = [int(np.argmax(X.sum(axis=1)))][:count]
    nearest = np.full(len(X), np.inf)  # distance of each point to the chosen ones
    while 0 < len(chosen) < min(count, len(X)):
        nearest = np.minimum(nearest, np.linalg.norm(X - X[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(nearest)))
    return chosen
