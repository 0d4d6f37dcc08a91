"""Design points between those of a study: for tracking and onsets, in no table."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from squealstudy.analysis.tracking.refinement import Modes
from squealstudy.errors import ConvergenceError
from squealstudy.study.complex_modes.bases import BasisTask
from squealstudy.study.complex_modes.solve import solve_design
from squealstudy.study.complex_modes.window_tasks import basis_tasks
from squealstudy.study.complex_modes.window_worker import solve_in_basis
from squealstudy.study.design import Design
from squealstudy.study.family_cache import prepared_any
from squealstudy.study.method import OVER_A_BASIS
from squealstudy.study.plan import Plan


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
    basis : BasisTask or None
        The sweep basis to solve in, where the study has one; without, points are solved exactly.
    """

    prepared_key: str
    design: Design
    x: np.ndarray
    sweeps: tuple[tuple[str, bool], ...]
    band_hz: tuple[float, float]
    basis: BasisTask | None = None

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
            with threadpool_limits(1):
                return self._solved(self.design_at(x))
        except (np.linalg.LinAlgError, FloatingPointError, ValueError) as error:
            raise ConvergenceError("failed", f"{type(error).__name__}: {error}") from error

    def _solved(self, design: Design) -> Modes:
        if self.basis is not None:
            return Modes(*solve_in_basis(self.basis, design))
        found = solve_design(prepared_any(self.prepared_key), design, self.band_hz)
        kept = ~found.overdamped
        return Modes(found.lam[kept], found.shapes[kept])


class Neighbourhoods:
    """Makes the neighbourhoods of a plan's design points."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        over_basis = plan.method.name in OVER_A_BASIS
        bases = basis_tasks(plan) if over_basis else []
        self._bases = {b.key: b for b in bases if b.path.is_file()}
        self._sweeps = tuple(
            (s.name, s.scale == "log" and all(point[s.name] > 0 for point in plan.swept))
            for s in plan.study.sweeps
        )

    def of(self, point: int) -> Between:
        """What lies around a design point."""
        task, x = self._plan.tasks[point], self._plan.coordinates[point]
        basis = self._bases.get(task.prepared_key)
        return Between(task.prepared_key, task.design, x, self._sweeps, self._plan.band_hz, basis)

    def logarithmic(self, column: int) -> bool:
        """Whether a coordinate is a logarithm."""
        return self._sweeps[column][1]

    def joined(self, a: int, b: int) -> bool:
        """Whether one prepared model holds at both points, and so between them."""
        return self._plan.tasks[a].prepared_key == self._plan.tasks[b].prepared_key
