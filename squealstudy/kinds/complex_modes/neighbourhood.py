"""Further points between the design points of a study, for tracking and onsets; in no table.

With them a worker finds onsets between two design points (`refine_onsets`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from threadpoolctl import ThreadpoolController

from squealstudy.engine.cache import known_gap, load_prepared, prepared_any
from squealstudy.engine.plan import Plan
from squealstudy.errors import ConvergenceError, ExtensionError, SquealstudyError
from squealstudy.kinds.complex_modes.batch import modes_at
from squealstudy.kinds.complex_modes.problems import SweptStructure, problem_of, swept_structures
from squealstudy.kinds.complex_modes.solve_tasks import boxes, rung_of, whole_box
from squealstudy.linalg.quadratic_pencil import QuadraticPencil
from squealstudy.mechanics.failures import FAILURES
from squealstudy.modes.point import DENSE, state_working_point
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.rungs import rung_named
from squealstudy.modes.tracking.followed_root import FollowedEnd, PencilLine, followed_onset
from squealstudy.modes.tracking.interpolated import InterpolatedModes, ModalMatrices
from squealstudy.modes.tracking.onsets import Onset, SolvedLine, refine_onset
from squealstudy.modes.tracking.refinement import Modes
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.study.design import DesignPoint
from squealstudy.system.linearise import linearise


@cache
def _threads() -> ThreadpoolController:
    """Thread pools of this process, cached because a look-up takes as long as a small solve."""
    return ThreadpoolController()


@dataclass(frozen=True)
class PointNeighbourhood:
    """The neighbourhood of a design point, in which one prepared model holds.

    Attributes
    ----------
    structure : SweptStructure
    rung : str
        Name of the rung by which the study solves the point.
    box : Box
        The box of parameters in which it does so.
    design : DesignPoint
        The design point at coordinates `x`.
    x : ndarray (p,)
        Coordinates of the point, as in Plan.coordinates.
    sweeps : tuple of (str, bool)
        Parameter of each coordinate, and whether the coordinate is its logarithm.
    stacked : bool
        Whether the point is one of a batch of small models.
    """

    structure: SweptStructure
    rung: str
    box: Box
    design: DesignPoint
    x: np.ndarray
    sweeps: tuple[tuple[str, bool], ...]
    stacked: bool = False

    def design_at(self, x: np.ndarray) -> DesignPoint:
        """The design at other coordinates (p,); where one is unchanged its value stays exact."""
        values = dict(self.design.values)
        for (name, log), coordinate, new_coordinate in zip(self.sweeps, self.x, x, strict=True):
            if new_coordinate != coordinate:
                values[name] = float(np.exp(new_coordinate) if log else new_coordinate)
        return self.design.with_values(values)

    def solve(self, x: np.ndarray) -> Modes:
        """Solve for the oscillating modes at coordinates (p,).

        Raises
        ------
        ConvergenceError
            Where there is no working point, or the eigenproblem has no solution.
        """
        if self.stacked:
            return self._alone(x)
        rung, point = rung_named(self.rung), self.design_at(x)
        problem = problem_of(self.structure, rung)
        with _threads().limit(limits=1):
            if not rung.exact:
                try:
                    return rung.modes_at(problem, point, self.box)
                except ExtensionError:
                    raise
                except FAILURES:
                    rung = rung_named(problem.swept.exact)
            try:
                return rung.modes_at(problem, point, self.box)
            except SquealstudyError:
                raise
            except FAILURES as error:
                raise ConvergenceError("failed", f"{type(error).__name__}: {error}") from error

    def _alone(self, x: np.ndarray) -> Modes:
        """Modes at coordinates x, solved exactly; ConvergenceError for any failure."""
        try:
            return modes_at(self.design_at(x), self.structure.band_hz)
        except ExtensionError:
            raise
        except ConvergenceError:
            raise
        except FAILURES as error:
            raise ConvergenceError("failed", f"{type(error).__name__}: {error}") from error

    def pencils(self, column: int) -> PencilLine | None:
        """Matrices along coordinate `column`; None unless a reduced model is solved densely."""
        prepared = None if self.stacked or self.rung != DENSE else prepared_any(self.structure.key)
        if not isinstance(prepared, PreparedModel):
            return None
        gap: np.ndarray | None = None

        def pencil(value: float) -> QuadraticPencil:
            nonlocal gap
            x = self.x.copy()
            x[column] = value
            state = self.design_at(x).state()
            point = state_working_point(prepared, state, near=gap)
            gap = point.gap
            return linearise(prepared.model, point, state).pencil

        return PencilLine(pencil, prepared.shape_basis)

    def matrices(self) -> ModalMatrices:
        """Damping and stiffness of the design point in the real modes of its structure.

        Raises
        ------
        ConvergenceError
            Where there is no working point.
        """
        prepared = load_prepared(self.structure.key)
        state, X = self.design.state(), prepared.shape_basis
        cached_gap = known_gap(self.structure.key, self.design)
        with _threads().limit(limits=1):
            point = state_working_point(prepared, state, cached_gap)
            system = linearise(prepared.model, point, state)
            return ModalMatrices(X.T @ system.C @ X, X.T @ system.K @ X, prepared.sensor_shapes)

    def way_to(self, other: PointNeighbourhood) -> InterpolatedModes:
        """Interpolation from the modes of this point to those of a point of another structure.

        Raises
        ------
        ConvergenceError
            Where one of the two has no working point.
        """
        low, high = self.structure.band_hz
        band = (2 * np.pi * low, 2 * np.pi * high)
        return InterpolatedModes(
            a=self.matrices(), b=other.matrices(), x_a=self.x, x_b=other.x, band=band
        )


class StudyNeighbourhoods:
    """Makes the neighbourhoods of a plan's design points.

    Parameters
    ----------
    plan : Plan
    """

    def __init__(self, plan: Plan) -> None:
        self._plan, whole = plan, plan.whole
        self._structures = {s.key: s for s in swept_structures(whole)}
        self._structure = plan.tasks.structure_index
        self._rungs = {key: rung_of(whole, s) for key, s in self._structures.items()}
        self._boxes = _boxes_of_points(whole)
        self._sweeps = tuple(
            (s.name, s.scale == "log" and bool((plan.swept[:, k] > 0).all()))
            for k, s in enumerate(plan.study.sweeps)
        )

    def of(self, point: int) -> PointNeighbourhood:
        """The neighbourhood of the plan's design point with this number."""
        task, x = self._plan.tasks[point], self._plan.coordinates[point]
        structure = self._structures[task.structure]
        box = self._boxes.get(task.point_id) or whole_box(structure)
        return PointNeighbourhood(
            structure=structure,
            rung=self._rungs[structure.key],
            box=box,
            design=task,
            x=x,
            sweeps=self._sweeps,
            stacked=self._plan.stacked,
        )

    def logarithmic(self, column: int) -> bool:
        """Whether coordinate `column` is the logarithm of its parameter."""
        return self._sweeps[column][1]

    def joined(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Whether one prepared model holds at points a and b (n,), and so between them."""
        within: np.ndarray = self._structure[a] == self._structure[b]
        return within


def _boxes_of_points(plan: Plan) -> dict[str, Box]:
    """The box in which each point of a plan is solved, by id.

    Empty where points are solved one by one, or in a basis that serves all of them.
    """
    rung = plan.method.rung
    if rung.exact or rung.over_a_basis:
        return {}
    names = plan.tasks.ids
    box_rows = boxes(plan, plan.tasks)
    return {name: box for _, rows, box in box_rows for name in names[rows].astype(str).tolist()}


FAILED = "failed"


@dataclass(frozen=True)
class OnsetTask:
    """Onsets of some modes between two design points, for a worker to refine.

    Attributes
    ----------
    rows : list of int
        Rows of the onsets in their table.
    places : list of (int, int)
        Index of each mode among the modes of the first and of the second point.
    between : PointNeighbourhood
        Neighbourhood of the first point.
    column : int
        Index of the coordinate along which onsets are refined.
    end : float
        This coordinate at the second point.
    low, high : Modes
        Modes at the first and at the second point.
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    precision : float
        Precision of the onset (`refine_onset`).
    """

    rows: list[int]
    places: list[tuple[int, int]]
    between: PointNeighbourhood
    column: int
    end: float
    low: Modes
    high: Modes
    tolerance: float
    precision: float


def refine_onsets(task: OnsetTask) -> list[tuple[int, Onset | str]]:
    """Rows of the table with refined onsets, or with the status of the error instead."""
    start = task.between.x

    def solve(value: float) -> Modes:
        x = start.copy()
        x[task.column] = value
        return task.between.solve(x)

    samples = SolvedLine(
        low=float(start[task.column]),
        at_low=task.low,
        high=task.end,
        at_high=task.high,
        solve=solve,
    )
    pencils = task.between.pencils(task.column)
    onsets: list[tuple[int, Onset | str]] = []
    for row, mode_pair in zip(task.rows, task.places, strict=True):
        try:
            onset = None if pencils is None else _followed(task, pencils, mode_pair)
            if onset is None:
                onset = refine_onset(samples, *mode_pair, task.tolerance, task.precision)
        except FAILURES as error:
            onsets.append((row, getattr(error, "status", FAILED)))
        else:
            onsets.append((row, onset))
    return onsets


def _followed(task: OnsetTask, pencils: PencilLine, mode_pair: tuple[int, int]) -> Onset | None:
    """The onset, by following the root alone; None where that fails or is not certain."""
    low = float(task.between.x[task.column])
    ends = FollowedEnd(low, task.low, mode_pair[0]), FollowedEnd(task.end, task.high, mode_pair[1])
    with _threads().limit(limits=1):
        try:
            return followed_onset(pencils, ends, task.tolerance, task.precision)
        except FAILURES:
            return None
