"""Modes measured on free components of a model file, as values of a study's mode parameters."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING

from squealstudy.models.parameter_names import (
    DAMPING_RATIO,
    FREQUENCY_SCALE,
    ModeParameter,
    StudyParameter,
)

if TYPE_CHECKING:  # scipy and scikit-fem stay out of what computes nothing
    from squealstudy.models.components.definition import FileDefinition
    from squealstudy.models.components.free_modes import MeasuredMode
    from squealstudy.models.parameter import ModelDefinition


def measured_values(
    model: ModelDefinition, cutoff_hz: float, parameters: Iterable[StudyParameter]
) -> dict[str, float]:
    """Measured frequencies and damping ratios of component modes, as values of mode parameters.

    A frequency is a factor on the one computed at the defaults of the model file. The factor stays
    the same where a study changes the component. Values that the study sets itself are left out.

    Parameters
    ----------
    model : ModelDefinition
    cutoff_hz : float
        Highest frequency [Hz] of component modes in the reduction.
    parameters : iterable of StudyParameter
        Parameters that the study sets or sweeps.

    Raises
    ------
    StudyFileError
        About the model file: a table of measured modes is wrong, or the component is fixed.
    """
    from squealstudy.models.components.definition import FileDefinition

    if not isinstance(model, FileDefinition) or not model.meshed:
        return {}
    given_names = {
        (p.component, mode, p.quantity)
        for p in parameters
        if isinstance(p, ModeParameter)
        for mode in p.modes
    }
    values: dict[str, float] = {}
    for name in _measured(model):
        for mode in _free(_ByFiles(model), name, cutoff_hz):
            quantities = {
                FREQUENCY_SCALE: mode.frequency_scale,
                DAMPING_RATIO: mode.damping_ratio,
            }
            for quantity, factor in quantities.items():
                if factor is not None and (name, mode.number, quantity) not in given_names:
                    values[f"{name}.modes[{mode.number}].{quantity}"] = factor
    return values


def _measured(model: FileDefinition) -> list[str]:
    from squealstudy.study.components import build_of  # imports scikit-fem

    tables = build_of(model).brake.file.components
    return [name for name, table in tables.items() if table.measured is not None]


class _ByFiles:
    """A model as key of a cache: equal to another model of the same files."""

    def __init__(self, model: FileDefinition) -> None:
        self.model = model

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ByFiles) and self.model.files == other.model.files

    def __hash__(self) -> int:
        return hash(self.model.files)


@lru_cache(maxsize=16)
def _free(by_files: _ByFiles, name: str, cutoff_hz: float) -> list[MeasuredMode]:
    """Measured modes of a free component, from the table that the model file names."""
    from squealstudy.models.components.free_modes import tabled_modes
    from squealstudy.study.components import build_of, free_component  # imports scikit-fem

    build = build_of(by_files.model)
    _, (K, M), _ = free_component(by_files.model, name)
    with build.told(by_files.model.defaults()):
        return tabled_modes(build.brake, name, K, M, cutoff_hz)
