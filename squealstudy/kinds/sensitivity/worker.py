"""What a worker process does at the design points of a chunk, and what a point will cost."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import Any

from squealstudy.engine.cache import known_gap, prepared_model
from squealstudy.engine.rows import FAILURES, failed_row, reason
from squealstudy.engine.workers import Solved
from squealstudy.kinds.sensitivity.parameters import Asked, state_parameters, structural_names
from squealstudy.kinds.sensitivity.tables import SCHEMA, solved_row
from squealstudy.modes.sensitivity.mode_sensitivities import ModeSensitivities, with_more
from squealstudy.modes.sensitivity.reduced import ModeChoice, point_sensitivities, solve_families
from squealstudy.modes.sensitivity.structural import Structure, structural_sensitivities
from squealstudy.reduction.cmt import BasisSettings
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.study.design import DesignPoint
from squealstudy.system.linearise import component_frequencies

TIMED = 3  # parameters that stand for all in a forecast


@dataclass(frozen=True)
class Request:
    """What is asked of every design point.

    Attributes
    ----------
    asked : tuple of Asked
    choice : ModeChoice
    change : float
        Relative finite change.
    band_hz : (low, high)
    settings : BasisSettings
    """

    asked: tuple[Asked, ...]
    choice: ModeChoice
    change: float
    band_hz: tuple[float, float]
    settings: BasisSettings


@dataclass(frozen=True)
class SensitivityTask:
    """Design points that one worker solves and writes together."""

    request: Request
    points: tuple[DesignPoint, ...]


def solve_sensitivities(task: SensitivityTask) -> Solved:
    """Solve the points of a chunk."""
    known = sum(known_gap(p.structure, p) is not None for p in task.points)
    return Solved([_row(point, task.request) for point in task.points], known=known)


def _row(point: DesignPoint, request: Request) -> dict[str, Any]:
    started = time.perf_counter()
    try:
        found, modes = design_sensitivities(point, request)
    except FAILURES as error:
        wall_s = time.perf_counter() - started
        return failed_row(SCHEMA, point.point_id, *reason(error), wall_s)
    return solved_row(point.point_id, time.perf_counter() - started, found, modes)


def design_sensitivities(
    point: DesignPoint, request: Request
) -> tuple[WorkingPoint, list[ModeSensitivities]]:
    """Working point and sensitivities of one design point; SquealstudyError."""
    prepared = prepared_model(point.structure)
    gap = known_gap(point.structure, point)
    state = point.state()
    solved = solve_families(prepared, state, request.band_hz, request.choice, gap)
    parameters = state_parameters(request.asked, component_frequencies(prepared.model))
    modes = point_sensitivities(solved, parameters, request.change, request.band_hz[1])
    structure = design_structure(point, request.settings)
    names = structural_names(request.asked)
    more = structural_sensitivities(solved, structure, names, request.change)
    return solved.point, [with_more(m, s) for m, s in zip(modes, more, strict=True)]


def design_structure(design: DesignPoint, settings: BasisSettings) -> Structure:
    """How the assembly of a design is built."""
    return Structure(
        partial(design.model.build, design.options),
        design.plain_values(),
        settings.component_cutoff,
        settings.damped_to,
    )


def point_seconds(point: DesignPoint, request: Request) -> float:
    """Expected seconds: modes, a few parameters of the state and one of the structure, scaled.

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
        started, few = time.perf_counter(), parameters[:TIMED]
        point_sensitivities(solved, few, request.change, request.band_hz[1])
        total += (time.perf_counter() - started) * len(parameters) / len(few)
    names = structural_names(request.asked)
    if names:
        started = time.perf_counter()
        structure = design_structure(point, request.settings)
        structural_sensitivities(solved, structure, names[:1], request.change)
        total += (time.perf_counter() - started) * len(names)
    return total
