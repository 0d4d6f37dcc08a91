"""What a design point of a sensitivity study will cost, from a few of its parameters."""

from __future__ import annotations

import time

from squealstudy.engine.cache import prepared_model
from squealstudy.kinds.sensitivity.parameters import state_parameters, structural_names
from squealstudy.kinds.sensitivity.worker import Request, design_structure
from squealstudy.modes.sensitivity.reduced import point_sensitivities, solve_families
from squealstudy.modes.sensitivity.structural import structural_sensitivities
from squealstudy.study.design import DesignPoint
from squealstudy.system.linearise import component_frequencies

TIMED = 3  # parameters that stand for all


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
        structure = design_structure(point, request.options, request.settings)
        structural_sensitivities(solved, structure, names[:1], request.change)
        total += (time.perf_counter() - started) * len(names)
    return total
