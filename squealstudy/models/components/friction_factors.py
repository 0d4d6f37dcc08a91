"""Friction factors: friction coefficients of contact points over the parameter `friction`."""

from __future__ import annotations

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.dimensions import LENGTH
from squealstudy.models.components.file_tables import FrictionTable
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.model_file import Numbers, ValuesError
from squealstudy.models.components.random_field import random_field
from squealstudy.models.file_table import KeyPath, PlacedError

FACTOR_KEY, SPREAD_KEY, SEED_KEY = "friction_factor", "friction_spread", "friction_seed"


def friction_factors(geometry: Geometry, numbers: Numbers, number: int) -> np.ndarray:
    """Friction factors (n,) at the points of a sliding contact; 1 where the file states none.

    `friction_spread` multiplies the deviation of factors over a face from their mean.

    Raises
    ------
    PlacedError
        A file of factors cannot be used; a random field has too many points; factors are below
        zero by numbers of the model file.
    ValuesError
        Factors are below zero by a parameter of the study; a seed is no whole number.
    """
    table, pair = geometry.file.contact[number], geometry.contacts[number]
    if not isinstance(table.friction_factor, FrictionTable):
        written = table.friction_factor
        uniform = 1.0 if written is None else numbers.at("contact", number, FACTOR_KEY)
        return np.full(len(pair.gap0), uniform)
    seed_keys: KeyPath = ("contact", number, SEED_KEY)
    seed = 0.0 if table.friction_seed is None else numbers.at(*seed_keys)
    if seed != round(seed):
        raise ValuesError((seed_keys,), f"expected a whole {SEED_KEY}, got {seed:g}")
    factors = over_face(geometry, number, int(seed))
    keys: KeyPath = ("contact", number, SPREAD_KEY)
    mean = float(np.average(factors, weights=pair.slave.area))
    if table.friction_spread is not None:
        factors = mean + numbers.at(*keys) * (factors - mean)
    if (factors < 0).any():
        if table.friction_spread is None:
            keys = seed_keys
            text = f"this random field of factors falls to {factors.min():.3g}: expected at least 0"
        else:
            largest_factor = mean / (mean - float(over_face(geometry, number, int(seed)).min()))
            text = (
                f"expected a {SPREAD_KEY} of at most {largest_factor:.4g}, beyond which factors "
                f"over the face are below 0: the least would be {factors.min():.3g}"
            )
        raise ValuesError((keys,), text) if keys in numbers.given else PlacedError(keys, text)
    return factors


def over_face(geometry: Geometry, number: int, seed: int) -> np.ndarray:
    """Friction factors (n,) that vary over a face, before `friction_spread`.

    Raises
    ------
    PlacedError
        A file of factors cannot be used; a random field has too many points.
    """
    table, pair = geometry.file.contact[number], geometry.contacts[number]
    factor = table.friction_factor
    assert isinstance(factor, FrictionTable)
    if factor.file is not None:
        return geometry.measured(number, pair, FACTOR_KEY, factor.file)
    assert factor.std is not None
    assert factor.length is not None
    length = factor.length * LENGTH.factor(geometry.file.units)
    try:
        own_seed = (seed, number)  # contacts of one seed are independent
        return 1 + factor.std * random_field(pair.slave.points, pair.slave.area, length, own_seed)
    except ModelError as error:
        raise PlacedError(("contact", number, FACTOR_KEY), str(error)) from error


def mean_and_largest(geometry: Geometry, number: int, seed: int) -> tuple[float, float]:
    """Mean over the area, and largest, of friction factors that vary over a face.

    Raises
    ------
    PlacedError
        As in `over_face`.
    """
    factors, area = over_face(geometry, number, seed), geometry.contacts[number].slave.area
    return float(np.average(factors, weights=area)), float(factors.max())
