"""Units of a study's parameters, with those in which its file writes values."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from squealstudy.models.units import unit_as_written
from squealstudy.study.units import quantities

if TYPE_CHECKING:
    from squealstudy.study.definition import ResolvedStudy


@lru_cache(maxsize=16)  # each table of the results asks for them
def _quantities(text: str) -> dict[str, list[str]]:
    """Values that a study file writes with a unit, by parameter."""
    by_name: dict[str, list[str]] = {}
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError):  # of results that were damaged, or made by hand
        return by_name
    for name, quantity in quantities(tables):
        by_name.setdefault(name, []).append(quantity)
    return by_name


def parameter_units(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Unit of each parameter in the tables; ``torque`` has that of the columns ``torque_*``.

    Where the study file writes values in another unit, it is a `UnitAsWritten`.
    """
    by_name = _quantities(str(manifest.get("study", "")))
    return {
        name: unit_as_written(by_name[name], unit) if name in by_name else unit
        for name, unit in manifest.get("units", {}).items()
    }


def units_of_study(study: ResolvedStudy) -> dict[str, str]:
    """Unit of each parameter of a study's model, as `parameter_units`."""
    units = {parameter.name: parameter.unit for parameter in study.model.parameters}
    return parameter_units({"study": study.source.text, "units": units})
