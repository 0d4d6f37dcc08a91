"""How far reduced models are from the full-order one: at some design points, carried to all.

At a sample of the design points of each structure both the reduced model and its finer one are
solved (analysis/full_order/finer_model.py). Another point takes, for each of its modes, the largest
relative error of the modes nearest in the complex plane at the nearest sample points. Complete
bases and unreduced models have no error of this kind: zero.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from squealstudy.analysis.full_order.finer_model import reduction_errors
from squealstudy.analysis.full_order.modes import LIGHT
from squealstudy.study.cache import prepared_path
from squealstudy.study.complex_modes.columns import ModeColumns
from squealstudy.study.files import write_json
from squealstudy.study.keys import content_hash, source_hash
from squealstudy.study.kind import Progress
from squealstudy.study.method import FULL
from squealstudy.study.parallel import in_parallel
from squealstudy.study.plan import Plan, farthest_points, has_mesh
from squealstudy.study.process import watch_parent
from squealstudy.study.rows import FAILURES, reason
from squealstudy.study.structures import patience
from squealstudy.study.tasks import PointTask
from squealstudy.study.working_points import prepared_model

SAFETY = 2.0  # on the distance to the finer model, for what that lacks too
ROUND_OFF = 1e-12  # relative: of the difference of two dense eigenvalues
POINTS_A_SAMPLE = 20  # design points that pay for one: it costs about two of them
LEAST, MOST = 3, 12  # sample points of a structure
NEAREST_POINTS, NEAREST_MODES = 3, 2  # of which the largest error is taken
NEAREST_SHARE = 1e-9  # of the sweeps' spans: a sample point is its own neighbour alone


@dataclass(frozen=True)
class Sample:
    """Errors at one design point: roots lam (m,) [rad/s] and errors relative to their moduli."""

    lam: np.ndarray
    relative: np.ndarray

    @property
    def worst(self) -> float:
        """Largest relative error of lightly damped and growing modes."""
        judged = (np.abs(self.lam.real) < LIGHT * np.abs(self.lam)) | (self.lam.real > 0)
        return float(self.relative[judged].max(initial=0.0))


@dataclass(frozen=True)
class SampleTask:
    """A design point to be solved in both models, and where the errors are kept."""

    point: PointTask
    band_hz: tuple[float, float]
    parent: int

    @property
    def path(self) -> Path:
        """Beside the prepared model; other studies with the same point find it."""
        values = sorted((k, float(v).hex()) for k, v in self.point.design.values.items())
        name = content_hash([source_hash(), self.point.design.law_kind, self.band_hz, values])
        return prepared_path(self.point.prepared_key) / "reduction_errors" / f"{name}.json"

    def read(self) -> Sample | None:
        """The errors that are kept; None where the point has none, or is not solved yet."""
        if not self.path.is_file():
            return None
        found = json.loads(self.path.read_text(encoding="utf-8"))
        if "roots" not in found:
            return None
        lam = np.array(found["roots"], dtype=float).reshape(-1, 2) @ np.array([1.0, 1.0j])
        return Sample(lam, np.array(found["relative_errors"], dtype=float))


def solve_sample(task: SampleTask) -> None:
    """Solve a sample point and keep its errors, or why it has none."""
    watch_parent(task.parent)
    prepared = prepared_model(task.point.prepared_key)
    try:
        with threadpool_limits(1):
            lam, error = reduction_errors(prepared, task.point.design.state(), task.band_hz)
    except FAILURES as failure:
        write_json(task.path, {"failure": reason(failure)})
        return
    relative = np.maximum(SAFETY * error / np.abs(lam), ROUND_OFF)
    roots = [[float(x.real), float(x.imag)] for x in lam]
    write_json(task.path, {"roots": roots, "relative_errors": relative.tolist()})


def is_reduced(plan: Plan) -> bool:
    """Whether the points of a plan are solved in models with an error of reduction."""
    return has_mesh(plan.study) and plan.method.name != FULL


def sample_points(plan: Plan) -> list[int]:
    """Indices of the sample points: of each structure those farthest from each other."""
    by_structure: dict[str, list[int]] = {}
    for i, task in enumerate(plan.tasks):
        by_structure.setdefault(task.prepared_key, []).append(i)
    chosen: list[int] = []
    for own in by_structure.values():
        count = min(max(LEAST, len(own) // POINTS_A_SAMPLE), MOST)
        chosen += [own[k] for k in farthest_points(plan.coordinates[own], count)]
    return chosen


def make_samples(
    plan: Plan, jobs: int, failures: Mapping[str, str], report: Progress
) -> list[tuple[int, Sample]]:
    """Sample points and their errors, solved where the cache does not hold them."""
    if not is_reduced(plan):
        return []
    chosen = [i for i in sample_points(plan) if plan.tasks[i].prepared_key not in failures]
    tasks = {i: SampleTask(plan.tasks[i], plan.band_hz, os.getpid()) for i in chosen}
    missing = [task for task in tasks.values() if not task.path.is_file()]
    for done, _ in enumerate(
        in_parallel(jobs, [(solve_sample, task) for task in missing], patience(plan))
    ):
        report("errors of the reduction", done + 1, len(missing))
    found = ((i, task.read()) for i, task in tasks.items())
    return [(i, sample) for i, sample in found if sample is not None]


def carried_errors(
    plan: Plan, columns: ModeColumns, samples: Sequence[tuple[int, Sample]]
) -> np.ndarray:
    """Error of the reduction (N,) of every mode of a study, rad/s.

    Zero where models are not reduced; NaN where no sample point of the structure has modes.
    """
    if not is_reduced(plan):
        return np.zeros(len(columns.lam))
    X = scaled(plan.coordinates)
    by_structure: dict[str, list[tuple[int, Sample]]] = {}
    for i, sample in samples:
        if len(sample.lam):
            by_structure.setdefault(plan.tasks[i].prepared_key, []).append((i, sample))
    ends = np.append(0, np.cumsum(columns.counts))
    found = np.full(len(columns.lam), np.nan)
    for point, task in enumerate(plan.tasks):
        own = slice(ends[point], ends[point + 1])
        near = by_structure.get(task.prepared_key, [])
        if near and ends[point + 1] > ends[point]:
            distance = np.linalg.norm(X[[i for i, _ in near]] - X[point], axis=1)
            lam = columns.lam[own]
            chosen = [sample for _, sample in near]
            found[own] = carried(lam, chosen, distance) * np.abs(lam)
    return found


def carried(lam: np.ndarray, samples: Sequence[Sample], distance: np.ndarray) -> np.ndarray:
    """Relative errors (m,) of roots lam by sample points at these distances (s,)."""
    order = np.argsort(distance, kind="stable")
    here = distance[order[0]] <= NEAREST_SHARE
    points, modes = (1, 1) if here else (NEAREST_POINTS, NEAREST_MODES)
    relative = np.zeros(len(lam))
    for k in order[:points]:
        sample = samples[k]
        apart = np.abs(lam[:, None] - sample.lam[None, :])
        nearest = np.argsort(apart, axis=1, kind="stable")[:, :modes]
        relative = np.maximum(relative, sample.relative[nearest].max(axis=1))
    return relative


def scaled(X: np.ndarray) -> np.ndarray:
    """Coordinates (n, d) of design points in units of their spans."""
    span = np.ptp(X, axis=0) if len(X) else np.ones(X.shape[1])
    unit: np.ndarray = (X - X.min(axis=0, initial=np.inf)) / np.where(span > 0, span, 1.0)
    return unit
