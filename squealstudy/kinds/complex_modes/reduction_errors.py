"""Estimates errors of reduced models at some design points, and carries them to all.

At a sample of each structure's design points both the reduced model and its finer model are solved
(modes/full_order/finer_model.py). A mode of another point gets the geometric mean of the relative
errors of the modes nearest to it in the complex plane at the nearest sample points, times a safety
factor. Models with a complete basis and unreduced models have no error of this kind: it is zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from squealstudy.engine.cache import (
    discard,
    is_whole,
    load_value,
    prepared_model,
    prepared_path,
    save_value,
)
from squealstudy.engine.keys import content_hash, source_hash
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.engine.workers import Workers
from squealstudy.kinds.complex_modes.rows import ModeColumns
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.modes.full_order.finer_model import relative_errors
from squealstudy.modes.judged_roots import light_or_growing
from squealstudy.modes.point import solve_point
from squealstudy.study.design import DesignPoint
from squealstudy.study.sampling import farthest_points

CARRIED_SAFETY_FACTOR = 2.0  # on errors carried from other points
POINTS_A_SAMPLE = 16  # design points for each sample point, which costs as much as three of them
MIN_REDUCTION_SAMPLES, MAX_REDUCTION_SAMPLES = 8, 16  # sample points of a structure
NEAREST = 3  # number of sample points from which the error of a point is estimated
# distance, in spans of the sweeps, within which a point counts as a sample point
SAMPLE_POINT_DISTANCE = 1e-9
MODES_PER_BLOCK = 20_000  # modes whose distances are held in memory at once


@dataclass(frozen=True)
class ReductionErrors:
    """Errors at one design point: roots lam (m,) [rad/s], and errors (m,) relative to ``|lam|``."""

    lam: np.ndarray
    relative: np.ndarray

    @property
    def fit(self) -> bool:
        """Whether shapes and types are those of this class; a cache file may hold others."""
        lam, relative = self.lam, self.relative
        return (
            isinstance(lam, np.ndarray)
            and isinstance(relative, np.ndarray)
            and lam.shape == relative.shape == (lam.size,)
            and lam.dtype == np.complex128
            and relative.dtype == np.float64
        )

    @property
    def worst(self) -> float:
        """Largest relative error of the lightly damped and growing modes; zero without any."""
        return float(self.relative[light_or_growing(self.lam)].max(initial=0.0))


@dataclass(frozen=True)
class ReductionErrorTask:
    """A design point to be solved in both models, and the path at which its errors are kept.

    The process that makes the task decides the path. In another process, which may know other laws,
    the same point could have another name.
    """

    point: DesignPoint
    band_hz: tuple[float, float]
    path: Path

    @classmethod
    def of(cls, point: DesignPoint, band_hz: tuple[float, float]) -> ReductionErrorTask:
        """The task of a point; its path is beside the prepared model, for other studies to find."""
        values = sorted((k, float(v).hex()) for k, v in point.own_values.items())
        name = content_hash([source_hash(), point.law_identity, band_hz, values])
        return cls(point, band_hz, prepared_path(point.structure) / "reduction_errors" / name)

    def read(self) -> ReductionErrors | str | None:
        """The stored errors, or why there are none; None where nothing usable is stored."""
        stored = load_value(self.path) if is_whole(self.path) else None
        if isinstance(stored, str) or (isinstance(stored, ReductionErrors) and stored.fit):
            return stored
        return None  # of another version


def solve_sample(task: ReductionErrorTask) -> None:
    """Solve a sample point and keep its errors, or why it has none."""
    prepared = prepared_model(task.point.structure)
    discard(task.path)  # a file that is there holds no ReductionErrors
    try:
        state = task.point.state()
        modes = solve_point(prepared, state, task.band_hz)
        relative = relative_errors(prepared, state, task.band_hz, modes)
    except FAILURES as failure:
        save_value(task.path, reason(failure))
    else:
        save_value(task.path, ReductionErrors(modes.lam, relative))


def is_reduced(plan: Plan) -> bool:
    """Whether a plan solves its points in reduced models."""
    return has_mesh(plan.study) and not plan.method.rung.unreduced


def sample_points(plan: Plan) -> list[int]:
    """Indices of the sample points: for each structure points that are far from each other."""
    chosen: list[int] = []
    for _, rows in plan.tasks.of_structures():
        count = min(max(MIN_REDUCTION_SAMPLES, len(rows) // POINTS_A_SAMPLE), MAX_REDUCTION_SAMPLES)
        chosen += [int(rows[k]) for k in farthest_points(plan.coordinates[rows], count)]
    return chosen


def make_samples(
    plan: Plan, failures: Mapping[str, str], workers: Workers
) -> list[tuple[int, ReductionErrors]]:
    """Indices of sample points and their errors, solved where the cache does not hold them.

    Points at which one of the models fails are left out.
    """
    if not is_reduced(plan):
        return []
    chosen = [i for i in sample_points(plan) if plan.tasks[i].structure not in failures]
    tasks = {i: ReductionErrorTask.of(plan.tasks[i], plan.band_hz) for i in chosen}
    missing = [task for task in tasks.values() if task.read() is None]
    for _ in workers.each(solve_sample, missing, "errors of the reduction"):
        pass
    errors_of = ((i, task.read()) for i, task in tasks.items())
    return [(i, sample) for i, sample in errors_of if isinstance(sample, ReductionErrors)]


def carried_errors(
    plan: Plan, columns: ModeColumns, samples: Sequence[tuple[int, ReductionErrors]]
) -> np.ndarray:
    """Estimated error (N,) of the reduction of every mode of a study, rad/s.

    Zero where models are not reduced; NaN where no sample point of the structure has modes.
    """
    if not is_reduced(plan):
        return np.zeros(len(columns.lam))
    X, key = scaled(plan.coordinates), np.array(plan.tasks.structures)[plan.tasks.structure_index]
    point = columns.point
    relative = np.full(len(columns.lam), np.nan)
    with_modes = [(i, sample) for i, sample in samples if len(sample.lam)]
    for structure in dict.fromkeys(key[i] for i, _ in with_modes):
        same_structure = [(i, sample) for i, sample in with_modes if key[i] == structure]
        rows = np.flatnonzero(key[point] == structure)
        distance = np.linalg.norm(X[:, None] - X[None, [i for i, _ in same_structure]], axis=2)
        lam, chosen = columns.lam[rows], [sample for _, sample in same_structure]
        relative[rows] = carried(lam, point[rows], distance, chosen)
    return relative * np.abs(columns.lam)


def carried(
    lam: np.ndarray, point: np.ndarray, distance: np.ndarray, samples: Sequence[ReductionErrors]
) -> np.ndarray:
    """Relative errors (m,) of roots, carried from sample points.

    `lam` (m,) are the roots, `point` (m,) the index of the point of each, and `distance` (n, s) is
    that of each point from each sample point. Logarithms of errors are averaged over the NEAREST
    sample points, weighted by the inverse square of the distance, and the result is raised by
    CARRIED_SAFETY_FACTOR. A sample point takes its own errors, without the factor.
    """
    nearest = np.argsort(distance, axis=1, kind="stable")[:, :NEAREST]
    distance_to_nearest = np.take_along_axis(distance, nearest, axis=1)
    is_sample = distance_to_nearest[:, 0] <= SAMPLE_POINT_DISTANCE
    weight = 1.0 / np.maximum(distance_to_nearest, SAMPLE_POINT_DISTANCE) ** 2
    weight = np.where(is_sample[:, None], np.arange(nearest.shape[1]) == 0, weight)
    weight /= weight.sum(axis=1, keepdims=True)
    total = np.zeros(len(lam))
    for k, sample in enumerate(samples):
        share = np.where(nearest == k, weight, 0.0).sum(axis=1)
        rows = np.flatnonzero(share[point])
        error = np.log(sample.relative[_nearest(lam[rows], sample.lam)])
        total[rows] += share[point[rows]] * error
    relative: np.ndarray = np.exp(total) * np.where(is_sample, 1.0, CARRIED_SAFETY_FACTOR)[point]
    return relative


def _nearest(lam: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Index (m,), among the others, of the root nearest to each of lam in the complex plane."""
    indices = [
        np.abs(lam[start : start + MODES_PER_BLOCK, None] - others[None, :]).argmin(axis=1)
        for start in range(0, len(lam), MODES_PER_BLOCK)
    ]
    return np.concatenate([np.zeros(0, dtype=int), *indices])


def scaled(X: np.ndarray) -> np.ndarray:
    """Coordinates (n, d) of design points, scaled to [0, 1]; zero where they do not vary."""
    span = np.ptp(X, axis=0) if len(X) else np.ones(X.shape[1])
    unit: np.ndarray = (X - X.min(axis=0, initial=np.inf)) / np.where(span > 0, span, 1.0)
    return unit
