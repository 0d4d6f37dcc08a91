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
    """Parameters, modes, relative change and band [Hz] of the sensitivities of all points."""

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
        Where no design point has an assembly, or a named component mode does not exist.
    """
    assembly, _ = stacked_assembly(model, options, columns, count)
    structures, structural = structures_of(assembly), structural_names(request.parameters)
    block_size = max(1, MAX_COMPANION_ENTRIES // (2 * structures.n) ** 2)
    for parameters, rows in _groups(structures, request.parameters, count):
        requests = RequestedSensitivities(
            parameters, structural, request.choice, request.change, request.band_hz
        )
        for start in range(0, len(rows), block_size):
            block = rows[start : start + block_size]
            block_columns = {
                k: np.asarray(x)[block] if np.ndim(x) else x for k, x in columns.items()
            }
            yield block, stacked_sensitivities(model, options, block_columns, len(block), requests)


def _groups(
    structures: StackedStructures, requested: Sequence[RequestedParameter], count: int
) -> Iterator[tuple[list[StateParameter], np.ndarray]]:
    """Groups of design points with equal parameters: the parameters, numbers of the points."""
    omega = np.sqrt(np.maximum(np.nan_to_num(structures.k_el), 0.0))
    if not any(parameter.every for parameter in requested):
        yield state_parameters(requested, _frequencies(structures, omega[0])), np.arange(count)
        return
    groups: dict[tuple[StateParameter, ...], list[int]] = {}
    distinct, structure_of_point = np.unique(omega, axis=0, return_inverse=True)
    structure_of_point = np.broadcast_to(structure_of_point.reshape(-1), count)
    parameters_of = [
        tuple(state_parameters(requested, _frequencies(structures, row))) for row in distinct
    ]
    for number, parameters in enumerate(parameters_of):
        groups.setdefault(parameters, []).append(number)
    for parameters, numbers in groups.items():
        yield list(parameters), np.flatnonzero(np.isin(structure_of_point, numbers))


def _frequencies(structures: StackedStructures, omega: np.ndarray) -> dict[ModeKey, float]:
    """Free frequency [rad/s] of every component mode of a structure."""
    ends = structures.offsets
    return {
        (name, mode + 1): float(omega[int(start) + mode])
        for name, start, end in zip(structures.components, ends, ends[1:], strict=False)
        for mode in range(int(end - start))
    }
