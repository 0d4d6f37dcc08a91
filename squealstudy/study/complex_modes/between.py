"""Design points between those of a study: for tracking and onsets, in no table."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from threadpoolctl import ThreadpoolController

from squealstudy.analysis.point import state_working_point
from squealstudy.analysis.tracking.interpolated import InterpolatedModes, ModalMatrices
from squealstudy.analysis.tracking.refinement import Modes
from squealstudy.errors import ConvergenceError
from squealstudy.study.cache import load_prepared
from squealstudy.study.complex_modes.bases import BasisTask
from squealstudy.study.complex_modes.full_rung import FullRung
from squealstudy.study.complex_modes.solve import solve_design
from squealstudy.study.complex_modes.window_tasks import basis_tasks, window_tasks
from squealstudy.study.complex_modes.window_worker import (
    WindowTask,
    solve_in_basis,
    solve_in_box,
)
from squealstudy.study.design import Design
from squealstudy.study.family_cache import prepared_any
from squealstudy.study.method import FOR_COMPARISON, FULL, OVER_A_BASIS
from squealstudy.study.plan import Plan
from squealstudy.study.tasks import PointTask
from squealstudy.study.working_points import known_gap
from squealstudy.system.linearise import linearise


@cache
def _threads() -> ThreadpoolController:
    """Of the libraries of this process: looking for them takes as long as a small solve."""
    return ThreadpoolController()


@dataclass(frozen=True)
class Between:
    """The neighbourhood of a design point, in which one prepared model holds.

    Attributes
    ----------
    prepared_key : str
    design : Design
        Of the point at coordinates `x`.
    x : ndarray (p,)
        As in Plan.coordinates.
    sweeps : tuple of (str, bool)
        Name of each coordinate, and whether it is a logarithm.
    band_hz : (low, high)
    by : BasisTask, WindowTask, FullRung or None
        What the study's method solves by: a sweep basis, a box, the unreduced model; None for the
        reduced model itself.
    """

    prepared_key: str
    design: Design
    x: np.ndarray
    sweeps: tuple[tuple[str, bool], ...]
    band_hz: tuple[float, float]
    by: BasisTask | WindowTask | FullRung | None = None

    def design_at(self, x: np.ndarray) -> Design:
        """The design at other coordinates (p,); coordinates that agree keep their exact value."""
        values = dict(self.design.values)
        for (name, log), own, other in zip(self.sweeps, self.x, x, strict=True):
            if other != own:
                values[name] = float(np.exp(other) if log else other)
        return replace(self.design, values=values)

    def solve(self, x: np.ndarray) -> Modes:
        """Oscillating modes at coordinates (p,).

        Raises
        ------
        ConvergenceError
            Where there are none: no working point, or an eigenproblem without solution.
        """
        try:
            with _threads().limit(limits=1):
                return self._solved(self.design_at(x))
        except (np.linalg.LinAlgError, FloatingPointError, ValueError) as error:
            raise ConvergenceError("failed", f"{type(error).__name__}: {error}") from error

    def matrices(self) -> ModalMatrices:
        """The design point in the real modes of its structure, of an assembly.

        Raises
        ------
        ConvergenceError
            Where there is no working point.
        """
        prepared = load_prepared(self.prepared_key)
        state, X = self.design.state(), prepared.shape_basis
        known = known_gap(self.prepared_key, self.design)
        with _threads().limit(limits=1):
            point = state_working_point(prepared, state, known)
            system = linearise(prepared.model, point, state)
            return ModalMatrices(X.T @ system.C @ X, X.T @ system.K @ X, prepared.sensor_shapes)

    def way_to(self, other: Between) -> InterpolatedModes:
        """What lies between this point and one of another structure.

        Raises
        ------
        ConvergenceError
            Where one of both has no working point.
        """
        band = (2 * np.pi * self.band_hz[0], 2 * np.pi * self.band_hz[1])
        return InterpolatedModes(self.matrices(), other.matrices(), self.x, other.x, band)

    def _solved(self, design: Design) -> Modes:
        if isinstance(self.by, BasisTask):
            return Modes(*solve_in_basis(self.by, design))
        if isinstance(self.by, WindowTask):
            found = solve_in_box(self.by, design)
        elif isinstance(self.by, FullRung):
            found = self.by.solve(PointTask("", design, self.prepared_key), self.band_hz)
        else:
            found = solve_design(prepared_any(self.prepared_key), design, self.band_hz)
        kept = ~found.overdamped
        return Modes(found.lam[kept], found.shapes[kept])


class Neighbourhoods:
    """Makes the neighbourhoods of a plan's design points.

    Parameters
    ----------
    plan : Plan
    whole : Plan or None
        The plan whose boxes and bases serve the points, where these are only some of its points.
    """

    def __init__(self, plan: Plan, whole: Plan | None = None) -> None:
        self._plan = plan
        whole = plan if whole is None else whole
        method = whole.method.name
        bases = basis_tasks(whole) if method in OVER_A_BASIS else []
        self._bases = {b.key: b for b in bases if b.path.is_file()}
        boxes = window_tasks(whole, whole.tasks) if method in FOR_COMPARISON else []
        self._boxes = {
            task.point_id: replace(box, points=(), theta=box.theta[:0])
            for box in boxes
            for task in box.points
        }
        self._full = FullRung(plan.study.options, plan.settings) if method == FULL else None
        self._sweeps = tuple(
            (s.name, s.scale == "log" and all(point[s.name] > 0 for point in plan.swept))
            for s in plan.study.sweeps
        )

    def of(self, point: int) -> Between:
        """What lies around a design point."""
        task, x = self._plan.tasks[point], self._plan.coordinates[point]
        by = self._bases.get(task.prepared_key) or self._boxes.get(task.point_id) or self._full
        return Between(task.prepared_key, task.design, x, self._sweeps, self._plan.band_hz, by)

    def logarithmic(self, column: int) -> bool:
        """Whether a coordinate is a logarithm."""
        return self._sweeps[column][1]

    def joined(self, a: int, b: int) -> bool:
        """Whether one prepared model holds at both points, and so between them."""
        return self._plan.tasks[a].prepared_key == self._plan.tasks[b].prepared_key
