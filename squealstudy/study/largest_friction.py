"""The most friction of a model file's sliding contacts: what its assumption is judged by."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.models.components.file_tables import FrictionTable
from squealstudy.models.components.model_file import ModelFile
from squealstudy.models.file_table import KeyPath
from squealstudy.models.operating import FRICTION_RANGE

NumberOrParameter = float | str
FactorsOver = Callable[[int, int], tuple[float, float]]


@dataclass(frozen=True)
class OverFace:
    """The largest factor of a contact that varies over its face, with the spread that it has.

    Attributes
    ----------
    number : int
        Of the contact.
    spread : float or str
        `friction_spread`, or the parameter that it is.
    seed : float or str
        `friction_seed`, or the parameter that it is.
    factors_over : callable
        Number of a contact and seed -> mean and largest factor over its face; reads meshes.
    """

    number: int
    spread: NumberOrParameter
    seed: NumberOrParameter
    factors_over: FactorsOver

    def at(self, values: Mapping[str, Any]) -> Any:
        """At values of all parameters, numbers or arrays (m,)."""
        seeds, which = np.unique(_of_parameter(self.seed, values), return_inverse=True)
        faces = np.array([self.factors_over(self.number, int(seed)) for seed in seeds])
        mean, most = faces[which].T if len(seeds) > 1 else faces[0]
        return mean + _of_parameter(self.spread, values) * (most - mean)


@dataclass(frozen=True)
class LargestFriction:
    """Static friction of the sliding contact point with most of it: the group of `FRICTION_RANGE`.

    Attributes
    ----------
    factors : tuple of float, str or OverFace
        `friction_factor` of each contact, or the parameter that it is.
    own : tuple of float or str
        `friction` of each contact that has its own.
    """

    factors: tuple[NumberOrParameter | OverFace, ...]
    own: tuple[NumberOrParameter, ...] = ()

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """At values of all parameters, numbers or arrays (m,)."""
        factors = [
            f.at(values) if isinstance(f, OverFace) else _of_parameter(f, values)
            for f in self.factors
        ]
        largest = np.maximum.reduce(np.broadcast_arrays(*factors)) if factors else 1.0
        groups = [FRICTION_RANGE.group(values) * largest] if self.factors or not self.own else []
        coefficients = [_of_parameter(number, values) for number in self.own]
        groups += [FRICTION_RANGE.group({**values, "friction": mu}) for mu in coefficients]
        return np.maximum.reduce(np.broadcast_arrays(*groups))


def _of_parameter(number: NumberOrParameter, values: Mapping[str, Any]) -> Any:
    return values[number] if isinstance(number, str) else number


def largest_friction(
    file: ModelFile, places: Mapping[str, tuple[KeyPath, ...]], factors_over: FactorsOver
) -> LargestFriction:
    """Of a model file whose parameters stand at `places`."""
    parameter_at = {keys: name for name, of_name in places.items() for keys in of_name}

    def number_at(i: int, key: str) -> NumberOrParameter:
        written = file.at(("contact", i, key))
        return parameter_at.get(("contact", i, key), 1.0 if written is None else written)

    return LargestFriction(
        tuple(
            OverFace(
                i, number_at(i, "friction_spread"), number_at(i, "friction_seed"), factors_over
            )
            if isinstance(table.friction_factor, FrictionTable)
            else number_at(i, "friction_factor")
            for i, table in enumerate(file.contact)
            if table.kind == "sliding" and table.friction is None
        ),
        tuple(
            number_at(i, "friction") for i, t in enumerate(file.contact) if t.friction is not None
        ),
    )
