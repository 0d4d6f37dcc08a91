"""Sensitivities of design points, one after the other, as rows of a worker."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from squealstudy.engine.cache import known_gap, prepared_model
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.rows import failed_row
from squealstudy.engine.workers import Solved
from squealstudy.kinds.sensitivity.tables import SCHEMA, solved_row
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.mechanics.sensitivity_batch import Request
from squealstudy.mechanics.sensitivity_parameters import (
    RequestedParameter,
    design_structure,
    state_parameters,
    structural_names,
)
from squealstudy.modes.sensitivity.mode_sensitivities import ModeSensitivities, with_more
from squealstudy.modes.sensitivity.reduced import ModeChoice, point_sensitivities, solve_families
from squealstudy.modes.sensitivity.structural import structural_sensitivities
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.study.design import DesignPoint
from squealstudy.system.linearise import component_frequencies

N_TIMED_PARAMETERS = 3  # parameters that are timed for a forecast of all


@dataclass(frozen=True)
class SensitivityRequest:
    """What is to be computed at every design point.

    Attributes
    ----------
    asked : tuple of RequestedParameter
        Parameters of the derivatives.
    choice : ModeChoice
        Modes of the derivatives.
    change : float
        Finite change, relative to the value; absolute for damping ratios.
    band_hz : (low, high)
        Frequency band of the modes, Hz.
    settings : ReductionSettings
        Settings of the reduction.
    """

    asked: tuple[RequestedParameter, ...]
    choice: ModeChoice
    change: float
    band_hz: tuple[float, float]
    settings: ReductionSettings

    @property
    def of_batch(self) -> Request:
        """The same request for a batch of small models, as the library takes it."""
        return Request(self.asked, self.choice, self.change, self.band_hz)


@dataclass(frozen=True)
class SensitivityTask:
    """Design points that one worker solves and writes together."""

    request: SensitivityRequest
    points: DesignPoints


def solve_points(task: SensitivityTask) -> Solved:
    """Rows of the points of a task, one after the other."""
    rows, n_cached_gaps = [], 0
    for point in task.points:
        gap = known_gap(point.structure, point)
        n_cached_gaps += gap is not None
        rows.append(point_row(point, task.request, partial(prepared_model, point.structure), gap))
    return Solved(rows, known=n_cached_gaps)


def point_row(
    point: DesignPoint,
    request: SensitivityRequest,
    prepared: Callable[[], PreparedModel],
    gap: np.ndarray | None = None,
) -> dict[str, Any]:
    """Row of one design point; a failure is a row, too.

    `prepared` makes its prepared model; `gap` (nc,) [m] has the gaps of its working point if known.
    """
    started = time.perf_counter()
    try:
        cells, modes = design_sensitivities(point, request, prepared(), gap)
    except FAILURES as error:
        wall_s = time.perf_counter() - started
        return failed_row(SCHEMA, point.point_id, *reason(error), wall_s)
    return solved_row(point.point_id, time.perf_counter() - started, cells, modes)


def design_sensitivities(
    point: DesignPoint,
    request: SensitivityRequest,
    prepared: PreparedModel,
    gap: np.ndarray | None = None,
) -> tuple[WorkingPoint, list[ModeSensitivities]]:
    """Working point and sensitivities of one design point; one of FAILURES where it fails."""
    state = point.state()
    solved = solve_families(prepared, state, request.band_hz, request.choice, gap)
    parameters = state_parameters(request.asked, component_frequencies(prepared.model))
    modes = point_sensitivities(solved, parameters, request.change, request.band_hz[1])
    structure = design_structure(point, request.settings)
    names = structural_names(request.asked)
    more = structural_sensitivities(solved, structure, names, request.change)
    return solved.point, [with_more(m, s) for m, s in zip(modes, more, strict=True)]


def point_seconds(point: DesignPoint, request: SensitivityRequest) -> float:
    """Expected seconds of a design point, from its modes and from some of its parameters.

    A few parameters of the state and one of the structure are timed, and scaled to their number.

    Raises
    ------
    ConvergenceError
        Where there is no working point.
    """
    prepared = prepared_model(point.structure)
    started = time.perf_counter()
    solved = solve_families(prepared, point.state(), request.band_hz, request.choice)
    total = time.perf_counter() - started
    parameters = state_parameters(request.asked, component_frequencies(prepared.model))
    if parameters:
        started, few = time.perf_counter(), parameters[:N_TIMED_PARAMETERS]
        point_sensitivities(solved, few, request.change, request.band_hz[1])
        total += (time.perf_counter() - started) * len(parameters) / len(few)
    names = structural_names(request.asked)
    if names:
        started = time.perf_counter()
        structure = design_structure(point, request.settings)
        structural_sensitivities(solved, structure, names[:1], request.change)
        total += (time.perf_counter() - started) * len(names)
    return total
