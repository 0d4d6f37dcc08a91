"""What a worker process does with a box of design points: patches, roots, rows, one chunk file."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from squealstudy.analysis.point import PointModes
from squealstudy.analysis.quadratic import dense_roots
from squealstudy.analysis.reanalysis.patch import Box
from squealstudy.analysis.reanalysis.perturbation import make_anchor, perturbed_roots
from squealstudy.analysis.reanalysis.point_roots import PointRoots
from squealstudy.analysis.reanalysis.two_step import two_step_roots
from squealstudy.analysis.reanalysis.windows import Windows
from squealstudy.errors import ConvergenceError
from squealstudy.study.complex_modes.bases import BasisTask, Reader, Served, served
from squealstudy.study.complex_modes.rows import failed_row, solved_row
from squealstudy.study.complex_modes.worker import ChunkTask, solve_alone
from squealstudy.study.design import Design
from squealstudy.study.method import OVER_A_BASIS, TWO_STEP, WINDOWS
from squealstudy.study.rows import FAILURES
from squealstudy.study.tasks import PointTask, Solved

TWO_STEP_FACTOR = 2.0  # cut-off of the real modes over the band: as commercial codes advise
PERTURBATION_ORDER = 2
ANCHOR_REACH = 4.0  # second-order terms run through the modes of the band widened by this


@dataclass(frozen=True, eq=False)
class WindowTask:
    """A box of design points of one structure.

    Attributes
    ----------
    basis : BasisTask
    method : str
        An approximate rung (study.method.APPROXIMATE).
    points : tuple of PointTask
    theta : ndarray (n, d)
        Their coordinates in the chart.
    low, high : ndarray (d,)
        The box.
    """

    basis: BasisTask
    method: str
    points: tuple[PointTask, ...]
    theta: np.ndarray
    low: np.ndarray
    high: np.ndarray


def solve_box(task: WindowTask) -> Solved:
    """Solve the points of a box."""
    last = time.perf_counter()
    rows: list[dict[str, Any]] = []
    ready = served(task.basis, task.method in OVER_A_BASIS)
    with contextlib.suppress(*FAILURES):
        for point in _solved(task, ready):
            point_id = task.points[point.row].point_id
            reader = ready.full if point.full else ready.reduced
            rows.append(_row(point_id, point, reader, last))
            last = time.perf_counter()
    return Solved([*rows, *_left(task, {row["point_id"] for row in rows})])


def _left(task: WindowTask, done: set[str]) -> list[dict[str, Any]]:
    """Rows of the points that a failure of the method left over: exact, or with its reason."""
    points = tuple(p for p in task.points if p.point_id not in done)
    alone = ChunkTask(task.basis.band_hz, points, False)
    return [solve_alone(point, alone, None)[0] for point in points]


def _solved(task: WindowTask, ready: Served) -> Iterator[PointRoots]:
    """Roots of the points of a box by the task's method, in any order."""
    if ready.basis is not None:
        windows = Windows(ready.problem, ready.basis, task.basis.tolerance)
        if task.method == WINDOWS:
            yield from windows.solve(Box(task.low, task.high), task.theta)
        else:
            yield from (windows.alone(theta, i) for i, theta in enumerate(task.theta))
    elif task.method == TWO_STEP:
        for i, theta in enumerate(task.theta):
            yield two_step_roots(ready.problem, theta, TWO_STEP_FACTOR, i)
    else:
        anchor = make_anchor(ready.problem, (task.low + task.high) / 2, ANCHOR_REACH)
        for i, theta in enumerate(task.theta):
            yield perturbed_roots(ready.problem, anchor, theta, PERTURBATION_ORDER, i)


def solve_in_basis(task: BasisTask, design: Design) -> tuple[np.ndarray, np.ndarray]:
    """Oscillating roots (m,) and shapes (m, k) of a point between those of a study.

    In its sweep basis alone, without an estimate.

    Raises
    ------
    ConvergenceError
        Where it has no working point.
    """
    ready = served(task, True)
    assert ready.basis is not None
    sample = ready.problem.samples(task.chart.theta([design.values]))[0]
    if isinstance(sample, ConvergenceError):
        raise sample
    C, K = ready.basis.small.matrices([sample.weights])
    lam, X = dense_roots(C[0], K[0], ready.problem.band)
    oscillating = lam.imag > 0
    return lam[oscillating], ready.reduced.shapes(X[:, oscillating])


def solve_in_box(task: WindowTask, design: Design) -> PointModes:
    """Modes of another design point of a box, by the method of the box.

    Raises
    ------
    ConvergenceError
        Where it has none.
    """
    ready = served(task.basis, task.method in OVER_A_BASIS)
    theta = task.basis.chart.theta([design.values])
    (found,) = _solved(replace(task, theta=theta), ready)
    if found.failure is not None:
        raise found.failure
    return (ready.full if found.full else ready.reduced).read(found)


def _row(point_id: str, found: PointRoots, reader: Reader, since: float) -> dict[str, Any]:
    if found.failure is not None:
        wall = time.perf_counter() - since
        return failed_row(point_id, wall, found.failure.status, str(found.failure))
    modes = reader.read(found)
    return solved_row(point_id, time.perf_counter() - since, modes)
