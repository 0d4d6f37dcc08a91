"""The largest friction of a model file's sliding contacts, by which its assumption is judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.models.components.contact_friction import has_own
from squealstudy.models.components.file_tables import FrictionTable
from squealstudy.models.components.model_file import ModelFile, Numbers
from squealstudy.models.file_table import KeyPath
from squealstudy.models.operating import FRICTION, FRICTION_RANGE, friction_parameters
from squealstudy.models.own_law import LAW_PREFIX, OF_CONTACT

NumberOrParameter = float | str
FactorsOver = Callable[[int, int], tuple[float, float]]


@dataclass(frozen=True)
class OverFace:
    """Largest factor on the friction of a contact where the factor varies over the face.

    Attributes
    ----------
    number : int
        Number of the contact, from 0.
    spread : float or str
        `friction_spread`, or the name of the parameter that sets it.
    seed : float or str
        `friction_seed`, or the name of the parameter that sets it.
    factors_over : callable
        Takes the number of a contact and a seed, returns mean and largest factor over its face; it
        reads meshes.
    """

    number: int
    spread: NumberOrParameter
    seed: NumberOrParameter
    factors_over: FactorsOver

    def at(self, values: Mapping[str, Any]) -> Any:
        """The factor at values of all parameters, which are numbers or arrays (m,)."""
        seeds, which = np.unique(_of_parameter(self.seed, values), return_inverse=True)
        faces = np.array([self.factors_over(self.number, int(seed)) for seed in seeds])
        mean, largest = faces[which].T if len(seeds) > 1 else faces[0]
        return mean + _of_parameter(self.spread, values) * (largest - mean)


@dataclass(frozen=True)
class OwnFriction:
    """A contact that has its own friction, or its own values of the friction law.

    Attributes
    ----------
    coefficient : float, str or None
        Its `friction`, or the name of the parameter that sets it; None: the study's friction.
    factor : float, str or OverFace
        Its `friction_factor`, or the name of the parameter that sets it.
    law : mapping of parameter -> float or str
        Its values of the friction law's parameters, or names of the parameters that set them.
    """

    coefficient: NumberOrParameter | None
    factor: NumberOrParameter | OverFace
    law: Mapping[str, NumberOrParameter]

    def at(self, values: Mapping[str, Any]) -> Any:
        """Static friction at values of all parameters, which are numbers or arrays (m,)."""
        of_study = self.coefficient is None
        friction = values[FRICTION.name] if of_study else _of_parameter(self.coefficient, values)
        law = {name: _of_parameter(number, values) for name, number in self.law.items()}
        mu = friction * _factor(self.factor, values)
        return FRICTION_RANGE.group({**values, **law, FRICTION.name: mu})


@dataclass(frozen=True)
class LargestFriction:
    """Largest static friction of all contact points: the number that `FRICTION_RANGE` bounds.

    Attributes
    ----------
    factors : tuple of float, str or OverFace
        `friction_factor` of each sliding contact with the study's friction, or the name of the
        parameter that sets it.
    own : tuple of OwnFriction
        The other contacts with friction.
    """

    factors: tuple[NumberOrParameter | OverFace, ...]
    own: tuple[OwnFriction, ...] = ()

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """The friction at values of all parameters, which are numbers or arrays (m,)."""
        factors = [_factor(factor, values) for factor in self.factors]
        largest = np.maximum.reduce(np.broadcast_arrays(*factors)) if factors else 1.0
        groups = [FRICTION_RANGE.group(values) * largest] if self.factors or not self.own else []
        groups += [contact.at(values) for contact in self.own]
        return np.maximum.reduce(np.broadcast_arrays(*groups))


def _factor(factor: NumberOrParameter | OverFace, values: Mapping[str, Any]) -> Any:
    return factor.at(values) if isinstance(factor, OverFace) else _of_parameter(factor, values)


def _of_parameter(number: NumberOrParameter | None, values: Mapping[str, Any]) -> Any:
    return values[number] if isinstance(number, str) else number


def largest_friction(
    file: ModelFile, keys_of: Mapping[str, tuple[KeyPath, ...]], factors_over: FactorsOver
) -> LargestFriction:
    """Largest static friction of a model file whose parameters set the numbers at `keys_of`."""
    parameter_at = {keys: name for name, of_name in keys_of.items() for keys in of_name}
    numbers = Numbers(file, {})

    def number_at(*keys: str | int) -> NumberOrParameter:
        written = file.at(keys)
        return parameter_at.get(keys, 1.0 if written is None else numbers.at(*keys))

    def factor_of(i: int) -> NumberOrParameter | OverFace:
        if not isinstance(file.contact[i].friction_factor, FrictionTable):
            return number_at("contact", i, "friction_factor")
        spread, seed = (number_at("contact", i, f"friction_{key}") for key in ("spread", "seed"))
        return OverFace(i, spread, seed, factors_over)

    def own_of(i: int) -> OwnFriction:
        table = file.contact[i]
        coefficient = None if table.friction is None else number_at("contact", i, "friction")
        law: dict[str, NumberOrParameter] = {
            f"{LAW_PREFIX}{key}": number_at("contact", i, OF_CONTACT, key)
            for key in table.friction_law
        }
        if table.state is not None:  # then the coefficient is the same at all speeds
            of_laws = (p for p in friction_parameters() if p.name.startswith(LAW_PREFIX))
            law = {p.name: p.default for p in of_laws}
        return OwnFriction(coefficient, factor_of(i), law)

    with_own = [i for i, table in enumerate(file.contact) if has_own(table)]
    sliding = [i for i, table in enumerate(file.contact) if table.kind == "sliding"]
    return LargestFriction(
        tuple(factor_of(i) for i in sliding if i not in with_own), tuple(map(own_of, with_own))
    )
