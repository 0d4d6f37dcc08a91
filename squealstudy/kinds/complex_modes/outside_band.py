"""Looks for growing modes outside a study's band, at a few of its design points.

A study lists the modes of its band, but modes outside it may squeal too. They are searched for
below the band and up to `SEARCHED_BAND_FACTOR` times its top, to where a reduced model keeps its
component modes. The exact method does so at a few points, the one with the fastest growth in the
band and others spread over the design, which costs a few percent of a study. Models with few
coordinates are searched for all modes, at more points.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from squealstudy.engine.cache import is_prepared, known_gap, prepared_any
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.engine.workers import Workers
from squealstudy.kinds.complex_modes.batch import wider_roots
from squealstudy.kinds.complex_modes.problems import SweptStructure, swept_structures
from squealstudy.kinds.complex_modes.rows import ModeColumns
from squealstudy.mechanics.failures import FAILURES
from squealstudy.modes.full_order.modes import solve_family_point
from squealstudy.modes.judged_roots import damping_ratios, settled
from squealstudy.modes.point import PointModes, solve_point
from squealstudy.reduction.prepared import PreparedFamily
from squealstudy.root_pairs import RIGID_SHARE
from squealstudy.study.design import DesignPoint

SEARCHED_BAND_FACTOR = 1.5  # top of the searched range over the top of the band
EVERYTHING = 1e6  # factor on the band's top: above all modes of a model with few coordinates
# share of the design points that are searched; one takes as long as two exact points
CHECKED_POINT_SHARE = 0.02
MIN_CHECKED_POINTS, MAX_CHECKED_POINTS = 5, 8  # least and largest number of points searched
# coordinates up to which a model is cheap, and the number of its points that are searched
MAX_CHEAP_COORDINATES, MAX_CHECKED_POINTS_CHEAP = 60, 64


@dataclass(frozen=True)
class OutsideTask:
    """A design point, and the wider band in which it is searched.

    Attributes
    ----------
    row : int
        Row of the design point in the plan.
    point : DesignPoint
    structure : SweptStructure
        The point's structure, with the wider band as its band.
    band_hz : (low, high)
        Band of the study, Hz.
    tolerance : float
        Relative error of a root up to which growth within its error counts as none (`settled`).
    neutral : float
        A mode grows where its damping ratio is below minus this.
    """

    row: int
    point: DesignPoint
    structure: SweptStructure
    band_hz: tuple[float, float]
    tolerance: float
    neutral: float


@dataclass(frozen=True)
class Outside:
    """Growing roots outside the band at one design point.

    Attributes
    ----------
    row : int
        Row of the design point in the plan.
    below, above : ndarray complex
        Growing roots [rad/s] below and above the band, without those neutral within their error.
    diverges : bool
        Whether some root grows without oscillation, in the band or outside.
    """

    row: int
    below: np.ndarray
    above: np.ndarray
    diverges: bool


def look_outside(plan: Plan, columns: ModeColumns, workers: Workers) -> list[Outside]:
    """Growing roots outside the band at chosen points; failed points are left out.

    A meshed model that is solved unreduced is not searched: each point would take as long again.
    """
    if plan.method.rung.unreduced and has_mesh(plan.study):
        return []
    section, low, high = plan.study.definition.modes, *plan.band_hz
    top = high * (EVERYTHING if is_small(plan) else SEARCHED_BAND_FACTOR)
    if plan.stacked:
        return _outside_of_batch(plan, chosen_points(plan, columns), (RIGID_SHARE * high, top))
    wide = {s.key: replace(s, band_hz=(RIGID_SHARE * high, top)) for s in swept_structures(plan)}
    tasks = [
        OutsideTask(
            row=row,
            point=plan.tasks[row],
            structure=wide[plan.tasks[row].structure],
            band_hz=(low, high),
            tolerance=plan.method.tolerance,
            neutral=section.stability_tolerance,
        )
        for row in chosen_points(plan, columns)
    ]
    outside = workers.each(growing_outside, tasks, "outside the band")
    return sorted((g for g in outside if g is not None), key=lambda growing: growing.row)


def chosen_points(plan: Plan, columns: ModeColumns) -> list[int]:
    """Rows of the design points that are searched, first the one with the fastest growth."""
    growth = np.full(len(columns.counts), -np.inf)
    np.maximum.at(growth, columns.point, columns.lam.real)
    solved = np.flatnonzero(np.array(columns.points["status"].to_pylist()) == "ok")
    if not len(solved):
        return []
    count = min(
        len(solved),
        max(MIN_CHECKED_POINTS, min(MAX_CHECKED_POINTS, round(CHECKED_POINT_SHARE * len(solved)))),
    )
    if is_small(plan):
        count = min(len(solved), MAX_CHECKED_POINTS_CHEAP)
    return spread(plan.coordinates[solved], growth[solved], count, solved)


def is_small(plan: Plan) -> bool:
    """Whether the model has so few coordinates that all its modes cost next to nothing."""
    if plan.stacked:
        return True
    keys = (key for key in plan.structures if is_prepared(key))
    return all(prepared_any(key).model.n <= MAX_CHEAP_COORDINATES for key in islice(keys, 1))


def spread(X: np.ndarray, growth: np.ndarray, count: int, rows: np.ndarray) -> list[int]:
    """Choose at most `count` of the rows (n,), whose coordinates X (n, d) lie far apart.

    The first has the fastest growth. Each further one is farthest from those chosen before; among
    equally far ones it has the fastest growth. Rows with the coordinates of a chosen one are left
    out.
    """
    size = np.ptp(X, axis=0)
    X = (X - X.min(axis=0)) / np.where(size > 0, size, 1.0)
    order = np.argsort(-growth, kind="stable")
    X, rows = X[order], rows[order]
    chosen, distance = [0], np.linalg.norm(X - X[0], axis=1)
    while len(chosen) < count and distance.max() > 0:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(X - X[chosen[-1]], axis=1))
    return rows[chosen].tolist()


def growing_outside(task: OutsideTask) -> Outside | None:
    """Solve a design point over the wider band, in a worker; None where that fails."""
    try:
        modes = _wider_modes(task)
    except FAILURES:
        return None
    roots = modes.lam, modes.error_rung
    return _outside(task.row, *roots, task.band_hz, task.tolerance, task.neutral)


def _outside(
    row: int,
    lam: np.ndarray,
    error: np.ndarray,
    band_hz: tuple[float, float],
    tolerance: float,
    neutral: float,
) -> Outside:
    """Those of roots (k,) with these errors (k,), rad/s, that grow outside a band."""
    lam = settled(lam, error, tolerance)
    lam = lam[damping_ratios(lam) < -neutral]
    hz = np.abs(lam) / (2 * np.pi)
    diverges = bool((lam.imag == 0.0).any())
    return Outside(row, lam[hz < band_hz[0]], lam[hz > band_hz[1]], diverges)


def _outside_of_batch(plan: Plan, rows: list[int], wide_hz: tuple[float, float]) -> list[Outside]:
    """Growing roots outside the band at some points of a batch."""
    if not rows:
        return []
    roots_of_points = wider_roots(plan.tasks.at(np.array(rows)), wide_hz)
    neutral = plan.study.definition.modes.stability_tolerance
    looked = [
        _outside(row, *roots, plan.band_hz, plan.method.tolerance, neutral)
        for row, roots in zip(rows, roots_of_points, strict=True)
        if roots is not None
    ]
    return sorted(looked, key=lambda growing: growing.row)


def _wider_modes(task: OutsideTask) -> PointModes:
    key, band_hz = task.structure.key, task.structure.band_hz
    prepared = prepared_any(key)
    if isinstance(prepared, PreparedFamily):
        return solve_family_point(prepared, task.point.plain_values(), band_hz)
    return solve_point(prepared, task.point.state(), band_hz, known_gap(key, task.point))


def outside_facts(plan: Plan, looked: Sequence[Outside], started: float) -> dict[str, Any]:
    """Facts for the manifest: the searched range, the number of points, and the worst."""
    return {
        "reach_hz": None if is_small(plan) else SEARCHED_BAND_FACTOR * plan.band_hz[1],
        "looked": len(looked),
        "below": _worst(plan, [(point.row, point.below) for point in looked]),
        "above": _worst(plan, [(point.row, point.above) for point in looked]),
        "diverging": _diverging(plan, looked),
        "seconds": time.perf_counter() - started,
    }


def _diverging(plan: Plan, looked: Sequence[Outside]) -> dict[str, Any] | None:
    """Number of points that diverge, and the range of each swept parameter over them.

    None unless a real root grows outside the band: it has no frequency, and the band, which is of
    moduli, parts what belongs together.
    """
    beyond = (np.concatenate([point.below, point.above]) for point in looked)
    if not any((roots.imag == 0.0).any() for roots in beyond):
        return None
    rows = [point.row for point in looked if point.diverges]
    columns = {sweep.name: plan.tasks.column(sweep.name) for sweep in plan.study.sweeps}
    ranges = {
        name: [float(of_points[rows].min()), float(of_points[rows].max())]
        for name, of_points in columns.items()
    }
    return {"points": len(rows), "ranges": ranges}


def _worst(plan: Plan, roots: Sequence[tuple[int, np.ndarray]]) -> dict[str, Any] | None:
    """Facts on the root that grows fastest, and its point; None where no root grows."""
    growing = [(float(lam.real.max()), row, lam) for row, lam in roots if len(lam)]
    if not growing:
        return None
    _, row, lam = max(growing, key=lambda entry: entry[:2])
    root = lam[np.argmax(lam.real)]
    names = [sweep.name for sweep in plan.study.sweeps]
    return {
        "point_id": plan.tasks[row].point_id,
        "count": len(lam),
        "points": len(growing),
        "frequency_hz": float(abs(root) / (2 * np.pi)),
        "growth_rate": float(root.real),
        "oscillates": bool(root.imag != 0.0),
        "at": {name: float(plan.tasks.column(name)[row]) for name in names},
    }
