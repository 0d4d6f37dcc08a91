"""Sensitivities of a batch of small models: parameters expanded, design points cut into blocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from squealstudy.mechanics.sensitivity_parameters import (
    RequestedParameter,
    state_parameters,
    structural_names,
)
from squealstudy.models.operating import ModeKey
from squealstudy.models.parameter import ModelDefinition
from squealstudy.modes.sensitivity.reduced import ModeChoice
from squealstudy.modes.sensitivity.state_derivatives import StateParameter
from squealstudy.stacked.modes import Columns, stacked_assembly, structures_of
from squealstudy.stacked.sensitivities import (
    RequestedSensitivities,
    StackedSensitivities,
    stacked_sensitivities,
)
from squealstudy.stacked.structures import StackedStructures

MAX_COMPANION_ENTRIES = 2_000_000  # of companion matrices that are in memory at once, 16 bytes each


class Request(NamedTuple):
    """What is asked of every design point: parameters, modes, relative change, band [Hz]."""

    parameters: Sequence[RequestedParameter]
    choice: ModeChoice
    change: float
    band_hz: tuple[float, float]


def batch_sensitivities(
    model: ModelDefinition,
    options: Mapping[str, str | int],
    columns: Columns,
    count: int,
    request: Request,
) -> Iterator[tuple[np.ndarray, StackedSensitivities]]:
    """Numbers of design points, and the sensitivities of these, block by block.

    Arguments as of `stacked_system`. Design points of a block have the same parameters: which
    modes of a component are elastic may depend on its structure.

    Raises
    ------
    SquealstudyError
        Where no design point has an assembly, or a component mode is named that there is not.
    """
    assembly, _ = stacked_assembly(model, options, columns, count)
    structures, structural = structures_of(assembly), structural_names(request.parameters)
    most = max(1, MAX_COMPANION_ENTRIES // (2 * structures.n) ** 2)
    for parameters, rows in _groups(structures, request.parameters, count):
        requests = RequestedSensitivities(
            parameters, structural, request.choice, request.change, request.band_hz
        )
        for start in range(0, len(rows), most):
            block = rows[start : start + most]
            block_columns = {
                k: np.asarray(x)[block] if np.ndim(x) else x for k, x in columns.items()
            }
            yield block, stacked_sensitivities(model, options, block_columns, len(block), requests)


def _groups(
    structures: StackedStructures, asked: Sequence[RequestedParameter], count: int
) -> Iterator[tuple[list[StateParameter], np.ndarray]]:
    """Parameters of the design state, and the numbers of the design points that have these."""
    omega = np.sqrt(np.maximum(np.nan_to_num(structures.k_el), 0.0))
    if not any(parameter_asked.every for parameter_asked in asked):
        yield state_parameters(asked, _frequencies(structures, omega[0])), np.arange(count)
        return
    groups: dict[tuple[StateParameter, ...], list[int]] = {}
    distinct, place = np.unique(omega, axis=0, return_inverse=True)
    place = np.broadcast_to(place.reshape(-1), count)
    of_each = [tuple(state_parameters(asked, _frequencies(structures, row))) for row in distinct]
    for number, parameters in enumerate(of_each):
        groups.setdefault(parameters, []).append(number)
    for parameters, numbers in groups.items():
        yield list(parameters), np.flatnonzero(np.isin(place, numbers))


def _frequencies(structures: StackedStructures, omega: np.ndarray) -> dict[ModeKey, float]:
    """Free frequency [rad/s] of every component mode of a structure."""
    ends = structures.offsets
    return {
        (name, mode + 1): float(omega[int(start) + mode])
        for name, start, end in zip(structures.components, ends, ends[1:], strict=False)
        for mode in range(int(end - start))
    }
